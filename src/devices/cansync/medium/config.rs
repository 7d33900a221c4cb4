//! A bus as the plant file describes it.

use crate::devices::cansync::bus::FrameLength;
use crate::devices::cansync::drive::DriveConfig;
use crate::devices::settings::{SettingError, range, time, time_or_none};
use serde::Deserialize;

/// A bus of the plant file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusConfig {
    /// Name, unique among the buses.
    pub name: String,
    /// Baud rate that the drives on it are set to: 500, 250 or 125 kbit/s (default 500). The bus itself
    /// runs at the rate that its master is initialized with.
    #[serde(default = "default_kbit_s")]
    pub kbit_s: u16,
    /// Length of its process data frames: `"fixed"` (default) or `"variable"` (decision D-10).
    #[serde(default)]
    pub frame_length: FrameLength,
    /// The drives on it.
    #[serde(rename = "drive", default)]
    pub drives: Vec<DriveConfig>,
}

fn default_kbit_s() -> u16 {
    500
}

impl Default for BusConfig {
    /// A bus without name and drives.
    fn default() -> Self {
        BusConfig {
            name: String::new(),
            kbit_s: default_kbit_s(),
            frame_length: FrameLength::default(),
            drives: Vec::new(),
        }
    }
}

impl BusConfig {
    /// Checks the numbers, but for what only the drives themselves know.
    pub(crate) fn check(&self) -> Result<(), SettingError> {
        if ![500, 250, 125].contains(&self.kbit_s) {
            let (name, value) = (self.name.clone(), self.kbit_s.into());
            return Err(SettingError { what: "kbit_s", name, value, right: "500, 250 or 125" });
        }
        self.drives.iter().try_for_each(check_drive)
    }
}

fn check_drive(drive: &DriveConfig) -> Result<(), SettingError> {
    let name = drive.name.as_str();
    range("slave_number", name, drive.slave_number.into(), 0..=31, "0 to 31")?;
    time("lock_time_us", name, drive.lock_time_us)?;
    time_or_none("sync_loss_us", name, drive.sync_loss_us)?;
    time("monitoring.sync.time_us", name, drive.monitoring.sync.time_us)?;
    time("monitoring.reference_values.time_us", name, drive.monitoring.reference_values.time_us)
}
