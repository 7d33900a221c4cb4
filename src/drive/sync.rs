//! Whether the drive's control task runs in step with the SYNC signal.

/// Watches the falling SYNC edges.
#[derive(Clone, Copy, Debug)]
pub(super) struct SyncWatch {
    lock_time_us: u64,
    mode_on: bool,
    /// The first edge of the present run without gap.
    since: Option<u64>,
    last: Option<u64>,
    locked: bool,
}

impl SyncWatch {
    /// A watch that locks after `lock_time_us` of SYNC without a gap.
    pub const fn new(lock_time_us: u64) -> Self {
        SyncWatch { lock_time_us, mode_on: false, since: None, last: None, locked: false }
    }

    /// SYNC mode on or off. "On" while it is on changes nothing.
    pub fn set_mode(&mut self, on: bool) {
        self.mode_on = on;
        if !on {
            self.unlock();
        }
    }

    /// An edge at `now_us`; `interval_us` is the time from edge to edge. More than one and a half
    /// intervals since the last edge are a gap, which unlocks; so does less than three quarters (decision D-125).
    #[inline]
    pub fn edge(&mut self, now_us: u64, interval_us: u32) {
        let interval = u64::from(interval_us);
        let distance = self.last.map_or(interval, |last| now_us.saturating_sub(last));
        self.last = Some(now_us);
        if !(interval * 3 / 4..=interval * 3 / 2).contains(&distance) {
            self.unlock();
        }
        if self.mode_on && !self.locked {
            let since = *self.since.get_or_insert(now_us);
            self.locked = now_us.saturating_sub(since) >= self.lock_time_us;
        }
    }

    /// SYNC has stopped.
    pub fn unlock(&mut self) {
        self.since = None;
        self.locked = false;
    }

    /// Whether the drive is synchronized.
    #[inline]
    pub const fn is_locked(&self) -> bool {
        self.locked
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(watch: &mut SyncWatch, from: u64, to: u64) -> Option<u64> {
        (from..=to).step_by(2000).find(|&now| {
            watch.edge(now, 2000);
            watch.is_locked()
        })
    }

    #[test]
    fn locks_after_the_lock_time_with_sync_mode_on() {
        let mut watch = SyncWatch::new(10_000);
        assert_eq!(run(&mut watch, 0, 100_000), None);
        watch.set_mode(true);
        assert_eq!(run(&mut watch, 102_000, 200_000), Some(112_000));
    }

    #[test]
    fn repeated_mode_on_does_not_start_over() {
        let mut watch = SyncWatch::new(10_000);
        watch.set_mode(true);
        run(&mut watch, 0, 6_000);
        watch.set_mode(true);
        assert_eq!(run(&mut watch, 8_000, 20_000), Some(10_000));
        watch.set_mode(true);
        assert!(watch.is_locked());
    }

    #[test]
    fn a_missing_edge_unlocks_and_starts_over() {
        let mut watch = SyncWatch::new(10_000);
        watch.set_mode(true);
        run(&mut watch, 0, 10_000);
        watch.edge(13_000, 2000); // exactly one and a half intervals
        assert!(watch.is_locked());
        watch.edge(16_001, 2000);
        assert!(!watch.is_locked());
        assert_eq!(run(&mut watch, 18_001, 40_001), Some(26_001));
    }

    #[test]
    fn an_early_edge_unlocks_and_starts_over() {
        let mut watch = SyncWatch::new(10_000);
        watch.set_mode(true);
        run(&mut watch, 0, 10_000);
        watch.edge(11_500, 2000); // exactly three quarters of an interval
        assert!(watch.is_locked());
        watch.edge(12_999, 2000);
        assert!(!watch.is_locked());
        assert_eq!(run(&mut watch, 14_999, 60_999), Some(22_999));
    }

    #[test]
    fn mode_off_and_stop_unlock_at_once() {
        let mut watch = SyncWatch::new(0);
        watch.set_mode(true);
        watch.edge(0, 2000);
        assert!(watch.is_locked());
        watch.set_mode(false);
        assert!(!watch.is_locked());
        watch.set_mode(true);
        watch.edge(2000, 2000);
        watch.unlock();
        assert!(!watch.is_locked());
    }
}
