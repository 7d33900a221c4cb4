//! Whether a slave runs in step with the SYNC signal (manual 5.00005.03a p. 134-135).
//!
//! One rule for all of them: drives with CANsync card, slave nodes of PLCs, and the drive behind a BAPS, whose signal is
//! that of the trigger controller. It takes an unbroken sequence of edges to lock (decision D-07). Once locked, a slave
//! runs on by its own clock through intervals whose edge is missing, until the signal has been gone for a settable time.

use crate::snapshot_fields;

/// Whether an edge comes in time, so long after the one before it: give or take a quarter of the interval.
#[inline]
pub(crate) const fn is_in_time(distance_us: u64, interval_us: u32) -> bool {
    distance_us.abs_diff(interval_us as u64) <= (interval_us / 4) as u64
}

/// A slave's lock to its SYNC signal.
#[derive(Clone, Copy, Debug)]
pub struct SyncLock {
    lock_time_us: u64,
    /// Time without SYNC that ends the lock, as set.
    loss_us: Option<u64>,
    wanted: bool,
    locked: bool,
    /// While not locked: the first edge of the present unbroken sequence.
    since: Option<u64>,
    /// The last edge that counted.
    last: u64,
    interval_us: u64,
}

snapshot_fields!(SyncLock { values: wanted, locked, since, last, interval_us; built: lock_time_us, loss_us });

impl SyncLock {
    /// A lock that is reached after `lock_time_us` of SYNC signal without a gap and lost after `loss_us` without SYNC;
    /// `None`: two and a half intervals. Less than two and a quarter count as two and a quarter, because one lost edge
    /// must not end the lock (p. 135).
    #[must_use]
    pub const fn new(lock_time_us: u64, loss_us: Option<u64>) -> Self {
        SyncLock { lock_time_us, loss_us, wanted: false, locked: false, since: None, last: 0, interval_us: 0 }
    }

    /// "SYNC mode": on or off. "On" while it is on changes nothing (decision D-83).
    pub fn set_mode(&mut self, on: bool) {
        self.wanted = on;
        if !on {
            self.unlock();
        }
    }

    /// A falling edge at `now_us`, in a signal that is to come every `interval_us`, give or take `tolerance_us`.
    ///
    /// While locking, an edge that is too early or too late begins anew. A lock that is reached stays: an edge off its
    /// time does not count for it, so that the time without SYNC goes on (decision D-125).
    #[inline]
    pub fn edge(&mut self, now_us: u64, interval_us: u32, tolerance_us: u32) {
        let (interval, tolerance) = (u64::from(interval_us), u64::from(tolerance_us));
        if interval != self.interval_us {
            self.unlock();
            self.interval_us = interval;
        }
        let distance = now_us.saturating_sub(self.last);
        let in_time = distance.abs_diff(interval) <= tolerance;
        if self.locked && in_time {
            self.last = now_us;
            return;
        }
        if self.locked {
            self.pass(now_us);
            if self.locked && !is_in_step(distance, interval, tolerance) {
                return;
            }
        }
        self.last = now_us;
        if self.locked || !self.wanted {
            return;
        }
        if !in_time {
            self.since = None;
        }
        let since = *self.since.get_or_insert(now_us);
        self.locked = now_us.saturating_sub(since) >= self.lock_time_us;
    }

    /// The same for an edge that comes in time ([`is_in_time`]) while the lock stands. `false`: it is not of this kind, and
    /// nothing has happened.
    #[inline]
    pub(crate) fn goes_on(&mut self, now_us: u64, interval_us: u32) -> bool {
        let in_time = is_in_time(now_us.saturating_sub(self.last), interval_us);
        let goes_on = self.locked && u64::from(interval_us) == self.interval_us && in_time;
        if goes_on {
            self.last = now_us;
        }
        goes_on
    }

    /// More edges of this kind have come, each in time behind the one before it; the last one at `now_us`.
    #[inline]
    pub(crate) fn has_gone_on(&mut self, now_us: u64) {
        self.last = now_us;
    }

    /// Time has passed: the signal may have been gone for too long.
    pub fn pass(&mut self, now_us: u64) {
        if self.lost_at().is_some_and(|time| time <= now_us) {
            self.unlock();
        }
    }

    /// When the lock will be lost if no edge comes; `None` without lock.
    #[must_use]
    pub fn lost_at(&self) -> Option<u64> {
        let least = self.interval_us * 9 / 4;
        let loss = self.loss_us.map_or(self.interval_us * 5 / 2, |us| us.max(least));
        self.locked.then(|| self.last.saturating_add(loss))
    }

    /// Whether an interval that begins at `now_us` without its edge is run through all the same: the slave is locked,
    /// and it is the first that is missing.
    #[must_use]
    pub fn runs_through(&self, now_us: u64) -> bool {
        self.locked && now_us.saturating_sub(self.last) < self.interval_us * 7 / 4
    }

    /// Ends the lock; locking begins anew with the next edge.
    pub fn unlock(&mut self) {
        self.locked = false;
        self.since = None;
    }

    /// The last edge that counted.
    #[must_use]
    pub const fn last_edge(&self) -> u64 {
        self.last
    }

    /// Whether the slave is synchronized.
    #[inline]
    #[must_use]
    pub const fn is_locked(&self) -> bool {
        self.locked
    }
}

