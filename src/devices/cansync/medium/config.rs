//! A bus as the plant file describes it.

use super::{FAMILY, SimBus};
use crate::devices::cansync::bus::FrameLength;
use crate::devices::cansync::drive::{Drive, DriveConfig};
use crate::devices::settings::{range, time, time_or_none};
use crate::devices::{BuildError, Medium, MediumConfig, SettingError};
use crate::door::DoorSpec;
use serde::Deserialize;
use std::sync::Arc;
use toml::de::{Error, ValueDeserializer};

/// A bus of the plant file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a bus: a table with its settings")]
pub struct BusConfig {
    /// Name, unique among the buses.
    pub name: String,
    /// Baud rate that the drives on it are set to: 1000, 500, 250 or 125 kbit/s (default 500). The bus itself
    /// runs at the rate that its master is initialized with.
    #[serde(default = "default_kbit_s")]
    pub kbit_s: u16,
    /// Length of its process data frames: `"fixed"` (default) or `"variable"` (decision D-10).
    #[serde(default)]
    pub frame_length: FrameLength,
    /// The doors to it that are open from the start.
    #[serde(default)]
    pub doors: Vec<DoorSpec>,
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
            doors: Vec::new(),
            drives: Vec::new(),
        }
    }
}

impl BusConfig {
    /// Reads a `[[bus]]` section.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn MediumConfig>, Error> {
        Ok(Arc::new(Self::deserialize(value)?))
    }
}

impl MediumConfig for BusConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn check(&self) -> Result<(), BuildError> {
        if ![1000, 500, 250, 125].contains(&self.kbit_s) {
            let (name, value) = (self.name.clone(), self.kbit_s.into());
            let right = "1000, 500, 250 or 125";
            return Err(SettingError { what: "kbit_s", name, value, right }.into());
        }
        for drive in &self.drives {
            check_drive(drive)?;
            // What only the drive itself knows.
            Drive::new(drive, self.kbit_s)?;
        }
        Ok(())
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn participants(&self) -> Vec<(&str, u8)> {
        self.drives.iter().map(|drive| (drive.name.as_str(), drive.slave_number)).collect()
    }

    fn doors(&self) -> &[DoorSpec] {
        &self.doors
    }

    fn has_one_master(&self) -> bool {
        true
    }

    fn build(&self, index: usize) -> Result<Box<dyn Medium>, BuildError> {
        Ok(Box::new(SimBus::new(index, self)?))
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
