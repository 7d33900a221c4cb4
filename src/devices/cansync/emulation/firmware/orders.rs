//! Reads `w_CPU_CONTROL`. The value of this register is a permanent command, not a handshake. The firmware
//! clears only bit 7 (manual 5.00005.03a p. 149-150, 174).

use super::NodeLocation;
use crate::devices::cansync::registers::values::cpu_control;
use crate::memory::{Cell16, FirmwareHeader, MemoryError, Segment, Width};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

/// Reader of the PLC's orders in `w_CPU_CONTROL`.
pub(super) struct Orders {
    face: FirmwareHeader,
    /// Index of the node in the header page.
    node: usize,
    /// Value at the last poll. A comparison with it ensures that an ignored command is reported only once.
    seen: u16,
    /// True if the register contains 16#0000 because the firmware has cleared bit 7 of 16#0080. This 16#0000 is not a
    /// restart (decision D-29).
    left_behind: bool,
    /// [`PortEntry::restarts_written`](crate::memory::header::PortEntry::restarts_written) at the last poll of the
    /// register.
    restarts: u32,
}

/// Result of a poll of the register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Order {
    /// Value of the register, without bit 7.
    pub value: u16,
    /// True if the value shows that the register was written since the last poll.
    pub is_new: bool,
    /// True if bit 7 was set. The firmware has now cleared it.
    pub with_reset: bool,
}

impl SnapshotFields for Orders {
    fn save(&self, to: &mut Saving) {
        let Self { face: _, node: _, seen, left_behind, restarts } = self;
        // The counter in the header page is not restored. So the snapshot contains the number of restarts
        // that the firmware has not seen yet.
        to.value(&(seen, left_behind, self.restarts_written().wrapping_sub(*restarts)));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let unseen: u32;
        (self.seen, self.left_behind, unseen) = from.value()?;
        self.restarts = self.restarts_written().wrapping_sub(unseen);
        Ok(())
    }
}

impl Orders {
    /// Creates the reader for node `node` in `segment`, without an order.
    ///
    /// # Errors
    /// The memory segment is read-only.
    pub(crate) fn new(segment: &Segment, node: usize) -> Result<Self, MemoryError> {
        let mut orders = Orders {
            face: segment.firmware_header()?,
            node,
            seen: cpu_control::RESTART,
            left_behind: false,
            restarts: 0,
        };
        orders.restarts = orders.restarts_written();
        Ok(orders)
    }

    /// Returns true if the register was written since the last poll.
    #[inline]
    pub(crate) fn is_waiting(&self, register: &Cell16) -> bool {
        register.load() != self.seen || self.left_behind && self.restarts_written() != self.restarts
    }

    /// Returns true if the value in the register is not an order, because the firmware has written it.
    #[inline]
    pub(crate) fn are_left_behind(&self) -> bool {
        self.left_behind
    }

    /// Polls the register and clears bit 7.
    pub(crate) fn take(&mut self, register: &Cell16) -> Order {
        let (value, restarts, with_reset) = loop {
            let value = register.load();
            // The counter is read after the load and before the exchange. So it includes all restarts that
            // were written before this value. If the register is written later, the exchange fails.
            let restarts = self.restarts_written();
            let rest = value & !cpu_control::RESET_CONTROLLER;
            if rest == value {
                break (value, restarts, false);
            }
            if register.compare_exchange(value, rest).is_ok() {
                break (rest, restarts, true);
            }
        };
        let is_restarted = core::mem::replace(&mut self.restarts, restarts) != restarts;
        let is_new = core::mem::replace(&mut self.seen, value) != value || with_reset;
        self.left_behind = value == cpu_control::RESTART && (with_reset || self.left_behind && !is_restarted);
        Order { value, is_new, with_reset }
    }

    fn restarts_written(&self) -> u32 {
        self.face.requested().ports[self.node].restarts_written.load()
    }
}

/// Notes that `bytes` bytes at `offset` were written by address. If these bytes include the `w_CPU_CONTROL`
/// of one of the nodes at `locations`, the value 16#0000 is a restart, even if the register contained 16#0000
/// before (decision D-29).
pub(crate) fn note_restarts(
    segment: &Segment,
    face: &FirmwareHeader,
    locations: impl IntoIterator<Item = NodeLocation>,
    offset: u32,
    bytes: u32,
) {
    for location in locations {
        let register = location.base;
        let is_hit = offset < register + 2 && register < offset + bytes;
        let holds_restart = || {
            segment.load(register, Width::Word).is_ok_and(|value| value == u32::from(cpu_control::RESTART))
        };
        if is_hit && holds_restart() {
            face.both(|page| {
                page.ports[location.place].restarts_written.increment();
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::omega_drive_line_2::registers::SEGMENT_END;
    use crate::devices::omega_drive_line_2::registers::{CANsync_INIT_BMSTRUCT, NODE2};

    #[test]
    fn a_leftover_0_lasts_until_another_value_or_a_restart() {
        let segment = Segment::heap(SEGMENT_END);
        let regs = segment.view::<CANsync_INIT_BMSTRUCT>(NODE2).unwrap();
        let header = segment.header().unwrap();
        let register = &regs.w_CPU_CONTROL;
        let mut orders = Orders::new(&segment, 1).unwrap();
        let order = |value, is_new, with_reset| Order { value, is_new, with_reset };
        for change in [0x0020, 0x0000] {
            register.store(0x0080);
            assert!(orders.is_waiting(register));
            assert_eq!(orders.take(register), order(0, true, true));
            assert_eq!(orders.take(register), order(0, false, false));
            assert!(orders.are_left_behind() && !orders.is_waiting(register));
            register.store(change);
            header.ports[0].restarts_written.increment();
            assert_eq!(orders.is_waiting(register), change != 0, "that was the other node");
            header.ports[1].restarts_written.add(u32::from(change == 0));
            assert!(orders.is_waiting(register));
            assert_eq!(orders.take(register), order(change, change != 0, false));
            assert!(!orders.are_left_behind());
        }
        register.store(0x00C0);
        assert_eq!(orders.take(register), order(0x0040, true, true));
        assert!(!orders.are_left_behind());
    }
}
