//! A PLC as the plant file describes it.

use super::Plc;
use super::plc::{MASTER, SERIAL, SLAVE};
use crate::devices::cansync::drive::{BuiltInDrive, BuiltInDriveConfig, MonitorSettings};
use crate::devices::emulation::settings::{range, time, time_or_none};
use crate::devices::omega_drive_line_2::registers::{
    BAUD_RATES, DEVICE, ETHERNET_CONFIG, OPTION1, OPTION2, OPTION3, RETAIN_BYTES, RETAIN_DEFAULT_BYTES,
};
use crate::devices::{BuildError, DeviceConfig, OptionInterface, Plug, PortConfig, SettingError};
use crate::identity::{DeviceIndex, PortNumber};
use crate::layout::{Area, DeviceLayout};
use crate::memory::Segment;
use crate::memory::header::Project;
use serde::Deserialize;
use std::sync::Arc;
use toml::de::{Error, ValueDeserializer};

/// Option interfaces; interface 3 is for communication cards in slot 2 (p. 60).
pub(super) const OPTION_INTERFACES: &[OptionInterface] = &[
    OptionInterface { number: 1, slot: 1, first: OPTION1 },
    OptionInterface { number: 2, slot: 2, first: OPTION2 },
    OptionInterface { number: 3, slot: 2, first: OPTION3 },
];

/// A PLC of the plant file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a PLC: a table with its settings")]
pub struct PlcConfig {
    /// Name, unique among the PLCs: 1 to 31 characters of `A-Z a-z 0-9 _ -`.
    pub name: String,
    /// DIP switch S33, 0..=31: the slave number of node 1.
    #[serde(default)]
    pub dip: u8,
    /// Name of the bus at node 1. The PLC is a slave on this bus.
    pub node1: Option<String>,
    /// Name of the bus at node 2. The PLC is the master of this bus.
    pub node2: Option<String>,
    /// Name of the serial line at the RS485 port.
    pub serial: Option<String>,
    /// Emulated time that node 1 needs to lock to the SYNC signal, in us (default 1 s; D-07).
    #[serde(default = "default_lock_time")]
    pub lock_time_us: u64,
    /// Emulated time without SYNC signal that ends the lock, in us, from 1 us to one hour. If it is omitted:
    /// two and a half intervals ([`SyncLock`](crate::devices::cansync::frames::SyncLock)).
    pub sync_loss_us: Option<u64>,
    /// Period of the SYNC signal of an option card in us, 50..=1000000; `None` without such a card.
    pub option_sync_us: Option<u32>,
    /// The drive that is connected through the BAPS.
    #[serde(default)]
    pub drive: BuiltInDriveConfig,
    /// Speed of the Ethernet link in Mbit/s: 100 (default), 10, or 0 for no link.
    #[serde(default = "default_ethernet_mbit")]
    pub ethernet_mbit: u16,
    /// The project in the PLC at the first power-on. By default there is no project.
    #[serde(default)]
    pub project: ProjectConfig,
    /// Number of retain flags in bytes, 4..=57344 and divisible by 4. The retain flags begin at `%MB10000000`
    /// (default 20000 bytes; p. 42).
    #[serde(default = "default_retain_bytes")]
    pub retain_bytes: u32,
}

/// Project of a PLC at the first power-on (manual p. 37).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
#[serde(expecting = "a project, as a word")]
pub enum ProjectConfig {
    /// No project, until a program loads one.
    #[default]
    None,
    /// A boot project. Power-off and reset do not delete it.
    Boot,
    /// A project that was sent, but is not a boot project. The next power-off or reset loses it.
    Sent,
}

impl From<ProjectConfig> for Project {
    fn from(config: ProjectConfig) -> Self {
        match config {
            ProjectConfig::None => Project::None,
            ProjectConfig::Boot => Project::Boot,
            ProjectConfig::Sent => Project::Sent,
        }
    }
}

fn default_lock_time() -> u64 {
    1_000_000
}

fn default_ethernet_mbit() -> u16 {
    100
}

fn default_retain_bytes() -> u32 {
    RETAIN_DEFAULT_BYTES
}

impl PlcConfig {
    /// Reads a `[[plc]]` section.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn DeviceConfig>, Error> {
        Ok(Arc::new(Self::deserialize(value)?))
    }

    /// Checks the times of node 1 and of the drive at the BAPS.
    fn check_times(&self) -> Result<(), SettingError> {
        let (name, drive) = (self.name.as_str(), &self.drive);
        time("lock_time_us", name, self.lock_time_us)?;
        time("drive.lock_time_us", name, drive.lock_time_us)?;
        time("drive.service_time_us", name, drive.service_time_us)?;
        time_or_none("sync_loss_us", name, self.sync_loss_us)?;
        time_or_none("drive.sync_loss_us", name, drive.sync_loss_us)?;
        time("drive.monitoring.sync.time_us", name, drive.monitoring.sync.time_us)?;
        let cyclic_data = drive.monitoring.cyclic_data.map(|MonitorSettings { time_us, .. }| time_us);
        time_or_none("drive.monitoring.cyclic_data.time_us", name, cyclic_data)
    }
}

