//! Detects missed deadlines of frames. A program misses a deadline if it released the frame in time in the
//! previous interval, but not in the present one. A program that releases no values misses no deadline.

use serde::{Deserialize, Serialize};

/// Deadline history of one frame.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct DeadlineTracker {
    usage: Usage,
    missed_at: Option<u64>,
}

/// How the program has used the frame since active operation began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Usage {
    /// The program has never released the frame.
    #[default]
    Unused,
    /// The frame of the last interval was released in time.
    Served,
    /// The program has released an earlier frame in time, but not the frame of the last interval.
    Omitted,
}

impl DeadlineTracker {
    /// Starts a new interval.
    #[inline]
    pub(super) fn next_interval(&mut self) {
        self.missed_at = None;
    }

    /// Handles a deadline. `released` is true if the program has released the frame in time.
    #[inline]
    pub(super) fn deadline(&mut self, now: u64, released: bool) {
        self.missed_at = (self.usage == Usage::Served && !released).then_some(now);
        self.usage = match (released, self.usage) {
            (true, _) => Usage::Served,
            (false, Usage::Unused) => Usage::Unused,
            (false, Usage::Served | Usage::Omitted) => Usage::Omitted,
        };
    }

    /// True if the program has released the frame in time at least once.
    #[inline]
    pub(super) fn is_used(&self) -> bool {
        self.usage != Usage::Unused
    }

    /// Returns the deadline missed in this interval.
    #[inline]
    pub(super) fn missed_at(&self) -> Option<u64> {
        self.missed_at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_frame_that_was_in_time_before_can_be_late() {
        let mut frame = DeadlineTracker::default();
        let mut interval = |now, released| {
            frame.next_interval();
            assert_eq!(frame.missed_at(), None);
            frame.deadline(now, released);
            frame.missed_at()
        };
        assert_eq!(interval(1, false), None);
        assert_eq!(interval(2, true), None);
        assert_eq!(interval(3, false), Some(3));
        assert_eq!(interval(4, false), None, "it no longer sends");
        assert_eq!(interval(5, true), None);
    }

    #[test]
    fn a_frame_is_used_from_its_first_release_on() {
        let mut frame = DeadlineTracker::default();
        for (released, used) in [(false, false), (true, true), (false, true), (false, true)] {
            frame.deadline(1, released);
            assert_eq!(frame.is_used(), used);
        }
    }
}
