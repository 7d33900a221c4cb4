//! Registers that a client follows to get a record of each change. The plant compares these registers before
//! each poll and after each run of the firmware.

use super::Plant;
use super::force::Forces;
use crate::devices::Device;
use crate::identity::DeviceIndex;
use crate::journal::{By, Change, Journal, Keep, MAX_FOLLOWED, Rams};
use crate::layout::place::status_of;
use crate::layout::{Area, RegisterPhase, RegisterRef};
use crate::memory::{Unmapped, Width};

/// The reason why registers cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FollowError {
    /// The range is not fully covered by register areas.
    #[error("no register area covers byte {}", .0.offset)]
    Unmapped(Unmapped),
    /// Too many registers are followed.
    #[error(
        "too many registers are followed: an instance has {MAX_FOLLOWED}, and each client leaves as many to others as it \
         follows; follow fewer registers or blocks"
    )]
    TooMany,
}

impl From<Unmapped> for FollowError {
    fn from(unmapped: Unmapped) -> Self {
        FollowError::Unmapped(unmapped)
    }
}

impl Plant {
    /// Records all changes from now on of the registers in the `len` bytes from `offset` on of PLC `plc`.
    /// Following registers does not influence the plant.
    ///
    /// # Errors
    /// [`FollowError`]. If there are too many registers, the first ones are followed up to the maximum.
    pub fn follow_registers(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        len: u32,
        keep: Keep,
    ) -> Result<(), FollowError> {
        self.follow_registers_for(0, plc, offset, len, keep)
    }

    /// Follows registers for a client like [`Plant::follow_registers`], but only as many as the maximum for
    /// all clients still allows.
    pub(crate) fn follow_registers_for(
        &mut self,
        client: u128,
        plc: DeviceIndex,
        offset: u32,
        len: u32,
        keep: Keep,
    ) -> Result<(), FollowError> {
        let (widths, ram) = self.ram(plc, offset)?;
        let registers = widths.registers(ram, offset, len)?;
        let (journal, rams) = self.compared();
        // Other clients may follow these registers already. The changes up to this moment are not changes for this client.
        // Only these registers are compared, because a client follows thousands of registers one after the other.
        journal.compare_in((plc, offset..offset.saturating_add(len)), rams.now, By::Program, &rams);
        let follows =
            |&(offset, width): &(u32, Width)| journal.follow(client, plc, offset, width, keep, &rams);
        if registers.iter().all(follows) { Ok(()) } else { Err(FollowError::TooMany) }
    }

    /// Returns at most `max` changes of registers that are followed for observers, beginning with change number `from`.
    /// Also returns the number of the next change.
    pub fn changes(&mut self, from: u64, max: usize) -> (Vec<Change>, u64) {
        self.journal.changes(from, max)
    }

    /// Does the same as [`Plant::changes`] for the registers that a client follows.
    pub(crate) fn changes_for(&mut self, client: u128, from: u64, max: usize) -> (Vec<Change>, u64) {
        self.journal.changes_for(client, from, max)
    }

    /// Releases the registers that clients follow as observers if `is_present` is false for the client.
    #[cfg(feature = "channel")]
    pub(crate) fn release_departed(&mut self, is_present: impl Fn(u128) -> bool) {
        self.journal.release_departed(is_present);
    }

    /// Compares the followed registers, and records each difference as a change by `by`.
    #[inline]
    pub(super) fn keep_changes(&mut self, by: By) {
        if self.journal.follows() {
            let (journal, rams) = self.compared();
            journal.compare(rams.now, by, &rams);
        }
    }

    /// Notifies observers of the changes at this moment, to which the plant has advanced.
    pub(super) fn arrive(&mut self) {
        if self.journal.follows() {
            let (journal, rams) = self.compared();
            journal.arrived(rams.now, &rams);
        }
    }

    /// Returns the journal, and the registers that the journal compares with their earlier values.
    #[inline]
    fn compared(&mut self) -> (&mut Journal, Compared<'_>) {
        let Plant { now, devices, forces, journal, .. } = self;
        (journal, Compared { now: *now, devices, forces })
    }
}

/// Returns the present phase of an area of this device.
pub(super) fn phase_in(device: &dyn Device, area: &'static Area) -> RegisterPhase {
    let value_of =
        |status: RegisterRef| device.segment().load(status.offset(), status.address().width()).ok();
    area.phase(status_of(area).and_then(value_of))
}

struct Compared<'a> {
    now: u64,
    devices: &'a [Box<dyn Device>],
    forces: &'a Forces,
}

impl Rams for Compared<'_> {
    fn load(&self, plc: DeviceIndex, offset: u32, width: Width) -> Option<u32> {
        self.devices.get(plc.index())?.segment().load(offset, width).ok()
    }

    fn live(&self, plc: DeviceIndex, offset: u32) -> RegisterPhase {
        let Some(device) = self.devices.get(plc.index()) else { return RegisterPhase::ALWAYS };
        let layout = device.layout();
        let Ok(area) = layout.area_at(layout.at(Width::Byte, offset)) else { return RegisterPhase::ALWAYS };
        phase_in(&**device, area)
    }

    fn is_forced(&self, plc: DeviceIndex, offset: u32) -> bool {
        self.forces.list().iter().any(|forced| (forced.plc, forced.offset) == (plc, offset))
    }
}
