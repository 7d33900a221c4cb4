//! The drives with their recent reference and actual values.

use super::list::List;
use crate::request::DriveEntry;
use std::collections::VecDeque;

/// Number of chart points that are kept for each drive.
const KEPT: usize = 1_000;

/// A drive with its chart.
pub(super) struct ChartedDrive {
    /// Name and state of the drive.
    pub entry: DriveEntry,
    /// Emulated time in seconds, reference and actual value, one point per poll.
    pub points: VecDeque<(f64, f64, f64)>,
}

/// The pane with all drives of the plant.
#[derive(Default)]
pub(super) struct Drives {
    /// The drives in the order of the buses, then the drives that contain a PLC.
    pub all: Vec<ChartedDrive>,
    /// Position of the selection in the list of drives.
    pub list: List,
}

impl Drives {
    /// Adds the state of each drive at the emulated time `now_us`, in microseconds.
    pub(super) fn take(&mut self, drives: Vec<DriveEntry>, now_us: u64) {
        let mut known = core::mem::take(&mut self.all);
        for entry in drives {
            let same =
                |shown: &ChartedDrive| (&shown.entry.bus, &shown.entry.name) == (&entry.bus, &entry.name);
            let place = known.iter().position(same);
            let mut points = place.map(|place| known.swap_remove(place).points).unwrap_or_default();
            let at = now_us as f64 / 1e6;
            // If the clock has stopped or gone back, there are points at the time of the new point or later. The new
            // point replaces them.
            points.retain(|(time, ..)| *time < at);
            points.push_back((at, entry.state.speed_reference.into(), entry.state.speed_actual.into()));
            let surplus = points.len().saturating_sub(KEPT);
            points.drain(..surplus);
            self.all.push(ChartedDrive { entry, points });
        }
    }
}
