//! The drives, and what they were told and did lately.

use super::list::List;
use crate::request::DriveEntry;
use std::collections::VecDeque;

/// So many points of the running chart are kept for each drive.
const KEPT: usize = 1_000;

/// A drive with its chart.
pub(super) struct Shown {
    /// Which it is, and how it stands.
    pub entry: DriveEntry,
    /// Emulated time in seconds, reference and actual value, as far as they were looked at.
    pub points: VecDeque<(f64, f64, f64)>,
}

/// All of them.
#[derive(Default)]
pub(super) struct Drives {
    /// In the order of the buses, then those that PLCs are built into.
    pub all: Vec<Shown>,
    /// Which one is chosen.
    pub list: List,
}

impl Drives {
    /// Takes how they stand at an emulated time.
    pub(super) fn take(&mut self, drives: Vec<DriveEntry>, now_us: u64) {
        let mut known = core::mem::take(&mut self.all);
        for entry in drives {
            let same = |shown: &Shown| (&shown.entry.bus, &shown.entry.name) == (&entry.bus, &entry.name);
            let place = known.iter().position(same);
            let mut points = place.map(|place| known.swap_remove(place).points).unwrap_or_default();
            let at = now_us as f64 / 1e6;
            // Where the clock stands still, or was turned back, nothing is drawn over what is there.
            points.retain(|(time, ..)| *time < at);
            points.push_back((at, entry.state.speed_reference.into(), entry.state.speed_actual.into()));
            let surplus = points.len().saturating_sub(KEPT);
            points.drain(..surplus);
            self.all.push(Shown { entry, points });
        }
    }
}
