//! Missed deadlines of frames that were sent in the previous interval: the program releases its values every interval
//! and was late this time. A program that releases no values misses no deadline.

use serde::{Deserialize, Serialize};

/// Deadline history of one frame.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct DeadlineTracker {
    /// The frame of the last interval was released in time.
    served: bool,
    missed_at: Option<u64>,
}

impl DeadlineTracker {
    /// Starts a new interval.
    #[inline]
    pub(super) fn next_interval(&mut self) {
        self.missed_at = None;
    }

    /// Handles a deadline; `released` is true if the frame was released in time.
    #[inline]
    pub(super) fn deadline(&mut self, now: u64, released: bool) {
        self.missed_at = (self.served && !released).then_some(now);
        self.served = released;
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
}
