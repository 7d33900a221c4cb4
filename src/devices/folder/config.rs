//! A device of a folder as the plant file describes it.

use super::Folder;
use super::card::{Card, Memory};
use super::firmware::FolderFirmware;
use super::handshakes::Handshakes;
use super::in_slot;
use super::own_faults::OwnFaults;
use super::part::Part;
use super::phase;
use super::port::{BusLink, FolderPort};
use super::source::Source;
use crate::devices::can_bus::CanSocket;
use crate::devices::settings::range;
use crate::devices::{BuildError, CardMemory, CardPlace, Device, DeviceConfig, Plain, Plug, PortConfig};
use crate::fault::FaultKind;
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::Origin;
use crate::layout::{DeviceLayout, Port};
use crate::memory::Segment;
use core::fmt;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::Spanned;
use toml::de::{Error, ValueDeserializer};

/// A device of a folder in the plant file.
#[derive(Clone)]
pub(crate) struct FolderConfig {
    name: String,
    pub(super) folder: &'static Folder,
    pub(super) dir: PathBuf,
    /// Layout of the image: all registers, or the front panel of a card in a slot.
    layout: &'static DeviceLayout,
    slot: Option<Slot>,
    /// Name of the bus at the port.
    bus: Option<String>,
}

/// Keys of the section in the plant file, except `kind`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a device in a folder: a table with its settings")]
struct Section {
    name: String,
    bus: Option<String>,
}

/// Keys of the section of an option card in the plant file, `[[plc.option]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "an option card: a table with slot and card")]
pub(crate) struct OptionSection {
    slot: u8,
    /// Path of the folder, or its name in the search path.
    pub(crate) card: Spanned<String>,
    name: Option<String>,
    interface: Option<u8>,
    #[serde(default = "default_trigger")]
    trigger: u8,
    bus: Option<String>,
}

/// The slot of an option card.
#[derive(Clone)]
struct Slot {
    /// Name of the device with the slot.
    controller: String,
    number: u8,
    interface: Option<u8>,
    trigger: u8,
}

/// Returns the trigger of the option card IEI-02 (5.00005.03a p. 57).
fn default_trigger() -> u8 {
    1
}

impl FolderConfig {
    /// Reads the section of the device in `dir`. `folder` is what was read from this folder.
    pub(crate) fn read(
        folder: &'static Folder,
        dir: PathBuf,
        section: ValueDeserializer<'_>,
    ) -> Result<Arc<dyn DeviceConfig>, Error> {
        let Section { name, bus } = Section::deserialize(section)?;
        let layout = folder.registered.layout;
        Ok(Arc::new(FolderConfig { name, folder, dir, layout, slot: None, bus }))
    }

    /// Returns the device in `dir` as an option card of `controller`. `folder` is what was read from this folder.
    pub(crate) fn card(
        folder: &'static Folder,
        dir: PathBuf,
        controller: String,
        section: OptionSection,
    ) -> Arc<dyn DeviceConfig> {
        let OptionSection { slot: number, card: _, name, interface, trigger, bus } = section;
        let name = name.unwrap_or_else(|| format!("{controller}-option{number}"));
        let slot = Some(Slot { controller, number, interface, trigger });
        Arc::new(FolderConfig { name, folder, dir, layout: folder.registered.layout, slot, bus })
    }
}

impl FolderConfig {
    /// Returns the port that `device.toml` declares. Its medium is CAN.
    fn port(&self) -> Option<&'static Port> {
        self.layout().ports.first()
    }
}

/// The debug output identifies the settings when a plant is compared with a snapshot. It contains the files
/// of the device, but not the path of the folder.
/// A key that the plant file leaves out is not in the output, so that an additional key of a later build does not change it.
impl fmt::Debug for FolderConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, folder, dir: _, layout: _, slot, bus } = self;
        let mut settings = f.debug_struct(folder.registered.layout.name);
        settings.field("name", name).field("files", &folder.fingerprint);
        if let Some(Slot { controller, number, interface, trigger }) = slot {
            settings.field("option", &(controller, number, trigger));
            if let Some(interface) = interface {
                settings.field("interface", interface);
            }
        }
        if let Some(bus) = bus {
            settings.field("bus", bus);
        }
        settings.finish()
    }
}

