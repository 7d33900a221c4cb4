//! Reports when the emulated time of a real-time clock is late, because the machine is too slow for the plant, or a script
//! of a device takes longer than its processor cycle.

use super::emulator::Emulator;
use std::time::Duration;

/// Real time from which a clock counts as late.
const LATE: Duration = Duration::from_secs(1);
/// Real time below which a late clock is no longer late.
const IN_TIME: Duration = Duration::from_millis(100);
/// Largest number of devices that a message names.
const MOST_NAMES: usize = 4;

impl Emulator {
    /// Records in the journal that the emulated time has become late, or is no longer late.
    pub(super) fn note_lateness(&mut self) {
        let late = self.late_by();
        let has_changed = if self.is_late { late < IN_TIME } else { late >= LATE };
        if has_changed {
            self.is_late = !self.is_late;
            let late_us = if self.is_late { late.as_micros() as u64 } else { 0 };
            self.plant.note_late(late_us);
        }
    }

    /// Describes what a real-time clock that is late waits for; `None` if it is in time.
    pub(super) fn lateness(&self) -> Option<String> {
        if !self.is_late {
            return None;
        }
        let late = self.late_by().as_secs_f64();
        let mut scripts: Vec<_> = self.plant.folder_names().map(|name| format!("'{name}'")).collect();
        scripts.truncate(MOST_NAMES);
        let scripts = if scripts.is_empty() {
            String::new()
        } else {
            format!(" or the script of PLC {}", scripts.join(", "))
        };
        Some(format!("this machine{scripts}, which is too slow: the emulated time is {late:.1} s late"))
    }
}
