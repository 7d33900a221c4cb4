//! Supervision of events that must recur within a time: guarding, SYNC.

use serde::{Deserialize, Serialize};

/// Supervision of an event that must recur within a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Supervision {
    /// Longest time between two events in us. 0 means that the supervision is off.
    period_us: u64,
    /// True from `start` until `stop`. While it is true, a change of the period starts a new period at once.
    is_awaited: bool,
    /// Time by which the event must come, in microseconds; `None` if the supervision is off, or if the event
    /// is missing already.
    deadline: Option<u64>,
    is_missing: bool,
}

impl Supervision {
    /// Sets the period in microseconds; 0 switches the supervision off. If the event is awaited, a new period
    /// runs from `now`. Setting an unchanged period has no effect.
    pub(crate) fn set_period(&mut self, period_us: u64, now: u64) {
        if period_us == self.period_us {
            return;
        }
        self.period_us = period_us;
        if period_us == 0 {
            self.deadline = None;
            self.is_missing = false;
        } else if self.is_awaited && !self.is_missing {
            self.deadline = now.checked_add(period_us);
        }
    }

    /// Called when the event occurs, or when the supervision of the event begins at `now`.
    pub(crate) fn start(&mut self, now: u64) {
        self.is_awaited = true;
        self.is_missing = false;
        self.deadline = if self.period_us == 0 { None } else { now.checked_add(self.period_us) };
    }

    /// Ends the supervision: the event is no longer awaited, so it is not missing.
    pub(crate) fn stop(&mut self) {
        self.is_awaited = false;
        self.deadline = None;
        self.is_missing = false;
    }

    /// True if the event has not come within the period.
    #[must_use]
    pub(crate) fn is_missing(&self) -> bool {
        self.is_missing
    }

    /// Checks the deadline; returns true if the event has just become missing.
    pub(crate) fn look(&mut self, now: u64) -> bool {
        let is_over = self.deadline.is_some_and(|deadline| deadline <= now);
        if is_over {
            self.deadline = None;
            self.is_missing = true;
        }
        is_over
    }

    /// Returns the time of the next necessary check; `u64::MAX` if there is none.
    #[must_use]
    pub(crate) fn next_time(&self) -> u64 {
        self.deadline.unwrap_or(u64::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_that_does_not_come_is_missing_once_until_it_comes() {
        let mut it = Supervision::default();
        it.set_period(100, 10);
        assert_eq!(it.next_time(), u64::MAX, "not awaited");
        it.start(20);
        assert_eq!((it.look(119), it.next_time()), (false, 120));
        it.start(100);
        assert!(!it.look(199) && it.look(200) && !it.look(201));
        assert!(it.is_missing());
        assert_eq!(it.next_time(), u64::MAX);
        it.start(300);
        assert!(!it.is_missing());
        it.set_period(50, 310);
        assert_eq!(it.next_time(), 360);
        it.set_period(0, 320);
        assert_eq!(it.next_time(), u64::MAX);
    }

    #[test]
    fn a_period_set_while_awaited_counts_from_that_moment() {
        let mut it = Supervision::default();
        it.start(5);
        assert_eq!(it.next_time(), u64::MAX, "off");
        it.set_period(100, 10);
        assert_eq!(it.next_time(), 110);
        it.stop();
        it.set_period(0, 20);
        it.set_period(100, 30);
        assert_eq!(it.next_time(), u64::MAX, "not awaited");
    }

    #[test]
    fn setting_the_same_period_again_does_not_prolong_it() {
        let mut it = Supervision::default();
        it.set_period(100, 0);
        it.start(0);
        it.set_period(100, 90);
        assert_eq!(it.next_time(), 100);
        assert!(it.look(100));
        it.set_period(100, 150);
        assert!(it.is_missing());
    }
}
