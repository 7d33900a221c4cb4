//! The plant file: which PLCs, buses and drives there are.

mod doubts;
mod file;
mod places;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod times_tests;

use crate::can;
use crate::can::Message;
use crate::devices;
use crate::devices::settings::range;
use crate::devices::{BuildError, DeviceConfig, MediumConfig, PortConfig};
use crate::fault::{DeviceSite, Fault, FaultError, FaultSpec, MAX_FAULTS, Refusal, Sites};
use crate::handed_in;
use crate::journal::Names;
use crate::layout::Fitted;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;
use twox_hash::XxHash3_64;

/// PLCs, and buses: the journal's records have 16 bits for them.
const MOST: usize = u16::MAX as usize;

/// The plant that runs when no file is given.
const BUILT_IN: &str = include_str!("built_in.toml");

/// A plant, as described by a plant file (TOML). See `docs/plant.md`.
#[derive(Clone, Debug)]
pub struct PlantConfig {
    /// How often, in emulated microseconds, the firmware looks at registers that nobody rang for
    /// (10..=10000, default 500; decision D-22).
    pub processor_cycle_us: u32,
    /// The devices, one at least: first each `[[plc]]`, then each `[[device]]`.
    pub devices: Vec<Arc<dyn DeviceConfig>>,
    /// The media.
    pub media: Vec<Arc<dyn MediumConfig>>,
    /// Faults that are injected from power-on or from a time on; see `docs/faults.md`.
    pub faults: Vec<FaultSpec>,
    /// The text that all of this was made of.
    text: Arc<str>,
}

/// What can be wrong with a plant file.
#[derive(Debug, Error)]
pub enum PlantError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no plant file.
    #[error("{file}: {}{what}", in_line(*.line))]
    Syntax {
        /// The file.
        file: String,
        /// The line, from 1, if it is known.
        line: Option<usize>,
        /// What is wrong there, in one line.
        what: String,
    },
    /// Something is wrong that stands in a plant file.
    #[error("{file}: {}{source}", in_line(*.line))]
    At {
        /// The file.
        file: String,
        /// The line, from 1; none if what is wrong stands in none, because it is missing.
        line: Option<usize>,
        /// What.
        source: Box<PlantError>,
    },
    /// No PLC in the plant.
    #[error("the plant has no PLC; add a [[plc]] section with a name")]
    NoPlc,
    /// More than journal and channel have numbers for.
    #[error("the plant has {count} {what}s; there can be at most {MOST}")]
    TooMany {
        /// "PLC" or "bus".
        what: &'static str,
        /// How many there are.
        count: usize,
    },
    /// A name that cannot be used.
    #[error("{what} name '{name}': use 1 to 31 characters of A-Z, a-z, 0-9, '_' and '-'")]
    Name {
        /// "PLC", "bus" or "drive".
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A name given twice.
    #[error("there are two {what}s named '{name}'; names must be unique")]
    Duplicate {
        /// "PLC", "bus" or "drive".
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Something else where sections belong.
    #[error("{file}: line {line}: [[{name}]] begins a section; there can be several")]
    NoSection {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// The sections' name.
        name: &'static str,
    },
    /// A section of a kind that there is not.
    #[error("{file}: line {line}: there is no {what} of kind '{kind}'; kinds are: {known}")]
    Kind {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// "device" or "bus".
        what: &'static str,
        /// The kind.
        kind: String,
        /// The kinds there are.
        known: String,
    },
    /// A device refers to a bus that does not exist.
    #[error("{port} of PLC '{plc}' is on bus '{bus}', which does not exist; buses are: {known}")]
    UnknownBus {
        /// The device.
        plc: String,
        /// Its port.
        port: String,
        /// The bus it names.
        bus: String,
        /// The buses there are.
        known: String,
    },
    /// A device refers to a bus of another kind than its port is made for.
    #[error("{port} of PLC '{plc}' is on bus '{bus}' of kind '{kind}'; it needs one of kind '{right}'")]
    OtherKind {
        /// The device.
        plc: String,
        /// Its port.
        port: String,
        /// The bus it names.
        bus: String,
        /// Kind of that bus.
        kind: &'static str,
        /// Kind of the buses that it can be on.
        right: &'static str,
    },
    /// Two ports of a device on one bus.
    #[error("{first} and {second} of PLC '{plc}' are both on bus '{bus}'; a PLC takes part in a bus once")]
    BothNodes {
        /// The device.
        plc: String,
        /// A port.
        first: String,
        /// Another port.
        second: String,
        /// The bus.
        bus: String,
    },
    /// Two masters on one bus.
    #[error(
        "bus '{bus}' has two masters, {first_port} of '{first}' and {second_port} of '{second}'; a bus of its kind has one"
    )]
    TwoMasters {
        /// The bus.
        bus: String,
        /// A device.
        first: String,
        /// Its port.
        first_port: String,
        /// Another device, or the same.
        second: String,
        /// Its port.
        second_port: String,
    },
    /// Two slaves with one number.
    #[error("slave number {number} is used twice on bus '{bus}', by '{first}' and '{second}'")]
    SlaveNumber {
        /// The bus.
        bus: String,
        /// The number.
        number: u8,
        /// A participant.
        first: String,
        /// Another participant.
        second: String,
    },
    /// A device or medium cannot be built: a number out of its range, or a setting that only its owner can judge.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A fault is refused.
    #[error("[[fault]] {number}: {source}")]
    Fault {
        /// Position in the file, from 1.
        number: usize,
        /// Why.
        source: FaultError,
    },
}

