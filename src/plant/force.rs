//! Forced registers: they keep their value even if firmware or PLC write them.
//!
//! Plain RAM cannot trap accesses. So the plant restores a forced value before each poll and after each write
//! of the firmware. The firmware therefore never sees another value. A PLC on the mapped RAM sees its own
//! value until the next processor cycle or the next event of the bus (decision D-105).

use super::Plant;
use crate::devices::Device;
use crate::identity::DeviceIndex;
use crate::journal::{Force, Unforce};
use crate::layout::{DeviceLayout as Layout, LayoutError};
use crate::memory::{Address, MemoryError, Width};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};

/// A register with a forced value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Forced {
    /// Index of the PLC in the plant.
    pub plc: DeviceIndex,
    /// First byte of the register in the image.
    pub offset: u32,
    /// Width of the register.
    pub width: Width,
    /// Value that the register keeps.
    pub value: u32,
}

/// The reason why a register cannot be forced.
#[derive(Debug, thiserror::Error)]
pub enum ForceError {
    /// The plant has no such PLC.
    #[error("there is no such PLC")]
    NoSuchPlc,
    /// Too many registers are forced.
    #[error("{most} registers are forced, which is the maximum; unforce one first", most = Forces::MOST)]
    TooMany,
    /// No register area covers the address.
    #[error(transparent)]
    NoArea(#[from] LayoutError),
    /// The access covers only a part of a register, or several registers.
    #[error("{asked}: only a whole register can be forced, here {right}")]
    NotWhole {
        /// Address and width that the client wanted to force.
        asked: Address,
        /// The register at this address.
        right: Address,
    },
    /// The value has more bits than the register.
    #[error("{address}: 16#{value:X} does not fit, a {} holds at most 16#{:X}", .address.width(), .address.width().max_value())]
    TooWide {
        /// Address and width of the register.
        address: Address,
        /// Value, too large for the register.
        value: u32,
    },
    /// The address is misaligned or outside the RAM.
    #[error(transparent)]
    Memory(#[from] MemoryError),
}

impl Plant {
    /// Makes a register keep `value` against firmware and PLC, from now until [`Plant::unforce`]. A second
    /// call for the register changes the value.
    ///
    /// # Errors
    /// [`ForceError`].
    pub fn force(&mut self, forced: Forced) -> Result<(), ForceError> {
        let Forced { plc, offset, width, value } = forced;
        let index = plc.index();
        let target = self.devices.get(index).ok_or(ForceError::NoSuchPlc)?;
        forced.check(target.layout())?;
        target.segment().load(offset, width)?;
        if !target.has(offset, width) {
            return Err(MemoryError::OutOfRange {
                address: target.layout().at(width, offset),
                end: target.segment().size(),
            }
            .into());
        }
        if !self.forces.set(forced) {
            return Err(ForceError::TooMany);
        }
        self.look_for_writes();
        self.forces.apply(&self.devices);
        if let Some(writes) = self.devices[index].address_writes() {
            writes.written_by_address(offset, width.bytes());
        }
        self.leave();
        self.journal.push(self.now, Force { plc, offset, width: width.bytes() as u8, value });
        Ok(())
    }

    /// Releases a forced register. The register keeps the value until the next write. Returns true if it was forced.
    pub fn unforce(&mut self, plc: DeviceIndex, offset: u32) -> bool {
        let ended = self.forces.end(plc, offset);
        if ended {
            self.journal.push(self.now, Unforce { plc, offset });
        }
        ended
    }

    /// Returns the forced registers, in the order of PLCs and addresses.
    pub fn forces(&self) -> &[Forced] {
        self.forces.list()
    }
}

impl Forced {
    /// Checks that the access covers exactly one register, or plain RAM, and that the value fits.
    pub(super) fn check(&self, device: &'static Layout) -> Result<(), ForceError> {
        let address = device.at(self.width, self.offset);
        device.area_at(address)?;
        if self.value > self.width.max_value() {
            return Err(ForceError::TooWide { address, value: self.value });
        }
        for byte in self.offset..self.offset + self.width.bytes() {
            // Plain RAM and padding contain no registers, but may be forced.
            for register in device.registers_at(Address::byte(byte), None).unwrap_or_default() {
                if (register.offset(), register.width()) != (self.offset, self.width.bytes()) {
                    return Err(ForceError::NotWhole { asked: address, right: register.address() });
                }
            }
        }
        Ok(())
    }
}

/// All forced registers, in the order of PLCs and addresses.
#[derive(Default)]
pub(super) struct Forces {
    list: Vec<Forced>,
}

impl SnapshotFields for Forces {
    fn save(&self, to: &mut Saving) {
        let Self { list } = self;
        to.value(list);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.list = from.value()?;
        from.check(self.list.is_sorted_by_key(|forced| (forced.plc, forced.offset)), "list of forces")
    }
}

impl Forces {
    /// Maximum number of registers forced at a time.
    pub(super) const MOST: usize = 256;

    pub(super) fn list(&self) -> &[Forced] {
        &self.list
    }

    /// Returns the position of the register in the list if it is forced, otherwise the position at which it can be
    /// inserted.
    fn find(&self, plc: DeviceIndex, offset: u32) -> Result<usize, usize> {
        self.list.binary_search_by_key(&(plc, offset), |forced| (forced.plc, forced.offset))
    }

    /// Adds or changes a force; `false` if there are too many.
    pub(super) fn set(&mut self, forced: Forced) -> bool {
        match self.find(forced.plc, forced.offset) {
            Ok(at) => self.list[at] = forced,
            Err(_) if self.list.len() >= Self::MOST => return false,
            Err(at) => self.list.insert(at, forced),
        }
        true
    }

    /// Ends a force; `false` if there is none.
    pub(super) fn end(&mut self, plc: DeviceIndex, offset: u32) -> bool {
        self.find(plc, offset).map(|at| self.list.remove(at)).is_ok()
    }

    /// True if the bytes of a store contain a byte of a forced register that keeps another value (decision D-860).
    pub(super) fn refuse(&self, plc: DeviceIndex, offset: u32, width: Width, value: u32) -> bool {
        let byte = |value: u32, at: u32| value.to_le_bytes().get(at as usize).copied();
        let keeps_other = |forced: &Forced| {
            let begin = forced.offset.max(offset);
            let end = (forced.offset + forced.width.bytes()).min(offset + width.bytes());
            forced.plc == plc
                && (begin..end).any(|at| byte(forced.value, at - forced.offset) != byte(value, at - offset))
        };
        self.list.iter().any(keeps_other)
    }

    /// Writes all forced values into the RAM. Returns true if a register had another value.
    #[inline]
    pub(super) fn apply(&self, devices: &[Box<dyn Device>]) -> bool {
        !self.list.is_empty() && self.store(devices)
    }

    #[cold]
    fn store(&self, devices: &[Box<dyn Device>]) -> bool {
        self.list.iter().fold(false, |any, forced| {
            // Address and value were checked when the register was forced. PLCs and memory segments do not
            // change during a run.
            let before = devices.get(forced.plc.index()).and_then(|device| {
                device.segment().update(forced.offset, forced.width, |_| forced.value).ok()
            });
            any | before.is_some_and(|before| before != forced.value)
        })
    }
}
