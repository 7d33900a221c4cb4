//! The plant file: PLCs, buses and drives.

mod cards;
mod checks;
mod doubts;
mod error;
mod file;
mod folders;
mod keys;
mod places;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod times_tests;

pub use error::PlantError;

use crate::can;
use crate::can::Message;
use crate::devices;
use crate::devices::{BusSection, DeviceConfig, PortConfig, settings_number};
use crate::fault::{DeviceSite, Fault, FaultError, FaultKind, FaultSpec, MAX_FAULTS, Refusal, Sites};
use crate::identity::BusIndex;
use crate::input_file;
use crate::journal::Names;
use crate::layout::DeviceFit;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// Maximum number of PLCs, and of buses: records of the journal have 16 bits for each number.
const MOST: usize = u16::MAX as usize;

/// The plant that runs without a file.
const BUILT_IN: &str = include_str!("built_in.toml");

/// A plant, as described by a plant file (TOML). See `docs/reference/plant.md`.
#[derive(Clone, Debug)]
pub struct PlantConfig {
    /// Interval at which the firmware polls registers that no doorbell announces, in emulated microseconds (10..=10000,
    /// default 500; decision D-22).
    pub processor_cycle_us: u32,
    /// Devices of the plant, at least one: first each `[[plc]]`, then each `[[device]]`.
    pub devices: Vec<Arc<dyn DeviceConfig>>,
    /// Sections of the buses, in the order of the plant file.
    pub buses: Vec<Arc<dyn BusSection>>,
    /// Faults of the plant. Each is active from power-on or from a given time; see
    /// `docs/reference/faults.md`.
    pub faults: Vec<FaultSpec>,
    /// The text of the plant file, in which the paths of device folders are absolute.
    text: Arc<str>,
}

impl PlantConfig {
    /// Returns the built-in plant: PLC `line`, its node 2 master of three drives with slave numbers 1, 2, 3 at
    /// 500 kbit/s.
    pub fn built_in() -> Result<Self, PlantError> {
        Self::parse("built-in plant", BUILT_IN)
    }

    /// Reads and checks a plant file.
    ///
    /// # Errors
    /// [`PlantError`] with the wrong entry and a correct value.
    pub fn load(path: &Path) -> Result<Self, PlantError> {
        let text = input_file::read(path, input_file::LONGEST_PLANT)
            .map_err(|source| PlantError::Read { path: path.to_owned(), source })?;
        Self::parse_from(path.parent().unwrap_or(Path::new("")), &path.display().to_string(), &text)
    }

    /// Parses and checks the text of a plant file. `file` is the name of the file for messages. Relative paths of
    /// device folders begin at the working directory.
    ///
    /// # Errors
    /// [`PlantError`] with the wrong entry and a correct value.
    pub fn parse(file: &str, text: &str) -> Result<Self, PlantError> {
        Self::parse_from(Path::new(""), file, text)
    }

    /// Parses a plant like [`PlantConfig::parse`]. Relative paths of device folders begin at `base`.
    pub(crate) fn parse_from(base: &Path, file: &str, text: &str) -> Result<Self, PlantError> {
        let (mut config, faults) = file::read(base, file, text)?;
        config.place_cards().and_then(|()| config.check()).map_err(|error| {
            let offset = match &error {
                PlantError::Fault { number, .. } => faults.get(number - 1).copied(),
                other => places::offset_of(other, text),
            };
            let line = offset.map(|offset| file::line_of(text, offset));
            PlantError::At { file: file.to_owned(), line, source: Box::new(error) }
        })?;
        Ok(config)
    }

    /// Returns the text of the plant file, in which the paths of device folders are absolute.
    pub fn source(&self) -> &str {
        &self.text
    }

    /// Returns the text of the plant file.
    pub(crate) fn text(&self) -> &Arc<str> {
        &self.text
    }

    /// Returns the folders of the devices that have one, separated by commas.
    #[cfg(feature = "cli")]
    pub(crate) fn folders(&self) -> String {
        let folders = self.devices.iter().filter_map(|device| Some(device.folder()?.display().to_string()));
        folders.collect::<Vec<_>>().join(", ")
    }

