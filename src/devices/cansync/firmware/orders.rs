//! `w_CPU_CONTROL` as the firmware reads it: a level, from which bit 7 is cleared (manual 5.00005.03a p. 149-150, 174).

use super::Seat;
use crate::devices::cansync::registers::values::cpu_control;
use crate::memory::{Cell16, Face, MemoryError, Segment, Width};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

/// What the PLC has ordered, as far as the register tells.
pub(super) struct Orders {
    face: Face,
    /// Index in what the header page has for both nodes.
    node: usize,
    /// Last value seen, so that an ignored command is reported once.
    seen: u16,
    /// In the register stands the 16#0000 that clearing 16#0080 left. It is no restart (decision D-29).
    left_behind: bool,
    /// [`PortEntry::restarts_written`](crate::memory::header::PortEntry::restarts_written) when the register was last looked at.
    restarts: u32,
}

/// What a look at the register shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Order {
    /// What stands in the register, without bit 7.
    pub value: u16,
    /// It was written since the last look, as far as that can be seen.
    pub is_new: bool,
    /// Bit 7 was set, and is cleared now.
    pub with_reset: bool,
}

impl SnapshotFields for Orders {
    fn save(&self, to: &mut Saving) {
        let Self { face: _, node: _, seen, left_behind, restarts } = self;
        // The header page goes on counting whatever is restored, so what is kept is how many have not been seen.
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
    /// The orders to the node with this role in `segment`; none yet.
    ///
    /// # Errors
    /// If the segment is read-only.
    pub(crate) fn new(segment: &Segment, node: usize) -> Result<Self, MemoryError> {
        let mut orders = Orders {
            face: segment.face()?,
            node,
            seen: cpu_control::RESTART,
            left_behind: false,
            restarts: 0,
        };
        orders.restarts = orders.restarts_written();
        Ok(orders)
    }

    /// Whether something was ordered since the last look.
    #[inline]
    pub(crate) fn is_waiting(&self, register: &Cell16) -> bool {
        register.load() != self.seen || self.left_behind && self.restarts_written() != self.restarts
    }

    /// Whether what stands in the register is no order, because the firmware has written it.
    #[inline]
    pub(crate) fn are_left_behind(&self) -> bool {
        self.left_behind
    }

    /// Looks at the register and clears bit 7.
    pub(crate) fn take(&mut self, register: &Cell16) -> Order {
        let (value, restarts, with_reset) = loop {
            let value = register.load();
            // In between: restarts written before this value are past, later ones make the exchange fail.
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
        self.face.asked().ports[self.node].restarts_written.load()
    }
}

/// `bytes` bytes at `offset` were written by somebody who named the place. If that is the `w_CPU_CONTROL` of one of the
/// nodes at `seats`, 16#0000 in it is a restart, even if it stood there before (decision D-29).
pub(crate) fn note_restarts(
    segment: &Segment,
    face: &Face,
    seats: impl IntoIterator<Item = Seat>,
    offset: u32,
    bytes: u32,
) {
    for seat in seats {
        let register = seat.base as u32;
        let is_hit = offset < register + 2 && register < offset + bytes;
        let holds_restart = || {
            segment.load(register, Width::Word).is_ok_and(|value| value == u32::from(cpu_control::RESTART))
        };
        if is_hit && holds_restart() {
            face.both(|page| {
                page.ports[seat.place].restarts_written.increment();
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
    fn the_left_behind_0_lasts_until_another_value_or_a_restart() {
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