impl PlantConfig {
    /// The built-in plant: PLC `line`, its node 2 master of three drives with slave numbers 1, 2, 3 at
    /// 500 kbit/s.
    pub fn built_in() -> Result<Self, PlantError> {
        Self::parse("built-in plant", BUILT_IN)
    }

    /// Reads and checks a plant file.
    ///
    /// # Errors
    /// [`PlantError`], naming the thing and what would be right.
    pub fn load(path: &Path) -> Result<Self, PlantError> {
        let text = handed_in::read(path, handed_in::LONGEST_PLANT)
            .map_err(|source| PlantError::Read { path: path.to_owned(), source })?;
        Self::parse(&path.display().to_string(), &text)
    }

    /// Parses and checks the text of a plant file; `file` is its name for messages.
    ///
    /// # Errors
    /// [`PlantError`], naming the thing and what would be right.
    pub fn parse(file: &str, text: &str) -> Result<Self, PlantError> {
        let (config, faults) = file::read(file, text)?;
        config.check().map_err(|error| {
            let offset = match &error {
                PlantError::Fault { number, .. } => faults.get(number - 1).copied(),
                other => places::offset_of(other, text),
            };
            let line = offset.map(|offset| file::line_of(text, offset));
            PlantError::At { file: file.to_owned(), line, source: Box::new(error) }
        })?;
        Ok(config)
    }

    /// The text of the plant file.
    pub fn source(&self) -> &str {
        &self.text
    }

    /// The text that it was made of.
    pub(super) fn text(&self) -> &Arc<str> {
        &self.text
    }

    /// Numbers that tell plants apart whose devices and media are set otherwise, within one version of commram: the
    /// processor cycle, then one for each device and for each medium. Faults are no settings.
    pub(super) fn settings(&self) -> Arc<[u64]> {
        let PlantConfig { processor_cycle_us, devices, media, faults: _, text: _ } = self;
        let of = |settings: &dyn core::fmt::Debug| XxHash3_64::oneshot(format!("{settings:?}").as_bytes());
        let devices = devices.iter().map(|device| of(device));
        let media = media.iter().map(|medium| of(medium));
        [u64::from(*processor_cycle_us)].into_iter().chain(devices).chain(media).collect()
    }

