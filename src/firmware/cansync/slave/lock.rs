//! Locking to the SYNC signal (manual 5.00005.03a p. 134-135; time and gaps: decision D-07).

/// Watches the SYNC edges of a slave node.
pub(super) struct Lock {
    /// Emulated time that locking takes.
    time_us: u64,
    /// The master has sent "SYNC mode: on".
    wanted: bool,
    /// Start of the unbroken sequence of edges.
    since: Option<u64>,
    last_edge: u64,
    /// Longest time from edge to edge that does not count as a gap: one and a half intervals.
    patience_us: u64,
}

impl Lock {
    /// A lock that needs `time_us` of SYNC signal without a gap.
    pub(super) fn new(time_us: u64) -> Self {
        Lock { time_us, wanted: false, since: None, last_edge: 0, patience_us: 0 }
    }

    /// "SYNC mode": on or off. "On" while it is on changes nothing.
    pub(super) fn set_mode(&mut self, on: bool) {
        self.wanted = on;
        if !on {
            self.since = None;
        }
    }

    /// A falling edge at `now`; `interval_us` is the bus's interval.
    pub(super) fn edge(&mut self, now: u64, interval_us: u32) {
        self.patience_us = u64::from(interval_us) * 3 / 2;
        // Too early is as bad as too late (decision D-125).
        let early = now.saturating_sub(self.last_edge) < u64::from(interval_us) * 3 / 4;
        if early || !self.has_signal(now) {
            self.since = None;
        }
        if self.wanted {
            self.since.get_or_insert(now);
        }
        self.last_edge = now;
    }

    /// Whether the signal is there: the last edge is not longer ago than one and a half intervals.
    pub(super) fn has_signal(&self, now: u64) -> bool {
        now.saturating_sub(self.last_edge) <= self.patience_us
    }

    /// The signal is gone: locking begins anew when it comes back.
    pub(super) fn lose_signal(&mut self) {
        self.since = None;
    }

    /// Whether the node was locked at the last edge and has not lost the signal since.
    pub(super) fn is_locked(&self) -> bool {
        self.since.is_some_and(|since| self.last_edge - since >= self.time_us)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Edges every 2 ms from `from` to `to`; the time at which the lock is reached.
    fn run(lock: &mut Lock, from: u64, to: u64) -> Option<u64> {
        (from..=to).step_by(2000).find(|&now| {
            lock.edge(now, 2000);
            lock.is_locked()
        })
    }

    #[test]
    fn counts_from_the_first_edge_with_sync_mode_on() {
        let mut lock = Lock::new(10_000);
        assert_eq!(run(&mut lock, 0, 100_000), None);
        lock.set_mode(true);
        assert_eq!(run(&mut lock, 102_000, 200_000), Some(112_000));
        lock.set_mode(true);
        assert!(lock.is_locked(), "a repeated command changes nothing");
        lock.set_mode(false);
        assert!(!lock.is_locked());
    }

    #[test]
    fn a_gap_of_more_than_one_and_a_half_intervals_begins_anew() {
        let mut lock = Lock::new(10_000);
        lock.set_mode(true);
        assert_eq!(run(&mut lock, 0, 20_000), Some(10_000));
        lock.edge(13_000, 2000);
        assert!(lock.is_locked(), "exactly one and a half intervals");
        assert!(lock.has_signal(16_000) && !lock.has_signal(16_001));
        assert_eq!(run(&mut lock, 16_001, 40_001), Some(26_001));
    }

    #[test]
    fn an_edge_earlier_than_three_quarters_of_an_interval_begins_anew() {
        let mut lock = Lock::new(10_000);
        lock.set_mode(true);
        run(&mut lock, 2_000, 20_000);
        lock.edge(13_500, 2000);
        assert!(lock.is_locked(), "exactly three quarters");
        lock.edge(14_999, 2000);
        assert!(!lock.is_locked());
        assert_eq!(run(&mut lock, 16_999, 60_999), Some(24_999));
    }

    #[test]
    fn a_signal_seen_to_be_lost_unlocks_before_it_comes_back() {
        let mut lock = Lock::new(0);
        lock.set_mode(true);
        lock.edge(0, 2000);
        assert!(lock.is_locked());
        lock.lose_signal();
        assert!(!lock.is_locked());
    }
}
