//! Functions that a script has scheduled for a later time.

use super::data::Data;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

/// Most waiting functions of a device.
pub(super) const MOST_TIMERS: usize = 64;

/// A function of the script that is scheduled for a moment.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Timer {
    /// Emulated time of the call, in microseconds.
    due: u64,
    /// Number of the entry. Functions for the same time are called in the order of these numbers.
    number: u64,
    pub(super) function: String,
    /// Arguments of the call, as an array.
    pub(super) arguments: Data,
}

/// The scheduled functions of a script.
#[derive(Clone, Debug, Default)]
pub(super) struct Timers {
    waiting: Vec<Timer>,
    /// Number of functions that the script has scheduled.
    orders: u64,
}

impl Timers {
    /// Schedules a function for the time `due`. Returns the number of the entry.
    ///
    /// # Errors
    /// Too many functions are waiting.
    pub(super) fn add(&mut self, due: u64, function: String, arguments: Data) -> Result<u64, String> {
        if self.waiting.len() >= MOST_TIMERS {
            return Err(format!("{MOST_TIMERS} functions wait; a device has at most {MOST_TIMERS}"));
        }
        self.orders += 1;
        self.waiting.push(Timer { due, number: self.orders, function, arguments });
        Ok(self.orders)
    }

    /// Removes an entry. Returns false if no such function waits.
    pub(super) fn cancel(&mut self, number: u64) -> bool {
        let before = self.waiting.len();
        self.waiting.retain(|timer| timer.number != number);
        self.waiting.len() < before
    }

    /// Removes all scheduled functions.
    pub(super) fn clear(&mut self) {
        self.waiting.clear();
    }

    /// Returns the time of the next function.
    pub(super) fn next(&self) -> u64 {
        self.waiting.iter().map(|timer| timer.due).min().unwrap_or(u64::MAX)
    }

    /// Removes and returns the first function that is due at `now` or earlier.
    pub(super) fn take(&mut self, now: u64) -> Option<Timer> {
        let waiting = self.waiting.iter().enumerate().filter(|(_, timer)| timer.due <= now);
        let (index, _) = waiting.min_by_key(|(_, timer)| (timer.due, timer.number))?;
        Some(self.waiting.swap_remove(index))
    }
}

impl SnapshotFields for Timers {
    fn save(&self, to: &mut Saving) {
        let Self { waiting, orders } = self;
        to.value(&(orders, waiting.len()));
        for Timer { due, number, function, arguments } in waiting {
            to.value(&(due, number, function));
            arguments.save(to);
        }
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let (orders, count): (u64, usize) = from.value()?;
        from.check(count <= MOST_TIMERS, "number of timers")?;
        let mut waiting = Vec::new();
        for _ in 0..count {
            let (due, number, function) = from.value()?;
            let mut arguments = Data::empty_array();
            arguments.restore(from)?;
            waiting.push(Timer { due, number, function, arguments });
        }
        *self = Timers { waiting, orders };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_are_due_in_the_order_of_time_then_of_their_orders() {
        let mut timers = Timers::default();
        for (due, function) in [(5, "b"), (3, "a"), (5, "c"), (9, "d")] {
            timers.add(due, function.to_owned(), Data::empty_array()).unwrap();
        }
        assert!(timers.cancel(1) && !timers.cancel(1));
        assert_eq!(timers.next(), 3);
        let mut saving = Saving::default();
        timers.save(&mut saving);
        let mut back = Timers::default();
        back.restore(&mut Saved::new(saving.bytes())).unwrap();
        let called: Vec<_> = std::iter::from_fn(|| back.take(5)).map(|timer| timer.function).collect();
        assert_eq!((called, back.next()), (vec!["a".to_owned(), "c".to_owned()], 9));
    }

    #[test]
    fn too_many_functions_are_refused() {
        let mut timers = Timers::default();
        let mut add = || timers.add(0, String::new(), Data::empty_array());
        assert!((0..MOST_TIMERS).all(|_| add().is_ok()) && add().is_err());
    }
}