impl DeviceConfig for PlcConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn layout(&self) -> &'static DeviceLayout {
        &DEVICE
    }

    fn check(&self) -> Result<(), BuildError> {
        range("dip", &self.name, self.dip.into(), 0..=31, "0 to 31")?;
        self.check_times()?;
        let sync = self.option_sync_us.map_or(50, u64::from);
        range("option_sync_us", &self.name, sync, 50..=1_000_000, "50 to 1000000")?;
        if ![0, 10, 100].contains(&self.ethernet_mbit) {
            let (name, value) = (self.name.clone(), self.ethernet_mbit.into());
            return Err(SettingError { what: "ethernet_mbit", name, value, right: "100, 10 or 0" }.into());
        }
        let right = "4 to 57344 (the 56 kB of the NOVRAM) and divisible by 4";
        range("retain_bytes", &self.name, self.retain_bytes.into(), 4..=RETAIN_BYTES as u64, right)?;
        if !self.retain_bytes.is_multiple_of(4) {
            let (name, value) = (self.name.clone(), self.retain_bytes.into());
            return Err(SettingError { what: "retain_bytes", name, value, right }.into());
        }
        // The drive itself checks the other settings when it is created.
        BuiltInDrive::new(&self.name, &self.drive)?;
        Ok(())
    }

    fn ports(&self) -> Vec<PortConfig<'_>> {
        let (node1, node2) = (self.node1.as_deref(), self.node2.as_deref());
        vec![
            PortConfig { number: SLAVE, name: "node1", bus: node1, address: Some(self.dip) },
            PortConfig { number: MASTER, name: "node2", bus: node2, address: None },
            PortConfig { number: SERIAL, name: "serial", bus: self.serial.as_deref(), address: None },
        ]
    }

    fn kbit_s(&self, port: PortNumber) -> Vec<u16> {
        let nodes = BAUD_RATES.iter().filter(|_| port != SERIAL);
        nodes.map(|rate| rate.kbit_per_s).collect()
    }

    fn retain_bytes(&self) -> u32 {
        self.retain_bytes
    }

    /// Returns the number of option card slots (p. 9).
    fn card_slots(&self) -> u8 {
        2
    }

    /// Returns the Ethernet configuration (p. 61, 76).
    fn novram(&self) -> Option<&'static Area> {
        DEVICE.areas.iter().find(|area| area.first == ETHERNET_CONFIG)
    }

    fn with_layout(&self, layout: &'static DeviceLayout) -> Option<Arc<dyn DeviceConfig>> {
        Some(Arc::new(PlcWithCards { plc: self.clone(), layout }))
    }

    fn build(
        &self,
        index: DeviceIndex,
        segment: Segment,
    ) -> Result<(Box<dyn crate::devices::Device>, Vec<Plug>), BuildError> {
        let (plc, ports) = Plc::new(index, self, &DEVICE, segment)?;
        Ok((Box::new(plc), ports))
    }
}

/// A PLC with the registers of its option cards in its memory. All settings are settings of the PLC.
#[derive(Clone, Debug)]
struct PlcWithCards {
    plc: PlcConfig,
    layout: &'static DeviceLayout,
}

impl DeviceConfig for PlcWithCards {
    fn name(&self) -> &str {
        self.plc.name()
    }

    fn layout(&self) -> &'static DeviceLayout {
        self.layout
    }

    fn check(&self) -> Result<(), BuildError> {
        self.plc.check()
    }

    fn ports(&self) -> Vec<PortConfig<'_>> {
        self.plc.ports()
    }

    fn kbit_s(&self, port: PortNumber) -> Vec<u16> {
        self.plc.kbit_s(port)
    }

    fn retain_bytes(&self) -> u32 {
        self.plc.retain_bytes()
    }

    fn card_slots(&self) -> u8 {
        self.plc.card_slots()
    }

    fn novram(&self) -> Option<&'static Area> {
        self.plc.novram()
    }

    fn with_layout(&self, layout: &'static DeviceLayout) -> Option<Arc<dyn DeviceConfig>> {
        self.plc.with_layout(layout)
    }

    fn build(
        &self,
        index: DeviceIndex,
        segment: Segment,
    ) -> Result<(Box<dyn crate::devices::Device>, Vec<Plug>), BuildError> {
        // Programs that were built for the PLC without cards find all their registers.
        segment.header()?.base_layout_hash.store(DEVICE.layout_hash);
        let (plc, ports) = Plc::new(index, &self.plc, self.layout, segment)?;
        Ok((Box::new(plc), ports))
    }
}