    /// Returns numbers that distinguish plants with different settings within one version of commram: the
    /// processor cycle, then a hash for each device and for each bus. Faults are not settings.
    // The hashes are made from the debug output of the settings, which contains names of structures. So a
    // change of such a name makes a plant refuse the snapshots of earlier versions.
    pub(super) fn settings(&self) -> Arc<[u64]> {
        let PlantConfig { processor_cycle_us, devices, buses, faults: _, text: _ } = self;
        let devices = devices.iter().map(|device| settings_number(device));
        let buses = buses.iter().map(|bus| settings_number(bus));
        [u64::from(*processor_cycle_us)].into_iter().chain(devices).chain(buses).collect()
    }

    /// Returns the device with this name.
    pub fn device(&self, name: &str) -> Option<&dyn DeviceConfig> {
        self.devices.iter().find(|device| device.name() == name).map(|device| &**device)
    }

    /// Returns the faults of the file, checked.
    ///
    /// # Errors
    /// [`PlantError::Fault`] names the field and a correct value.
    pub fn resolved_faults(&self) -> Result<Vec<Fault>, PlantError> {
        let (names, sites, kinds) = (self.names(), self.sites(), self.fault_kinds());
        let resolve = |spec: &FaultSpec| {
            let fault = spec.resolve(&kinds, &names)?;
            let owner = sites.owner(&fault);
            owner.map_err(|refusal| FaultError::refused(fault.kind(), refusal, &names))?;
            Ok(fault)
        };
        let numbered = self.faults.iter().enumerate().take(MAX_FAULTS + 1);
        let faults: Vec<Fault> = numbered
            .map(|(index, spec)| {
                resolve(spec).map_err(|source| PlantError::Fault { number: index + 1, source })
            })
            .collect::<Result<_, _>>()?;
        match faults.get(MAX_FAULTS) {
            None => Ok(faults),
            Some(fault) => {
                let source = FaultError::Refused { kind: fault.kind(), refusal: Refusal::TooMany };
                Err(PlantError::Fault { number: MAX_FAULTS + 1, source })
            }
        }
    }