impl DeviceConfig for FolderConfig {
    fn name(&self) -> &str {
        &self.name
    }

    fn layout(&self) -> &'static DeviceLayout {
        self.layout
    }

    fn fault_kinds(&self) -> &'static [&'static FaultKind] {
        self.folder.fault_kinds
    }

    fn check(&self) -> Result<(), BuildError> {
        if self.bus.is_some() && self.port().is_none() {
            let reason = format!(
                "'{}' has no port: its {} declares no [[port]]",
                self.name,
                self.dir.join("device.toml").display()
            );
            return Err(BuildError::own(&self.name, "bus", reason));
        }
        let Some(slot) = &self.slot else { return Ok(()) };
        range("trigger", &self.name, slot.trigger.into(), 1..=2, "1 or 2")?;
        if self.folder.script.is_none() {
            let dir = self.dir.display();
            let reason =
                format!("'{}' is no option card: {dir} has no firmware.rhai, which serves pulses", self.name);
            return Err(BuildError::own(&self.name, "card", reason));
        }
        if phase::overlaid(self.folder.registered.layout).next().is_some() {
            let reason = format!("'{}' is no option card: its structures overlay each other", self.name);
            return Err(BuildError::own(&self.name, "card", reason));
        }
        Ok(())
    }

    fn ports(&self) -> Vec<PortConfig<'_>> {
        self.port().map(|port| PortConfig::of(port, self.bus.as_deref())).into_iter().collect()
    }

    fn card_place(&self) -> Option<CardPlace<'_>> {
        let Slot { controller, number, interface, trigger } = self.slot.as_ref()?;
        Some(CardPlace { controller, slot: *number, interface: *interface, trigger: *trigger })
    }

    fn folder(&self) -> Option<&Path> {
        Some(&self.dir)
    }

    fn retain_bytes(&self) -> u32 {
        self.layout().retain.map_or(0, |retain| retain.default_bytes)
    }

    fn with_layout(&self, layout: &'static DeviceLayout) -> Option<Arc<dyn DeviceConfig>> {
        Some(Arc::new(FolderConfig { layout, ..self.clone() }))
    }

    fn build(
        &self,
        index: DeviceIndex,
        segment: Segment,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let memory = Memory::own(segment.clone());
        self.build_on(index, segment, memory)
    }

    fn build_card(
        &self,
        index: DeviceIndex,
        segment: Segment,
        memory: CardMemory,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let layout = self.folder.registered.layout;
        let CardMemory { controller, segment: registers, interface } = memory;
        let shift = in_slot::shift(layout, interface.first);
        let origin = Origin { plc: controller, node: PortNumber::of_option_interface(interface.number) };
        let memory = Memory::of_controller(registers, shift, origin, layout);
        self.build_on(index, segment, memory)
    }
}

impl FolderConfig {
    /// Builds the device with its front panel in `segment` and its registers in `memory`.
    fn build_on(
        &self,
        index: DeviceIndex,
        segment: Segment,
        memory: Memory,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let layout = self.folder.registered.layout;
        let script = self.folder.script.as_ref();
        let link = self.port().map(|_| BusLink::default());
        let face = segment.firmware_header()?;
        let mut card = Card::new(layout, memory, face, script.is_some(), link.clone());
        let mut parts: Vec<Box<dyn Part>> = Vec::new();
        if let Some(script) = script {
            if script.watches() {
                card.watch(layout, script.written());
            }
            parts.push(script.firmware(layout));
        }
        parts.push(Box::new(Handshakes::new(&self.folder.rows)));
        let plugs = self.port().zip(link).map(|(port, link)| {
            let origin = Origin { plc: index, node: port.number };
            let firmware = Box::new(FolderPort::new(link, script.is_some()));
            let socket =
                CanSocket { origin, segment: segment.clone(), layout: self.layout(), port: firmware };
            let (number, family, bus) = (port.number, port.medium, self.bus.clone());
            Plug { number, family, bus, socket: Box::new(socket) }
        });
        let plugs = Vec::from_iter(plugs);
        let faults = OwnFaults::new(self.folder.fault_kinds);
        let firmware = FolderFirmware::new(parts, card, faults, Source::new(self.clone()));
        let device = Plain::new(index, &self.name, self.layout(), segment, firmware)?;
        Ok((Box::new(device), plugs))
    }
}
