//! A device of a folder as the plant file describes it.

use super::Folder;
use super::card::{Card, Memory};
use super::dp_master::{self, DpMaster, DpSlave};
use super::firmware::FolderFirmware;
use super::handshakes::Handshakes;
use super::in_slot;
use super::own_faults::OwnFaults;
use super::part::Part;
use super::phase;
use super::port::{BusLink, FolderPort};
use super::source::Source;
use crate::devices::can_bus::{self, CanSocket};
use crate::devices::emulation::settings::range;
use crate::devices::profibus_bus::{self, ProfibusSocket};
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

/// Largest address of a DP slave.
const MOST_ADDRESS: u8 = 125;
/// Maximum number of data octets of a DP telegram.
const MOST_OCTETS: usize = 244;

/// A device of a folder in the plant file.
#[derive(Clone)]
pub(crate) struct FolderConfig {
    name: String,
    pub(super) folder: &'static Folder,
    pub(super) dir: PathBuf,
    /// Layout of the image: all registers, or the front panel of a card in a slot.
    layout: &'static DeviceLayout,
    slot: Option<Slot>,
    /// Name of the bus at the CAN port.
    bus: Option<String>,
    /// Name of the bus at the PROFIBUS port.
    profibus: Option<String>,
    slaves: Arc<[DpSlave]>,
}

/// Keys of the section in the plant file, except `kind`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a device in a folder: a table with its settings")]
struct Section {
    name: String,
    bus: Option<String>,
    profibus: Option<String>,
    #[serde(default)]
    slave: Vec<DpSlave>,
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
        let Section { name, bus, profibus, slave } = Section::deserialize(section)?;
        let layout = folder.registered.layout;
        Ok(Arc::new(FolderConfig {
            name,
            folder,
            dir,
            layout,
            slot: None,
            bus,
            profibus,
            slaves: slave.into(),
        }))
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
        let (layout, slaves) = (folder.registered.layout, Arc::default());
        Arc::new(FolderConfig { name, folder, dir, layout, slot, bus, profibus: None, slaves })
    }
}

impl FolderConfig {
    /// Returns the port at this medium that `device.toml` declares.
    fn port(&self, medium: &str) -> Option<&'static Port> {
        self.layout().ports.iter().find(|port| port.medium == medium)
    }

    /// Returns the name of the bus at a port.
    fn bus_at(&self, port: &Port) -> Option<&str> {
        if port.medium == can_bus::FAMILY { self.bus.as_deref() } else { self.profibus.as_deref() }
    }

    /// Checks the slaves of the PROFIBUS port.
    fn check_slaves(&self) -> Result<(), BuildError> {
        let refused =
            |reason: String| Err(BuildError::own(&self.name, "slave", format!("'{}': {reason}", self.name)));
        let Some(image) = self.folder.image.as_ref().filter(|_| self.profibus.is_some()) else {
            return if self.slaves.is_empty() {
                Ok(())
            } else {
                refused("slaves need the key profibus".to_owned())
            };
        };
        let (mut outputs, mut inputs) = (0, 0);
        for (index, slave) in self.slaves.iter().enumerate() {
            let address = slave.address;
            if address > MOST_ADDRESS || address == dp_master::ADDRESS {
                return refused(format!(
                    "slave {address}: an address is 0 to {MOST_ADDRESS}; the master has {}",
                    dp_master::ADDRESS
                ));
            }
            if self.slaves.iter().take(index).any(|other| other.address == address) {
                return refused(format!("two slaves have the address {address}"));
            }
            let [parameters, configuration] = [&slave.parameters, &slave.configuration].map(Vec::len);
            if !(7..=MOST_OCTETS).contains(&parameters) || !(1..=MOST_OCTETS).contains(&configuration) {
                return refused(format!(
                    "slave {address}: parameters has 7 to {MOST_OCTETS} bytes, and configuration 1 to {MOST_OCTETS}"
                ));
            }
            if usize::from(slave.outputs.max(slave.inputs)) > MOST_OCTETS {
                return refused(format!(
                    "slave {address}: outputs and inputs are at most {MOST_OCTETS} bytes"
                ));
            }
            (outputs, inputs) = (outputs + u32::from(slave.outputs), inputs + u32::from(slave.inputs));
        }
        let room = [image.outputs.end - image.outputs.start, image.inputs.end - image.inputs.start];
        if outputs > room[0] || inputs > room[1] {
            return refused(format!(
                "its slaves have {outputs} bytes of outputs and {inputs} of inputs; the process image has {} and {}",
                room[0], room[1]
            ));
        }
        Ok(())
    }
}