    /// Checks everything that a plant file can get wrong.
    ///
    /// # Errors
    /// [`PlantError`], naming the thing and what would be right.
    pub fn check(&self) -> Result<(), PlantError> {
        if self.devices.is_empty() {
            return Err(PlantError::NoPlc);
        }
        range("processor_cycle_us", "plant", self.processor_cycle_us.into(), 10..=10_000, "10 to 10000")
            .map_err(BuildError::from)?;
        for (what, count) in [("PLC", self.devices.len()), ("bus", self.media.len())] {
            if count > MOST {
                return Err(PlantError::TooMany { what, count });
            }
        }
        check_names("PLC", self.devices.iter().map(|device| device.name()))?;
        check_names("bus", self.media.iter().map(|medium| medium.name()))?;
        let participants = self.media.iter().flat_map(|medium| medium.participants());
        check_names("drive", participants.map(|(name, _)| name))?;
        let media: HashMap<_, _> = self.media.iter().map(|medium| (medium.name(), &**medium)).collect();
        for device in &self.devices {
            device.check()?;
            self.check_ports(&**device, &media)?;
        }
        for medium in &self.media {
            medium.check()?;
            for door in medium.doors() {
                devices::door_fits(medium.family(), *door)
                    .map_err(|reason| BuildError::own(medium.name(), "doors", reason))?;
            }
        }
        let ports = self.ports_of_media();
        for medium in &self.media {
            check_medium(&**medium, ports.get(medium.name()).map_or(&[], Vec::as_slice))?;
        }
        self.resolved_faults().map(|_| ())
    }

    /// The device of this name.
    pub fn device(&self, name: &str) -> Option<&dyn DeviceConfig> {
        self.devices.iter().find(|device| device.name() == name).map(|device| &**device)
    }