    /// Returns the kinds of faults that the plant can have: those of commram, then those that its devices declare.
    pub(crate) fn fault_kinds(&self) -> Vec<&'static FaultKind> {
        let mut kinds = devices::fault_kinds().to_vec();
        for kind in self.devices.iter().flat_map(|device| device.fault_kinds()) {
            // Equal kinds of different folders count separately.
            if !kinds.iter().any(|known| core::ptr::eq(*known, *kind)) {
                kinds.push(kind);
            }
        }
        kinds
    }

    /// Returns the names of the plant, as far as the file contains them.
    pub(crate) fn names(&self) -> Names {
        let fitted = |device: &dyn DeviceConfig| {
            let declarations = FaultKind::declarations_of(device.fault_kinds());
            DeviceFit::unknown(device.layout()).declaring(declarations)
        };
        Names {
            plcs: self.devices.iter().map(|device| device.name().to_owned()).collect(),
            buses: self.buses.iter().map(|bus| bus.name().to_owned()).collect(),
            devices: self.devices.iter().map(|device| fitted(&**device)).collect(),
        }
    }

    /// Returns the possible targets of faults. The numbers of participants in the plant must have been
    /// checked before.
    pub(super) fn sites(&self) -> Sites {
        let ports = self.ports_of_buses();
        let mask = |bus: &Arc<dyn BusSection>| {
            let ports = ports.get(bus.name()).map_or(&[][..], Vec::as_slice);
            let numbers = numbers_on(&**bus, ports).into_iter().map(|(_, number)| number);
            numbers.fold(0, |mask, number| mask | 1u32.checked_shl(number.into()).unwrap_or(0))
        };
        let index_of: HashMap<_, _> =
            self.buses.iter().enumerate().map(|(index, bus)| (bus.name(), index)).collect();
        let buses = self.buses.iter();
        let buses = buses.map(|bus| devices::bus_site(bus.family(), mask(bus)));
        let devices = self.devices.iter().map(|device| {
            let ports = device.ports().into_iter();
            let plugged =
                ports.filter_map(|port| Some((port.number, BusIndex::at(*index_of.get(port.bus?)?))));
            let drives = device.ports().into_iter().map(|port| port.number);
            DeviceSite {
                layout: device.layout(),
                faults: device.fault_kinds(),
                plugged: plugged.collect(),
                drives: drives.filter(|port| device.is_drive(*port)).collect(),
            }
        });
        Sites { buses: buses.collect(), devices: devices.collect() }
    }

    /// Returns the messages of a bus that its devices define before they run.
    pub fn messages(&self, bus: &str) -> Vec<Message> {
        let mut found = self.messages_of_buses(|name| name == bus);
        found.next().map(|(_, messages)| messages).unwrap_or_default()
    }

    /// Returns the selected buses, each with the messages that the devices define before they run. A plant
    /// can have many buses. So the iterator creates the messages of a bus only when it reaches the bus, and
    /// searches the devices only once.
    pub fn messages_of_buses(
        &self,
        is_selected: impl Fn(&str) -> bool,
    ) -> impl Iterator<Item = (&dyn BusSection, Vec<Message>)> {
        let mut ports: HashMap<_, Vec<_>> = HashMap::new();
        for device in &self.devices {
            for port in device.ports() {
                let Some(bus) = port.bus.filter(|bus| is_selected(bus)) else { continue };
                ports.entry(bus).or_default().push((device, port.number));
            }
        }
        let buses = self.buses.iter().filter(move |bus| is_selected(bus.name()));
        buses.map(move |bus| {
            let mut messages = bus.messages();
            for (device, port) in ports.remove(bus.name()).unwrap_or_default() {
                messages.extend(device.messages(port));
            }
            (&**bus, can::merged(messages))
        })
    }

    /// Returns the ports on each bus, by its name, each with its device's name.
    fn ports_of_buses(&self) -> BTreeMap<&str, Vec<PortOf<'_>>> {
        let mut found: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for device in &self.devices {
            for port in device.ports() {
                let Some(bus) = port.bus else { continue };
                found.entry(bus).or_default().push((device.name(), port));
            }
        }
        found
    }
}

/// A port, with its device's name.
type PortOf<'a> = (&'a str, PortConfig<'a>);

/// Returns the participants of a bus that have a number: `ports` first, then the participants that the section of the
/// bus declares. A port has the name of its device, or a name like `maxx:slotG` if several ports of the device are on
/// this bus.
fn numbers_on<'a>(bus: &'a dyn BusSection, ports: &'a [PortOf<'a>]) -> Vec<(Cow<'a, str>, u8)> {
    let mut counts: HashMap<&str, usize> = HashMap::new();
    ports.iter().for_each(|(name, _)| *counts.entry(name).or_default() += 1);
    let numbered = ports.iter().filter_map(|(name, port)| {
        let is_alone = counts.get(name).is_none_or(|count| *count == 1);
        let called = if is_alone { (*name).into() } else { format!("{name}:{}", port.name).into() };
        Some((called, port.address?))
    });
    let own = bus.participants().into_iter().map(|(name, number)| (name.into(), number));
    numbered.chain(own).collect()
}

/// Finds numbers that are used twice: the number, its first user, and its second user.
fn equal_numbers(bus: &dyn BusSection, ports: &[PortOf<'_>]) -> Vec<(u8, String, String)> {
    let mut taken: [Option<String>; 256] = [const { None }; 256];
    let before = |(name, number): (Cow<'_, str>, u8)| match &mut taken[usize::from(number)] {
        Some(first) => Some((number, first.clone(), name.into_owned())),
        free => {
            *free = Some(name.into_owned());
            None
        }
    };
    numbers_on(bus, ports).into_iter().filter_map(before).collect()
}