/// The debug output identifies the settings when a plant is compared with a snapshot. It contains the files
/// of the device, but not the path of the folder.
/// A key that the plant file leaves out is not in the output, so that an additional key of a later build does not
/// change it.
impl fmt::Debug for FolderConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, folder, dir: _, layout: _, slot, bus, profibus, slaves } = self;
        let mut settings = f.debug_struct(folder.registered.layout.name);
        settings.field("name", name).field("files", &folder.used);
        if let Some(Slot { controller, number, interface, trigger }) = slot {
            settings.field("option", &(controller, number, trigger));
            if let Some(interface) = interface {
                settings.field("interface", interface);
            }
        }
        if let Some(bus) = bus {
            settings.field("bus", bus);
        }
        if let Some(profibus) = profibus {
            settings.field("profibus", &(profibus, slaves));
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
        for (key, bus, medium) in
            [("bus", &self.bus, can_bus::FAMILY), ("profibus", &self.profibus, profibus_bus::FAMILY)]
        {
            if bus.is_some() && self.port(medium).is_none() {
                let reason = format!(
                    "'{}' has no port at {medium}: its {} declares no such [[port]]",
                    self.name,
                    self.dir.join("device.toml").display()
                );
                return Err(BuildError::own(&self.name, key, reason));
            }
        }
        self.check_slaves()?;
        let Some(slot) = &self.slot else { return Ok(()) };
        range("trigger", &self.name, slot.trigger.into(), 1..=2, "1 or 2")?;
        let dir = self.dir.display();
        let reason = if self.folder.script.is_none() {
            format!("{dir} has no firmware.rhai, which serves pulses")
        } else if phase::overlaid(self.folder.registered.layout).next().is_some() {
            format!("the structures of {dir} overlay each other")
        } else if let Some(port) = self.layout().ports.iter().find(|port| port.medium != can_bus::FAMILY) {
            // The section of a card has only the key for a CAN bus (D-819).
            format!(
                "{dir} has the port `{}` at {}, and a card can only have a port at {}; remove this [[port]], or describe \
                 the device in a [[device]]",
                port.name,
                port.medium,
                can_bus::FAMILY
            )
        } else {
            return Ok(());
        };
        let reason = format!("'{}' is no option card: {reason}", self.name);
        Err(BuildError::own(&self.name, "card", reason))
    }

    fn ports(&self) -> Vec<PortConfig<'_>> {
        self.layout().ports.iter().map(|port| PortConfig::of(port, self.bus_at(port))).collect()
    }

    fn card_place(&self) -> Option<CardPlace<'_>> {
        let Slot { controller, number, interface, trigger } = self.slot.as_ref()?;
        Some(CardPlace { controller, slot: *number, interface: *interface, trigger: *trigger })
    }

    fn folder(&self) -> Option<&Path> {
        Some(&self.dir)
    }

    fn has_script(&self) -> bool {
        self.folder.has_script()
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
        let link = self.layout().ports.first().map(|_| BusLink::default());
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
        let plug = |(port, link): (&'static Port, BusLink)| {
            let origin = Origin { plc: index, node: port.number };
            let (segment, layout) = (segment.clone(), self.layout());
            let socket: Box<dyn core::any::Any + Send> = match &self.folder.image {
                Some(image) if port.medium == profibus_bus::FAMILY => {
                    let port = Box::new(DpMaster::new(segment.clone(), image, Arc::clone(&self.slaves)));
                    Box::new(ProfibusSocket { origin, segment, layout, port })
                }
                _ => {
                    let port = Box::new(FolderPort::new(link, script.is_some()));
                    Box::new(CanSocket { origin, segment, layout, port })
                }
            };
            let bus = self.bus_at(port).map(str::to_owned);
            Plug { number: port.number, family: port.medium, bus, socket }
        };
        let plugs = self.layout().ports.iter().zip(core::iter::repeat_with(|| link.clone()));
        let plugs = plugs.filter_map(|(port, link)| Some((port, link?))).map(plug).collect();
        let faults = OwnFaults::new(self.folder.fault_kinds);
        let has_image = self.profibus.is_some();
        let firmware = FolderFirmware::new(parts, card, faults, Source::new(self.clone()), has_image);
        let device = Plain::new(index, &self.name, self.layout(), segment, firmware)?;
        Ok((Box::new(device), plugs))
    }
}
