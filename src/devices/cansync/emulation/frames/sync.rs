//! Synchronization of a slave to the SYNC signal (manual 5.00005.03a p. 134-135).
//!
//! One rule applies to drives with a CANsync card, to slave nodes of PLCs, and to a drive at a BAPS, which
//! uses the signal of the trigger controller. A slave becomes locked after an uninterrupted sequence of edges
//! (decision D-07). A locked slave continues by its own clock through intervals without an edge, until the
//! signal has been missing for a configurable time.

use crate::snapshot_fields;

/// Returns true if an edge comes in time `distance_us` after the previous edge. The tolerance is a quarter of
/// the interval.
#[inline]
pub(crate) const fn is_in_time(distance_us: u64, interval_us: u32) -> bool {
    distance_us.abs_diff(interval_us as u64) <= (interval_us / 4) as u64
}

/// A slave's lock to its SYNC signal.
#[derive(Clone, Copy, Debug)]
pub struct SyncLock {
    lock_time_us: u64,
    /// Configured time without SYNC that ends the lock.
    loss_us: Option<u64>,
    wanted: bool,
    locked: bool,
    /// Time of the first edge of the present uninterrupted sequence. Valid only while the slave is not
    /// locked.
    since: Option<u64>,
    /// The last accepted edge.
    last: u64,
    interval_us: u64,
}

snapshot_fields!(SyncLock { values: wanted, locked, since, last, interval_us; built: lock_time_us, loss_us });

impl SyncLock {
    /// Creates a lock. The slave becomes locked after `lock_time_us` of uninterrupted SYNC signal. The lock
    /// ends after `loss_us` without SYNC (`None`: two and a half intervals). A value below two and a quarter
    /// intervals counts as two and a quarter, because one lost edge must not end the lock (p. 135).
    #[must_use]
    pub const fn new(lock_time_us: u64, loss_us: Option<u64>) -> Self {
        SyncLock { lock_time_us, loss_us, wanted: false, locked: false, since: None, last: 0, interval_us: 0 }
    }

    /// Switches the SYNC mode on or off. A repeated "on" has no effect (decision D-83).
    pub fn set_mode(&mut self, on: bool) {
        self.wanted = on;
        if !on {
            self.unlock();
        }
    }

    /// Handles a falling edge at `now_us`. The signal is expected every `interval_us`, with a tolerance of
    /// `tolerance_us`.
    ///
    /// While the slave is not locked, an edge that is too early or too late restarts the sequence. Such an
    /// edge does not end an existing lock, but it also does not count for the lock: the time without SYNC
    /// continues (decision D-125).
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

    /// Handles an edge like [`SyncLock::edge`] if the slave is locked and the edge is in time
    /// ([`is_in_time`]). Otherwise returns false and has no effect.
    #[inline]
    pub(crate) fn take_regular_edge(&mut self, now_us: u64, interval_us: u32) -> bool {
        let in_time = is_in_time(now_us.saturating_sub(self.last), interval_us);
        let is_regular = self.locked && u64::from(interval_us) == self.interval_us && in_time;
        if is_regular {
            self.last = now_us;
        }
        is_regular
    }

    /// Handles several further regular edges. Each edge is in time after the previous edge, and the last edge
    /// is at `now_us`.
    #[inline]
    pub(crate) fn has_gone_on(&mut self, now_us: u64) {
        self.last = now_us;
    }

    /// Advances the clock to `now_us`. If the signal has been missing for too long, the lock ends.
    pub fn pass(&mut self, now_us: u64) {
        if self.lost_at().is_some_and(|time| time <= now_us) {
            self.unlock();
        }
    }

    /// Returns the time at which the lock will end if no edge comes; `None` without a lock.
    #[must_use]
    pub fn lost_at(&self) -> Option<u64> {
        let least = self.interval_us * 9 / 4;
        let loss = self.loss_us.map_or(self.interval_us * 5 / 2, |us| us.max(least));
        self.locked.then(|| self.last.saturating_add(loss))
    }

    /// Returns true if the slave runs through an interval that begins at `now_us` without its edge. This is
    /// the case if the slave is locked, and this is the first missing edge.
    #[must_use]
    pub fn runs_through(&self, now_us: u64) -> bool {
        self.locked && now_us.saturating_sub(self.last) < self.interval_us * 7 / 4
    }

    /// Ends the lock. The next edge begins a new sequence for locking.
    pub fn unlock(&mut self) {
        self.locked = false;
        self.since = None;
    }

    /// Returns the time of the last accepted edge.
    #[must_use]
    pub const fn last_edge(&self) -> u64 {
        self.last
    }

    /// Returns true if the slave is synchronized.
    #[inline]
    #[must_use]
    pub const fn is_locked(&self) -> bool {
        self.locked
    }
}

/// Returns true if an edge `distance` after the last accepted edge is at an expected time, although edges
/// between them were lost.
fn is_in_step(distance: u64, interval: u64, tolerance: u64) -> bool {
    let Some(remainder) = distance.checked_rem(interval) else { return false };
    distance + tolerance >= interval && remainder.min(interval - remainder) <= tolerance
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: u32 = 2000;

    fn edge(lock: &mut SyncLock, now: u64) -> bool {
        lock.edge(now, INTERVAL, INTERVAL / 4);
        lock.is_locked()
    }

    /// Sends edges every 2 ms from `from` to `to`, and returns the time at which the lock is reached.
    fn run(lock: &mut SyncLock, from: u64, to: u64) -> Option<u64> {
        (from..=to).step_by(INTERVAL as usize).find(|&now| edge(lock, now))
    }

    /// Returns a lock with a lock time of 10 ms. It is locked, and its last edge was at 10 ms.
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
    fn the_configured_time_without_sync_ends_the_lock() {
        for (loss_us, end) in
            [(None, 15_000), (Some(1), 14_500), (Some(4_600), 14_600), (Some(9_000), 19_000)]
        {
            let mut lock = locked(loss_us);
            assert_eq!(lock.lost_at(), Some(end));
            lock.pass(end - 1);
            assert!(lock.is_locked(), "{loss_us:?}");
            lock.pass(end);
            assert!(!lock.is_locked() && lock.lost_at().is_none(), "{loss_us:?}");
            assert_eq!(run(&mut lock, 20_000, 60_000), Some(30_000), "locking starts again");
        }
    }

    #[test]
    fn an_edge_after_the_loss_time_is_too_late_even_without_a_poll() {
        let mut lock = locked(None);
        assert!(!edge(&mut lock, 16_000));
        assert_eq!(run(&mut lock, 18_000, 60_000), Some(26_000));
    }

    #[test]
    fn edges_at_the_wrong_time_are_not_accepted() {
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
    fn locking_requires_an_uninterrupted_sequence() {
        for (second, reached) in [(1_499, 11_499), (1_500, 11_500), (2_500, 10_500), (2_501, 12_501)] {
            let mut lock = SyncLock::new(10_000, None);
            lock.set_mode(true);
            edge(&mut lock, 0);
            assert_eq!(run(&mut lock, second, 60_000), Some(reached), "{second}");
        }
    }

    #[test]
    fn a_slave_runs_through_the_first_interval_without_an_edge() {
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
    fn an_interval_of_zero_causes_no_division_by_zero() {
        let mut lock = SyncLock::new(0, None);
        lock.set_mode(true);
        lock.edge(5, 0, 0);
        lock.edge(5, 0, 0);
        lock.edge(9, 0, 0);
        assert!(lock.lost_at().is_none_or(|time| time == 9));
    }
}
