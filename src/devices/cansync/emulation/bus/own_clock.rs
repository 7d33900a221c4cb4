//! Behaviour of drives without SYNC edges: they continue by their own clocks.
//!
//! A running bus notifies its drives of each edge, even of an edge that is lost on the line. There are no
//! notifications if the master was restarted, or if the bus that supplies the SYNC signal has no signal. Then
//! the first interval without an edge begins one and a half intervals after the last edge: from that moment
//! on, an edge would be too late. Further intervals follow until all drives are at a standstill.

use super::SimBus;
use super::schedule::Slot;
use crate::devices::cansync::drive::Drive;
use serde::{Deserialize, Serialize};

/// The drives' own clock.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct OwnClock {
    /// Start of the next interval without an edge, in microseconds.
    next: u64,
    /// Length in microseconds of the last interval with a SYNC signal.
    interval_us: u32,
}

impl Default for OwnClock {
    /// Before the first edge, the cycle of its control task is the only clock of a drive.
    fn default() -> Self {
        OwnClock { next: 0, interval_us: 500 }
    }
}

impl SimBus {
    /// Restarts the clock after an edge.
    #[inline]
    pub(super) fn edge_for_drives(&mut self, now: u64, interval_us: u32) {
        if !self.drives.is_empty() {
            self.own_clock = OwnClock { next: now + u64::from(interval_us) * 3 / 2, interval_us };
            self.schedule.set(Slot::OwnClock, self.own_clock.next);
        }
    }

    /// Handles an edge that was lost on the line: the drives do not see it.
    pub(super) fn no_edge_for_drives(&mut self, now: u64, interval_us: u32) {
        self.interval_without_edge(now, interval_us);
        self.own_clock = OwnClock { next: now + u64::from(interval_us) * 3 / 2, interval_us };
        self.schedule_own_clock(now);
    }

    fn interval_without_edge(&mut self, now: u64, interval_us: u32) {
        let disturbance = &self.disturbance;
        let drives = self.drives.settle().iter_mut();
        for drive in drives.filter(|drive| !disturbance.is_off(drive.slave_number())) {
            drive.interval_without_edge(now, interval_us);
        }
    }

    /// Handles the start of an interval without an edge, or the end of a drive's waiting time for SYNC.
    #[cold]
    pub(super) fn own_clock_event(&mut self, now: u64) {
        let OwnClock { next, interval_us } = self.own_clock;
        if next <= now {
            self.interval_without_edge(now, interval_us);
        } else {
            self.drives.settle().iter_mut().for_each(|drive| drive.pass(now));
        }
        self.schedule_own_clock(now);
    }

    /// Schedules the own clock again, because a drive that may have been idle has changed.
    pub(super) fn wake_drives(&mut self, now: u64) {
        self.schedule_own_clock(now);
        self.next = self.schedule.next();
    }

    /// Sets the time of the next [`Slot::OwnClock`]. Drives that are off do not need their own clock: they
    /// have their state at power-on, which is unlocked and idle.
    pub(super) fn schedule_own_clock(&mut self, now: u64) {
        let OwnClock { next, interval_us } = &mut self.own_clock;
        if *next <= now {
            *next = now + u64::from(*interval_us);
        }
        let drives = self.drives.settle();
        let moving = drives.iter().any(|drive| !drive.is_quiescent()).then_some(*next);
        let waiting = drives.iter().filter_map(Drive::next_time);
        match waiting.chain(moving).min() {
            Some(time) => self.schedule.set(Slot::OwnClock, time.max(now + 1)),
            None => self.schedule.cancel(Slot::OwnClock),
        }
    }
}
