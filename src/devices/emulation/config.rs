//! Interfaces for the sections of devices and buses in the plant file. The plant uses these functions. The
//! device or bus itself reads the keys of its section.

use super::catalogue::faults_of_device;
use super::{BuildError, Bus, Device, OptionInterface, Plug};
use crate::can;
use crate::can::Message;
use crate::door::{DoorSpec, TrafficKind};
use crate::fault;
use crate::fault::{Fault, FaultKind};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{EventKind, Rule};
use crate::layout;
use crate::memory::Segment;
use core::any::Any;
use core::fmt;
use std::path::Path;
use std::sync::Arc;
use toml::de::{Error, ValueDeserializer};
use twox_hash::XxHash3_64;

/// A device as the plant file describes it.
pub trait DeviceConfig: fmt::Debug + Send + Sync {
    /// Returns the name of the device, unique among the devices.
    fn name(&self) -> &str;

    /// Layout of the device.
    fn layout(&self) -> &'static layout::DeviceLayout;

    /// Checks the settings.
    ///
    /// # Errors
    /// [`BuildError::Setting`] names the key and a correct value, [`BuildError::Own`] the part of the device.
    fn check(&self) -> Result<(), BuildError> {
        Ok(())
    }

    /// Settings that are allowed but are probably a mistake, if the device itself can detect this.
    fn doubts(&self) -> Vec<Doubt> {
        Vec::new()
    }

    /// Kinds of faults that the device or its ports can have.
    fn fault_kinds(&self) -> &'static [&'static FaultKind] {
        faults_of_device(self.layout())
    }

    /// Ports of the device, connected or not.
    fn ports(&self) -> Vec<PortConfig<'_>> {
        Vec::new()
    }

    /// True if `port` is a drive on its bus. The running device has the corresponding function
    /// [`DeviceView::is_drive`](super::DeviceView::is_drive).
    fn is_drive(&self, port: PortNumber) -> bool {
        let _ = port;
        false
    }

    /// Rates that the device supports at this port, in kbit/s. Empty if the device accepts any rate, or if
    /// the bus has no rate.
    fn kbit_s(&self, port: PortNumber) -> Vec<u16> {
        let _ = port;
        Vec::new()
    }

    /// Returns the frames that the device, with its program at delivery, sends and receives at this port.
    /// Only frames that are known before the device runs are included.
    fn messages(&self, port: PortNumber) -> Vec<Message> {
        let _ = port;
        Vec::new()
    }

    /// Returns the size of the retain flags, in bytes.
    fn retain_bytes(&self) -> u32 {
        0
    }

    /// Returns the area that NOVRAM stores. Its first structure contains the stored registers. `None` if the
    /// device has no NOVRAM registers. [`Device::novram`] returns the stored part.
    fn novram(&self) -> Option<&'static layout::Area> {
        None
    }

    /// Returns the number of slots for option cards; the slots are numbered from 1.
    fn card_slots(&self) -> u8 {
        0
    }

    /// If the device is an option card, returns its slot in a controller.
    fn card_place(&self) -> Option<CardPlace<'_>> {
        None
    }

    /// Returns the folder with the files of the device. `None` if the device is a part of the program.
    fn folder(&self) -> Option<&Path> {
        None
    }

    /// True if the device runs a script from its folder.
    fn has_script(&self) -> bool {
        false
    }

    /// Returns the same device with another layout: a controller whose memory also has the registers of its option cards, or
    /// a card that has only its front panel in its image. `None` if the device keeps its layout.
    fn with_layout(&self, layout: &'static layout::DeviceLayout) -> Option<Arc<dyn DeviceConfig>> {
        let _ = layout;
        None
    }

    /// Builds device number `index` of the plant in this image, and its ports. The ports are not connected
    /// yet.
    ///
    /// # Errors
    /// [`BuildError`]: the image is too small or read-only, or the settings are refused.
    fn build(&self, index: DeviceIndex, segment: Segment)
    -> Result<(Box<dyn Device>, Vec<Plug>), BuildError>;

    /// Builds the device like [`DeviceConfig::build`], as an option card with its registers in the image of its controller.
    ///
    /// # Errors
    /// Returns the errors of [`DeviceConfig::build`].
    fn build_card(
        &self,
        index: DeviceIndex,
        segment: Segment,
        memory: CardMemory,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let _ = memory;
        self.build(index, segment)
    }
}

/// Returns a number that distinguishes different settings of a device or bus within one version of commram.
#[must_use]
pub fn settings_number(settings: &dyn fmt::Debug) -> u64 {
    XxHash3_64::oneshot(format!("{settings:?}").as_bytes())
}

/// The slot of an option card as the plant file describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CardPlace<'a> {
    /// Name of the controller.
    pub controller: &'a str,
    /// Number of the slot, from 1.
    pub slot: u8,
    /// Number of the option interface with the registers of the card; `None` for the first interface of the slot.
    pub interface: Option<u8>,
    /// Trigger of the controller that is connected to the card: 1 or 2.
    pub trigger: u8,
}

/// The part of the image of a controller that has the registers of an option card.
#[derive(Clone)]
pub struct CardMemory {
    /// Number of the controller.
    pub controller: DeviceIndex,
    /// Image of the controller.
    pub segment: Segment,
    /// Option interface of the card.
    pub interface: OptionInterface,
}

/// A port as the plant file describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PortConfig<'a> {
    /// Number of the port in the layout, and in the journal.
    pub number: PortNumber,
    /// Name of the port in the layout.
    pub name: &'a str,
    /// Bus to which the port is connected.
    pub bus: Option<&'a str>,
    /// Number of the port on the bus. `None` if the stations of the bus have no numbers, and for a master.
    pub address: Option<u8>,
}

