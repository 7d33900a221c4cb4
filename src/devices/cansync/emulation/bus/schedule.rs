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

    /// Returns the slots with a due time, in ascending order.
    #[inline]
    fn open(&self) -> impl Iterator<Item = usize> {
        let mut open = self.open;
        core::iter::from_fn(move || {
            let index = (open != 0).then(|| open.trailing_zeros() as usize)?;
            open &= open - 1;
            Some(index)
        })
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

    /// Returns the due time of the next slot; [`Schedule::NEVER`] if there is none.
    #[inline]
    pub(super) fn next_time(&self) -> u64 {
        self.open().map(|index| self.due[index]).fold(Self::NEVER, u64::min)
    }

    /// Removes and returns the first slot with the due time `time`.
    #[inline]
    pub(super) fn take(&mut self, time: u64) -> Option<Slot> {
        let slot = ALL[self.open().find(|index| self.due[*index] == time)?];
        self.cancel(slot);
        Some(slot)
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
        assert_eq!(schedule.next_time(), Schedule::NEVER);
        schedule.set(Slot::CommandStart, 5);
        schedule.set(Slot::Sync, 5);
        schedule.set(Slot::Build1, 9);
        assert_eq!(schedule.next_time(), 5);
        assert_eq!(schedule.take(5), Some(Slot::Sync));
        assert_eq!(schedule.take(5), Some(Slot::CommandStart));
        assert_eq!(schedule.take(5), None);
        assert_eq!(schedule.next_time(), 9);
    }
}
