//! What drives do while their SYNC edge is missing: they go on by their own clocks.
//!
//! A bus that runs tells its drives about each edge, also about one that is lost on the line. If nothing comes at all -
//! the master was restarted, or the bus above has no signal - the first interval without edge begins one and a half
//! intervals after the last, which is later than any edge, and further ones follow until all drives are at rest.

use super::SimBus;
use super::schedule::Slot;
use crate::devices::cansync::drive::Drive;
use serde::{Deserialize, Serialize};

/// The drives' own clock.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct OwnClock {
    /// When the next interval without edge begins.
    next: u64,
    /// Length of the last interval with a SYNC signal.
    interval_us: u32,
}

impl Default for OwnClock {
    /// Before the first edge a drive has only the time slices of its own control task.
    fn default() -> Self {
        OwnClock { next: 0, interval_us: 500 }
    }
}

impl SimBus {
    /// An edge has been delivered.
    #[inline]
    pub(super) fn edge_for_drives(&mut self, now: u64, interval_us: u32) {
        if !self.drives.is_empty() {
            self.own_clock = OwnClock { next: now + u64::from(interval_us) * 3 / 2, interval_us };
            self.schedule.set(Slot::OwnClock, self.own_clock.next);
        }
    }

    /// An edge was lost on the line.
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

    /// An interval without edge begins, or a drive has waited for SYNC for so long that something happens.
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

    /// Something has happened to a drive that may have been at rest.
    pub(super) fn wake_drives(&mut self, now: u64) {
        self.schedule_own_clock(now);
        self.next = self.schedule.next_time();
    }

    /// Sets the time of the next [`Slot::OwnClock`]. Drives that are off need none: they are as at power-on, without lock
    /// and at rest.
    pub(super) fn schedule_own_clock(&mut self, now: u64) {
        let OwnClock { next, interval_us } = &mut self.own_clock;
        if *next <= now {
            *next = now + u64::from(*interval_us);
        }
        let drives = self.drives.settle();
        let moving = drives.iter().any(|drive| !drive.is_at_rest()).then_some(*next);
        let waiting = drives.iter().filter_map(Drive::next_time);
        match waiting.chain(moving).min() {
            Some(time) => self.schedule.set(Slot::OwnClock, time.max(now + 1)),
            None => self.schedule.cancel(Slot::OwnClock),
        }
    }
}