impl<'a> PortConfig<'a> {
    /// Describes a port of the layout that has no number on its bus.
    pub(in crate::devices) const fn of(port: &layout::Port, bus: Option<&'a str>) -> Self {
        PortConfig { number: port.number, name: port.name, bus, address: None }
    }
}

/// A bus's master as the plant file describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MasterConfig {
    /// Device and port: `line:node2`.
    pub name: String,
    /// Rates that the master supports, in kbit/s; empty if it accepts any rate.
    pub kbit_s: Vec<u16>,
}

/// A setting of a plant file that is probably a mistake. The emulator allows it, because some plants have faults on
/// purpose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Doubt {
    /// Name in the section of the plant file; for a module the name of its port, as in `maxx:slotG`.
    pub section: String,
    /// Key of the doubtful setting, if the section contains it.
    pub key: &'static str,
    /// Description of the doubtful setting, with a better setting.
    pub text: String,
}

/// A bus as the plant file describes it.
pub trait BusSection: fmt::Debug + Send + Sync {
    /// Returns the name of the bus, unique among the buses.
    fn name(&self) -> &str;

    /// Checks the settings.
    ///
    /// # Errors
    /// [`BuildError::Setting`] names the key and a correct value, [`BuildError::Own`] the participant.
    fn check(&self) -> Result<(), BuildError> {
        Ok(())
    }

    /// Settings that are allowed but are probably a mistake, if the bus has these masters.
    fn doubts(&self, masters: &[MasterConfig]) -> Vec<Doubt> {
        let _ = masters;
        Vec::new()
    }

    /// Kind of the bus, one of [`BUS_KINDS`](super::BUS_KINDS).
    fn family(&self) -> &'static str;

    /// Names and numbers of the participants that are not ports of devices.
    fn participants(&self) -> Vec<(&str, u8)> {
        Vec::new()
    }

    /// Returns the frames on the bus that do not depend on the devices.
    fn messages(&self) -> Vec<Message> {
        Vec::new()
    }

    /// Doors to the bus that are open from the start.
    fn doors(&self) -> &[DoorSpec] {
        &[]
    }

    /// True if two participants with equal numbers are an error. If false, they are only a doubt, because a
    /// device may get another number before it is switched on.
    fn refuses_equal_numbers(&self) -> bool {
        true
    }

    /// True if the bus has one master. Then only one port may have no number: the master.
    fn has_one_master(&self) -> bool {
        false
    }

    /// Builds bus number `index` of the plant, without ports.
    ///
    /// # Errors
    /// [`BuildError`]: the settings are refused.
    fn build(&self, index: BusIndex) -> Result<Box<dyn Bus>, BuildError>;
}

/// Reads a section of the plant file.
pub type Read<T> = fn(ValueDeserializer<'_>) -> Result<Arc<T>, Error>;

/// A kind of bus.
pub struct BusKind {
    /// Name of the kind. Plant files use it, and layouts use it as the family of a port.
    pub name: &'static str,
    /// Kinds of journal records of the bus.
    pub records: &'static [&'static EventKind],
    /// Rules of the access checker about the registers of its ports.
    pub rules: &'static [&'static Rule],
    /// Kinds of faults of the bus, of its participants and of its ports.
    pub faults: &'static [&'static fault::FaultKind],
    /// Checks that the bus can have a fault of one of these kinds. The error names the reason.
    pub fits: fn(&Fault) -> Result<(), String>,
    /// Reads a `[[bus]]` of this kind.
    pub read: Read<dyn BusSection>,
    /// JSON schema of the keys of the `[[bus]]` section, except `kind`. `#/definitions/name` is the schema of
    /// names. Devices can also use the definitions of this schema.
    pub schema: fn() -> serde_json::Value,
    /// Type of the messages at the doors to this bus.
    pub traffic_kind: TrafficKind,
    /// Describes the meaning of a frame on this bus for users. Empty if the users of the bus define the
    /// meaning.
    pub describe: fn(&can::Frame) -> String,
    /// Creates the placeholder bus for ports of this family that are not connected.
    pub unplugged: fn() -> Box<dyn Bus>,
    /// True if a port with this [`Plug::socket`] also works without a connection. Such a port needs a
    /// separate placeholder bus.
    pub runs_alone: fn(&dyn Any) -> bool,
}

impl fmt::Debug for BusKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BusKind").field("name", &self.name).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::STATION;

    #[derive(Debug)]
    struct Silent;

    impl DeviceConfig for Silent {
        fn name(&self) -> &str {
            "silent"
        }

        fn layout(&self) -> &'static layout::DeviceLayout {
            &STATION
        }

        fn build(&self, _: DeviceIndex, _: Segment) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
            unreachable!("it is never built")
        }
    }

    /// The default of each function is the value that [`DeviceConfig`] documents.
    #[test]
    fn device_defaults_are_empty() {
        assert!(Silent.check().is_ok() && Silent.ports().is_empty() && Silent.novram().is_none());
        assert_eq!((Silent.folder(), Silent.has_script()), (None, false));
        assert!(
            (0..8)
                .map(PortNumber)
                .all(|port| Silent.kbit_s(port).is_empty() && Silent.messages(port).is_empty())
        );
        assert_eq!((Silent.name(), Silent.layout().name, Silent.retain_bytes()), ("silent", STATION.name, 0));
    }
}