    /// The faults of the file, checked.
    ///
    /// # Errors
    /// [`PlantError::Fault`] names the field and what would be right.
    pub fn resolved_faults(&self) -> Result<Vec<Fault>, PlantError> {
        let (names, sites) = (self.names(), self.sites());
        let resolve = |spec: &FaultSpec| {
            let fault = spec.resolve(devices::fault_kinds(), &names)?;
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

    fn names(&self) -> Names {
        Names {
            plcs: self.devices.iter().map(|device| device.name().to_owned()).collect(),
            buses: self.media.iter().map(|medium| medium.name().to_owned()).collect(),
            devices: self.devices.iter().map(|device| Fitted::unknown(device.layout())).collect(),
        }
    }

    /// What faults can concern. Meant for a plant whose numbers have been checked.
    pub(super) fn sites(&self) -> Sites {
        let ports = self.ports_of_media();
        let mask = |medium: &Arc<dyn MediumConfig>| {
            let ports = ports.get(medium.name()).map_or(&[][..], Vec::as_slice);
            let numbers = numbers_on(&**medium, ports).map(|(_, number)| number);
            numbers.fold(0, |mask, number| mask | 1u32.checked_shl(number.into()).unwrap_or(0))
        };
        let index_of: HashMap<_, _> =
            self.media.iter().enumerate().map(|(index, medium)| (medium.name(), index)).collect();
        let media = self.media.iter();
        let media = media.map(|medium| devices::medium_site(medium.family(), mask(medium)));
        let devices = self.devices.iter().map(|device| {
            let ports = device.ports().into_iter();
            let plugged = ports.filter_map(|port| Some((port.number, *index_of.get(port.medium?)? as u16)));
            DeviceSite {
                layout: device.layout(),
                faults: devices::faults_of_device(device.layout()),
                plugged: plugged.collect(),
            }
        });
        Sites { media: media.collect(), devices: devices.collect() }
    }

    /// The messages of a bus, as far as its devices know them before they run.
    pub fn messages(&self, bus: &str) -> Vec<Message> {
        let mut messages = Vec::new();
        for device in &self.devices {
            for port in device.ports().iter().filter(|port| port.medium == Some(bus)) {
                messages.extend(device.messages(port.number));
            }
        }
        can::merged(messages)
    }

    /// The ports at each medium, by its name, each with its device's name.
    fn ports_of_media(&self) -> BTreeMap<&str, Vec<PortOf<'_>>> {
        let mut found: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for device in &self.devices {
            for port in device.ports() {
                let Some(medium) = port.medium else { continue };
                found.entry(medium).or_default().push((device.name(), port));
            }
        }
        found
    }

    fn check_ports(
        &self,
        device: &dyn DeviceConfig,
        media: &HashMap<&str, &dyn MediumConfig>,
    ) -> Result<(), PlantError> {
        let ports = device.ports();
        for (index, port) in ports.iter().enumerate() {
            let Some(bus) = port.medium else { continue };
            let plc = device.name().to_owned();
            let Some(medium) = media.get(bus) else {
                let known: Vec<&str> = self.media.iter().map(|medium| medium.name()).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                let (port, bus) = (port.name.to_owned(), bus.to_owned());
                return Err(PlantError::UnknownBus { plc, port, bus, known });
            };
            let right =
                device.layout().port_numbered(port.number).map_or(medium.family(), |port| port.medium);
            if right != medium.family() {
                let (port, bus, kind) = (port.name.to_owned(), bus.to_owned(), medium.family());
                return Err(PlantError::OtherKind { plc, port, bus, kind, right });
            }
            let mut before = ports[..index].iter().filter(|_| !medium.takes_several_of_a_device());
            if let Some(other) = before.find(|other| other.medium == port.medium) {
                if medium.has_one_master() && other.address.is_none() && port.address.is_none() {
                    let (first, second) = (plc.clone(), plc);
                    let (first_port, second_port) = (other.name.to_owned(), port.name.to_owned());
                    let bus = bus.to_owned();
                    return Err(PlantError::TwoMasters { bus, first, first_port, second, second_port });
                }
                let (first, second) = (other.name.to_owned(), port.name.to_owned());
                return Err(PlantError::BothNodes { plc, first, second, bus: bus.to_owned() });
            }
        }
        Ok(())
    }
}

/// A port, with its device's name.
type PortOf<'a> = (&'a str, PortConfig<'a>);

/// Whoever has a number on a medium: `ports` first, then participants of its own.
fn numbers_on<'a>(
    medium: &'a dyn MediumConfig,
    ports: &'a [PortOf<'a>],
) -> impl Iterator<Item = (&'a str, u8)> {
    let ports = ports.iter().filter_map(|(name, port)| port.address.map(|number| (*name, number)));
    ports.chain(medium.participants())
}

/// `line 3: `, if it is known.
fn in_line(line: Option<usize>) -> String {
    line.map_or_else(String::new, |line| format!("line {line}: "))
}

fn check_medium(medium: &dyn MediumConfig, ports: &[PortOf<'_>]) -> Result<(), PlantError> {
    let bus = || medium.name().to_owned();
    let mut masters = ports.iter().filter(|(_, port)| port.address.is_none());
    if medium.has_one_master()
        && let (Some((first, first_port)), Some((second, second_port))) = (masters.next(), masters.next())
    {
        let (first, second) = ((*first).to_owned(), (*second).to_owned());
        let (first_port, second_port) = (first_port.name.to_owned(), second_port.name.to_owned());
        return Err(PlantError::TwoMasters { bus: bus(), first, first_port, second, second_port });
    }
    let mut taken: [Option<&str>; 256] = [None; 256];
    for (name, number) in numbers_on(medium, ports) {
        if let Some(first) = taken[usize::from(number)].replace(name) {
            let (first, second) = (first.to_owned(), name.to_owned());
            return Err(PlantError::SlaveNumber { bus: bus(), number, first, second });
        }
    }
    Ok(())
}

fn check_names<'a>(what: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), PlantError> {
    let mut seen = BTreeSet::new();
    for name in names {
        if crate::memory::names::check_plc(name).is_err() {
            return Err(PlantError::Name { what, name: name.to_owned() });
        }
        if !seen.insert(name) {
            return Err(PlantError::Duplicate { what, name: name.to_owned() });
        }
    }
    Ok(())
}
