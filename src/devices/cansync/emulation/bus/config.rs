//! Configuration of a CANsync bus in the plant file.

use super::{FAMILY, SimBus};
use crate::can::Message;
use crate::devices::cansync::drive::{Drive, DriveConfig};
use crate::devices::cansync::emulation::messages;
use crate::devices::cansync::frames::FrameLength;
use crate::devices::emulation::settings::{range, time, time_or_none};
use crate::devices::{BuildError, Bus, BusSection, Doubt, MasterConfig, SettingError};
use crate::door::DoorSpec;
use crate::identity::BusIndex;
use serde::Deserialize;
use std::sync::Arc;
use toml::de::{Error, ValueDeserializer};

/// A bus in the plant file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a bus: a table with its settings")]
pub struct BusConfig {
    /// Name, unique among the buses.
    pub name: String,
    /// Baud rate of the drives without a baud rate setting: 1000, 500, 250 or 125 kbit/s (default 500). The
    /// bus itself runs at the rate with which its master is initialized.
    #[serde(default = "default_kbit_s")]
    pub kbit_s: u16,
    /// Length of the process data frames: `"fixed"` (default) or `"variable"` (decision D-10).
    #[serde(default)]
    pub frame_length: FrameLength,
    /// Doors of the bus that are open from the start.
    #[serde(default)]
    pub doors: Vec<DoorSpec>,
    /// Drives on the bus.
    #[serde(rename = "drive", default)]
    pub drives: Vec<DriveConfig>,
}

fn default_kbit_s() -> u16 {
    500
}

impl Default for BusConfig {
    /// Returns a bus without a name and without drives.
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
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn BusSection>, Error> {
        Ok(Arc::new(Self::deserialize(value)?))
    }

    /// Returns the JSON Schema of the section.
    ///
    /// # Panics
    /// The text beside this file is valid JSON, as a test checks.
    pub(crate) fn schema() -> serde_json::Value {
        serde_json::from_str(include_str!("plant.schema.json")).expect("our own schemas are JSON")
    }
}

impl BusSection for BusConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn messages(&self) -> Vec<Message> {
        messages::all()
    }

    fn check(&self) -> Result<(), BuildError> {
        check_rate(&self.name, self.kbit_s)?;
        for drive in &self.drives {
            check_drive(drive)?;
            // Checks that need the drive itself.
            Drive::new(drive, self.kbit_s)?;
        }
        Ok(())
    }

    /// Returns a doubt for each drive that will receive nothing, because its rate is not possible on the bus
    /// or differs from the rate of the other stations (decision D-541).
    fn doubts(&self, masters: &[MasterConfig]) -> Vec<Doubt> {
        let bus = &self.name;
        let has = |master: &MasterConfig, kbit_s| master.kbit_s.is_empty() || master.kbit_s.contains(&kbit_s);
        let rate_conflict = |kbit_s: u16| {
            let master = masters.iter().find(|master| !has(master, kbit_s))?;
            let rates: Vec<_> = master.kbit_s.iter().map(u16::to_string).collect();
            Some(format!(
                "the master of bus '{bus}', {}, runs at {} kbit/s only",
                master.name,
                rates.join(", ")
            ))
        };
        let mut doubts = Vec::new();
        if self.drives.iter().any(|drive| drive.kbit_s.is_none())
            && let Some(why) = rate_conflict(self.kbit_s)
        {
            let text = format!(
                "drives on bus '{bus}' are set to {} kbit/s and will hear nothing: {why}",
                self.kbit_s
            );
            doubts.push(Doubt { section: bus.clone(), key: "kbit_s", text });
        }
        for drive in &self.drives {
            let Some(kbit_s) = drive.kbit_s.filter(|kbit_s| *kbit_s != self.kbit_s) else { continue };
            let why = rate_conflict(kbit_s).unwrap_or_else(|| {
                format!(
                    "its bus '{bus}' is at {} kbit/s, and a bus has one rate, that of its master",
                    self.kbit_s
                )
            });
            let text =
                format!("drive '{}' is set to {kbit_s} kbit/s and will hear nothing: {why}", drive.name);
            doubts.push(Doubt { section: drive.name.clone(), key: "kbit_s", text });
        }
        doubts
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

    fn build(&self, index: BusIndex) -> Result<Box<dyn Bus>, BuildError> {
        Ok(Box::new(SimBus::new(index, self)?))
    }
}

fn check_rate(name: &str, kbit_s: u16) -> Result<(), SettingError> {
    if [1000, 500, 250, 125].contains(&kbit_s) {
        return Ok(());
    }
    let right = "1000, 500, 250 or 125";
    Err(SettingError { what: "kbit_s", name: name.to_owned(), value: kbit_s.into(), right })
}

fn check_drive(drive: &DriveConfig) -> Result<(), SettingError> {
    let name = drive.name.as_str();
    drive.kbit_s.map_or(Ok(()), |kbit_s| check_rate(name, kbit_s))?;
    range("slave_number", name, drive.slave_number.into(), 0..=31, "0 to 31")?;
    time("lock_time_us", name, drive.lock_time_us)?;
    time_or_none("sync_loss_us", name, drive.sync_loss_us)?;
    time("monitoring.sync.time_us", name, drive.monitoring.sync.time_us)?;
    time("monitoring.reference_values.time_us", name, drive.monitoring.reference_values.time_us)
}