/// Whether an edge `distance` after the last one that counted lies where one was to come, edges in between being lost.
fn is_in_step(distance: u64, interval: u64, tolerance: u64) -> bool {
    let Some(behind) = distance.checked_rem(interval) else { return false };
    distance + tolerance >= interval && behind.min(interval - behind) <= tolerance
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: u32 = 2000;

    fn edge(lock: &mut SyncLock, now: u64) -> bool {
        lock.edge(now, INTERVAL, INTERVAL / 4);
        lock.is_locked()
    }

    /// Edges every 2 ms from `from` to `to`; the time at which the lock is reached.
    fn run(lock: &mut SyncLock, from: u64, to: u64) -> Option<u64> {
        (from..=to).step_by(INTERVAL as usize).find(|&now| edge(lock, now))
    }

    /// Needs 10 ms; locked with its last edge at 10 ms.
    fn locked(loss_us: Option<u64>) -> SyncLock {
        let mut lock = SyncLock::new(10_000, loss_us);
        lock.set_mode(true);
        assert_eq!(run(&mut lock, 0, 10_000), Some(10_000));
        lock
    }

    #[test]
    fn counts_from_the_first_edge_with_sync_mode_on() {
        let mut lock = SyncLock::new(10_000, None);
        assert_eq!(run(&mut lock, 0, 100_000), None);
        lock.set_mode(true);
        assert_eq!(run(&mut lock, 102_000, 106_000), None);
        lock.set_mode(true);
        assert_eq!(run(&mut lock, 108_000, 200_000), Some(112_000), "a repeated command changes nothing");
        lock.set_mode(true);
        assert!(lock.is_locked());
        lock.set_mode(false);
        assert!(!lock.is_locked());
    }

    #[test]
    fn one_lost_edge_does_not_end_the_lock() {
        let mut lock = locked(None);
        assert!(edge(&mut lock, 14_000));
        assert!(edge(&mut lock, 18_000), "nor does every second one");
    }

    #[test]
    fn the_time_without_sync_ends_it() {
        for (loss_us, end) in
            [(None, 15_000), (Some(1), 14_500), (Some(4_600), 14_600), (Some(9_000), 19_000)]
        {
            let mut lock = locked(loss_us);
            assert_eq!(lock.lost_at(), Some(end));
            lock.pass(end - 1);
            assert!(lock.is_locked(), "{loss_us:?}");
            lock.pass(end);
            assert!(!lock.is_locked() && lock.lost_at().is_none(), "{loss_us:?}");
            assert_eq!(run(&mut lock, 20_000, 60_000), Some(30_000), "locking begins anew");
        }
    }

    #[test]
    fn an_edge_after_that_time_comes_too_late_also_if_nobody_looked_before() {
        let mut lock = locked(None);
        assert!(!edge(&mut lock, 16_000));
        assert_eq!(run(&mut lock, 18_000, 60_000), Some(26_000));
    }

    #[test]
    fn edges_off_their_time_do_not_count() {
        let mut lock = locked(None);
        for (now, counts) in [(11_499, false), (12_501, false), (13_499, false), (13_500, true)] {
            assert!(edge(&mut lock, now));
            assert_eq!(lock.lost_at() == Some(now + 5_000), counts, "{now}");
        }
        let mut lock = locked(None);
        let off = [11_000, 13_000, 15_000].map(|now| edge(&mut lock, now));
        assert_eq!(off, [true, true, false], "half an interval off for two and a half intervals");
    }

    #[test]
    fn locking_takes_an_unbroken_sequence() {
        for (second, reached) in [(1_499, 11_499), (1_500, 11_500), (2_500, 10_500), (2_501, 12_501)] {
            let mut lock = SyncLock::new(10_000, None);
            lock.set_mode(true);
            edge(&mut lock, 0);
            assert_eq!(run(&mut lock, second, 60_000), Some(reached), "{second}");
        }
    }

    #[test]
    fn the_first_interval_without_edge_is_run_through() {
        let mut lock = locked(None);
        assert_eq!(
            [12_000, 13_499, 13_500, 14_000].map(|now| lock.runs_through(now)),
            [true, true, false, false]
        );
        lock.unlock();
        assert!(!lock.runs_through(12_000));
    }

    #[test]
    fn another_interval_ends_the_lock() {
        let mut lock = locked(None);
        lock.edge(14_000, 4000, 1000);
        assert!(!lock.is_locked());
    }

    #[test]
    fn a_narrow_tolerance() {
        let mut lock = SyncLock::new(4000, None);
        lock.set_mode(true);
        let times = [100, 2100, 4100, 6120, 8141, 10_120, 12_139];
        let states = times.map(|now| {
            lock.edge(now, INTERVAL, 20);
            (lock.is_locked(), lock.last == now)
        });
        let expected = [(false, true), (false, true), (true, true), (true, true)];
        assert_eq!(states[..4], expected);
        assert_eq!(states[4..], [(true, false), (true, true), (true, true)], "8141 is 21 us off");
    }

    #[test]
    fn an_interval_of_nothing_is_no_division_by_zero() {
        let mut lock = SyncLock::new(0, None);
        lock.set_mode(true);
        lock.edge(5, 0, 0);
        lock.edge(5, 0, 0);
        lock.edge(9, 0, 0);
        assert!(lock.lost_at().is_none_or(|time| time == 9));
    }
}
