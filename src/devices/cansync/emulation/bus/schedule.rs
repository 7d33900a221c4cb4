//! Schedule of a bus: the times of its next events.

use serde::{Deserialize, Serialize};

/// Points of time in an interval. Points at the same time are handled in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Slot {
    /// End of the command frame. It may be later than the next SYNC edge.
    CommandEnd,
    /// The time t_RSPTO after the end of the command frame has passed.
    ResponseTimeout,
    /// Falling edge of SYNC.
    Sync,
    /// t_RC: the response frame starts.
    ResponseStart,
    /// End of the response frame.
    ResponseEnd,
    /// Deadline of reference value frame 1 and of the slaves' actual value frame 1.
    Build1,
    /// Reference value frame 1 is built. This moment is also the deadline of reference value frame 2.
    Built1,
    /// Reference value frame 2 is built.
    Built2,
    /// End of the frame WRC1 on the bus.
    Reference1End,
    /// Deadline of the slaves' actual value frame 2.
    BuildActual2,
    /// End of the frame RDC1 on the bus.
    Actual1End,
    /// End of the frame WRC2 on the bus.
    Reference2End,
    /// End of the frame RDC2 on the bus.
    Actual2End,
    /// t_CC: the command frame is chosen and starts.
    CommandStart,
    /// End of a frame that a fault has delayed or repeated.
    Stray,
    /// Drives without a SYNC edge continue by their own clock.
    OwnClock,
}

const ALL: [Slot; 16] = [
    Slot::CommandEnd,
    Slot::ResponseTimeout,
    Slot::Sync,
    Slot::ResponseStart,
    Slot::ResponseEnd,
    Slot::Build1,
    Slot::Built1,
    Slot::Built2,
    Slot::Reference1End,
    Slot::BuildActual2,
    Slot::Actual1End,
    Slot::Reference2End,
    Slot::Actual2End,
    Slot::CommandStart,
    Slot::Stray,
    Slot::OwnClock,
];

/// The next slot of a schedule.
#[derive(Clone, Copy)]
pub(super) struct Next {
    /// Due time of the slot, in microseconds.
    pub(super) time: u64,
    /// Index of the slot.
    index: u8,
}

/// Due times of all slots of one bus. Each slot has at most one due time.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Schedule {
    due: [u64; ALL.len()],
    /// Slots with a due time, bit n for slot n. Usually few bits are set.
    open: u16,
}

impl Schedule {
    /// Due time that means that the slot has no due time.
    pub(super) const NEVER: u64 = u64::MAX;

    pub(super) fn empty() -> Self {
        Schedule { due: [Self::NEVER; ALL.len()], open: 0 }
    }

    #[inline]
    pub(super) fn set(&mut self, slot: Slot, at: u64) {
        let (index, bit) = (slot as usize, 1 << slot as u8);
        self.due[index] = at;
        self.open = if at == Self::NEVER { self.open & !bit } else { self.open | bit };
    }

    #[inline]
    pub(super) fn at(&self, slot: Slot) -> Option<u64> {
        Some(self.due[slot as usize]).filter(|at| *at != Self::NEVER)
    }

    #[inline]
    pub(super) fn cancel(&mut self, slot: Slot) {
        self.set(slot, Self::NEVER);
    }

    pub(super) fn clear(&mut self) {
        *self = Self::empty();
    }

    /// Returns the next slot and its due time: the earliest one, of equal ones the first. [`Schedule::NEVER`] means that there
    /// is none.
    #[inline]
    pub(super) fn next(&self) -> Next {
        let mut next = Next { time: Self::NEVER, index: 0 };
        let mut open = self.open;
        while open != 0 {
            let index = open.trailing_zeros() as usize;
            if self.due[index] < next.time {
                next = Next { time: self.due[index], index: index as u8 };
            }
            open &= open - 1;
        }
        next
    }

    /// Removes and returns the slot that [`Schedule::next`] has returned, if it is still due at `time`.
    #[inline]
    pub(super) fn take(&mut self, next: Next, time: u64) -> Option<Slot> {
        let index = usize::from(next.index);
        if self.due[index] != time {
            return None;
        }
        self.cancel(ALL[index]);
        Some(ALL[index])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_slot_is_at_its_own_index() {
        for (index, slot) in ALL.into_iter().enumerate() {
            assert_eq!(slot as usize, index);
        }
    }

    #[test]
    fn simultaneous_slots_are_taken_in_the_order_of_the_enum() {
        let mut schedule = Schedule::empty();
        assert_eq!(schedule.next().time, Schedule::NEVER);
        assert_eq!(schedule.take(schedule.next(), 5), None);
        schedule.set(Slot::CommandStart, 5);
        schedule.set(Slot::Sync, 5);
        schedule.set(Slot::Build1, 9);
        let mut take = |time| (schedule.next().time, schedule.take(schedule.next(), time));
        assert_eq!(take(5), (5, Some(Slot::Sync)));
        assert_eq!(take(5), (5, Some(Slot::CommandStart)));
        assert_eq!(take(5), (9, None));
        assert_eq!(take(9), (9, Some(Slot::Build1)));
    }
}
