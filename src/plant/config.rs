//! The plant file: which PLCs, buses and drives there are.

#[cfg(test)]
mod times_tests;

use crate::devices::cansync::drive::DriveError;
use crate::devices::cansync::medium::BusConfig;
use crate::devices::omega_drive_line_2::PlcConfig;
use crate::devices::settings::{BuildError, SettingError, range};
use crate::fault::{Fault, FaultError, FaultSpec, MAX_FAULTS, Refusal, Sites};
use crate::journal::Names;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The plant that runs when no file is given.
const BUILT_IN: &str = include_str!("built_in.toml");

/// A plant, as described by a plant file (TOML). See `docs/plant.md`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantConfig {
    /// How often, in emulated microseconds, the firmware looks at registers that nobody rang for
    /// (10..=10000, default 500; decision D-22).
    #[serde(default = "default_cycle")]
    pub processor_cycle_us: u32,
    /// The PLCs, one at least.
    #[serde(rename = "plc", default)]
    pub plcs: Vec<PlcConfig>,
    /// The CANsync buses.
    #[serde(rename = "bus", default)]
    pub buses: Vec<BusConfig>,
    /// Faults that are injected from power-on or from a time on; see `docs/faults.md`.
    #[serde(rename = "fault", default)]
    pub faults: Vec<FaultSpec>,
}

fn default_cycle() -> u32 {
    500
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
    /// The file is no plant file. The text names line and column.
    #[error("{file}: {source}")]
    Syntax {
        /// The file.
        file: String,
        /// Where and what.
        source: Box<toml::de::Error>,
    },
    /// No PLC in the plant.
    #[error("the plant has no PLC; add a [[plc]] section with a name")]
    NoPlc,
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
    /// A number out of its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A PLC refers to a bus that does not exist.
    #[error("node{node} of PLC '{plc}' is on bus '{bus}', which does not exist; buses are: {known}")]
    UnknownBus {
        /// The PLC.
        plc: String,
        /// 1 or 2.
        node: u8,
        /// The bus it names.
        bus: String,
        /// The buses there are.
        known: String,
    },
    /// Both nodes of a PLC on one bus.
    #[error(
        "node1 and node2 of PLC '{plc}' are both on bus '{bus}'; a PLC cannot be slave and master of one bus"
    )]
    BothNodes {
        /// The PLC.
        plc: String,
        /// The bus.
        bus: String,
    },
    /// Two masters on one bus.
    #[error("bus '{bus}' has two masters, node2 of '{first}' and of '{second}'; a CANsync bus has one")]
    TwoMasters {
        /// The bus.
        bus: String,
        /// A PLC.
        first: String,
        /// Another PLC.
        second: String,
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
    /// A drive's settings are refused.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// A device or medium cannot be built.
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
        let text = crate::handed_in::read(path)
            .map_err(|source| PlantError::Read { path: path.to_owned(), source })?;
        Self::parse(&path.display().to_string(), &text)
    }

    /// Parses and checks the text of a plant file; `file` is its name for messages.
    ///
    /// # Errors
    /// [`PlantError`], naming the thing and what would be right.
    pub fn parse(file: &str, text: &str) -> Result<Self, PlantError> {
        let config: PlantConfig = toml::from_str(text)
            .map_err(|source| PlantError::Syntax { file: file.to_owned(), source: Box::new(source) })?;
        config.check()?;
        Ok(config)
    }

    /// Checks everything that a plant file can get wrong, but for the drives' own settings.
    ///
    /// # Errors
    /// [`PlantError`], naming the thing and what would be right.
    pub fn check(&self) -> Result<(), PlantError> {
        if self.plcs.is_empty() {
            return Err(PlantError::NoPlc);
        }
        range("processor_cycle_us", "plant", self.processor_cycle_us.into(), 10..=10_000, "10 to 10000")?;
        check_names("PLC", self.plcs.iter().map(|plc| plc.name.as_str()))?;
        check_names("bus", self.buses.iter().map(|bus| bus.name.as_str()))?;
        check_names("drive", self.buses.iter().flat_map(|bus| &bus.drives).map(|drive| drive.name.as_str()))?;
        for plc in &self.plcs {
            plc.check()?;
            self.check_nodes(plc)?;
        }
        self.buses.iter().try_for_each(BusConfig::check)?;
        self.buses.iter().try_for_each(|bus| self.check_bus(bus))?;
        self.resolved_faults().map(|_| ())
    }

    /// How many retain flags the PLC of this name has, in bytes; 0 if there is none.
    pub fn retain_bytes(&self, plc: &str) -> u32 {
        self.plcs.iter().find(|config| config.name == plc).map_or(0, |config| config.retain_bytes)
    }

    /// The faults of the file, checked.
    ///
    /// # Errors
    /// [`PlantError::Fault`] names the field and what would be right.
    pub fn resolved_faults(&self) -> Result<Vec<Fault>, PlantError> {
        let (names, sites) = (self.names(), self.sites());
        let resolve = |spec: &FaultSpec| {
            let fault = spec.resolve(&names)?;
            fault.check(&sites).map_err(|refusal| FaultError::refused(fault.kind(), refusal, &names))?;
            Ok(fault)
        };
        let numbered = self.faults.iter().enumerate();
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
            plcs: self.plcs.iter().map(|plc| plc.name.clone()).collect(),
            buses: self.buses.iter().map(|bus| bus.name.clone()).collect(),
        }
    }

    /// What faults can concern. Meant for a plant whose numbers have been checked.
    pub(super) fn sites(&self) -> Sites {
        let bit = |number: u8| 1u32.checked_shl(number.into()).unwrap_or(0);
        let slaves = |bus: &BusConfig| {
            let nodes = self.plcs.iter().filter(|plc| plc.node1.as_ref() == Some(&bus.name));
            let drives = bus.drives.iter().map(|drive| drive.slave_number);
            nodes.map(|plc| plc.dip).chain(drives).fold(0, |mask, number| mask | bit(number))
        };
        Sites {
            slaves: self.buses.iter().map(slaves).collect(),
            nodes: self.plcs.iter().map(|plc| [plc.node1.is_some(), plc.node2.is_some()]).collect(),
        }
    }

    fn check_nodes(&self, plc: &PlcConfig) -> Result<(), PlantError> {
        for (node, name) in [(1, &plc.node1), (2, &plc.node2)] {
            if let Some(name) = name
                && !self.buses.iter().any(|bus| bus.name == *name)
            {
                let known: Vec<&str> = self.buses.iter().map(|bus| bus.name.as_str()).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                return Err(PlantError::UnknownBus { plc: plc.name.clone(), node, bus: name.clone(), known });
            }
        }
        match (&plc.node1, &plc.node2) {
            (Some(one), Some(two)) if one == two => {
                Err(PlantError::BothNodes { plc: plc.name.clone(), bus: one.clone() })
            }
            _ => Ok(()),
        }
    }

    fn check_bus(&self, bus: &BusConfig) -> Result<(), PlantError> {
        let mut masters = self.plcs.iter().filter(|plc| plc.node2.as_ref() == Some(&bus.name));
        if let (Some(first), Some(second)) = (masters.next(), masters.next()) {
            let (first, second) = (first.name.clone(), second.name.clone());
            return Err(PlantError::TwoMasters { bus: bus.name.clone(), first, second });
        }
        let nodes = self.plcs.iter().filter(|plc| plc.node1.as_ref() == Some(&bus.name));
        let slaves = nodes
            .map(|plc| (plc.dip, &plc.name))
            .chain(bus.drives.iter().map(|drive| (drive.slave_number, &drive.name)));
        let mut taken: [Option<&String>; 256] = [None; 256];
        for (number, name) in slaves {
            if let Some(first) = taken[usize::from(number)].replace(name) {
                let (first, second) = (first.clone(), name.clone());
                return Err(PlantError::SlaveNumber { bus: bus.name.clone(), number, first, second });
            }
        }
        Ok(())
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_plant_is_a_good_one() {
        let plant = PlantConfig::built_in().unwrap();
        let numbers: Vec<u8> = plant.buses[0].drives.iter().map(|drive| drive.slave_number).collect();
        assert_eq!((plant.plcs.len(), numbers), (1, vec![1, 2, 3]));
    }

    #[test]
    fn the_documented_plant_file_is_a_good_one() {
        let text = include_str!("../../docs/plant.md");
        let example = text.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
        let plant = PlantConfig::parse("docs/plant.md", example).unwrap();
        assert_eq!(plant.buses[1].drives[0].name, "winder");
        assert!(crate::devices::cansync::drive::Drive::new(&plant.buses[1].drives[0], 250).is_ok());
    }

    #[test]
    fn each_mistake_is_named() {
        let drive =
            |name: &str, number: u8| format!("[[bus.drive]]\nname = '{name}'\nslave_number = {number}\n");
        let bus = "[[bus]]\nname = 'b'\n";
        let plc = "[[plc]]\nname = 'p'\n";
        let cases = [
            (String::new(), "the plant has no PLC"),
            ("[[plc]]\nname = 'a b'\n".into(), "PLC name 'a b': use 1 to 31 characters"),
            (format!("{plc}{plc}"), "there are two PLCs named 'p'"),
            (format!("{plc}dip = 32\n"), "dip of 'p' is 32; it must be 0 to 31"),
            (format!("{plc}option_sync_us = 49\n"), "option_sync_us of 'p' is 49; it must be 50 to 1000000"),
            (
                format!("{plc}retain_bytes = 71812\n"),
                "retain_bytes of 'p' is 71812; it must be 4 to 71808 and divisible by 4",
            ),
            (format!("{plc}retain_bytes = 6\n"), "retain_bytes of 'p' is 6; it must be 4 to 71808"),
            (format!("{plc}ethernet_mbit = 1\n"), "ethernet_mbit of 'p' is 1; it must be 100, 10 or 0"),
            (
                format!("{plc}node2 = 'x'\n{bus}"),
                "node2 of PLC 'p' is on bus 'x', which does not exist; buses are: b",
            ),
            (
                format!("{plc}node1 = 'b'\nnode2 = 'b'\n{bus}"),
                "node1 and node2 of PLC 'p' are both on bus 'b'",
            ),
            (
                format!("{plc}node2 = 'b'\n[[plc]]\nname = 'q'\nnode2 = 'b'\n{bus}"),
                "bus 'b' has two masters, node2 of 'p' and of 'q'",
            ),
            (
                format!("{plc}{bus}{}{}", drive("d", 4), drive("e", 4)),
                "slave number 4 is used twice on bus 'b', by 'd' and 'e'",
            ),
            (
                format!("{plc}dip = 4\nnode1 = 'b'\n{bus}{}", drive("d", 4)),
                "slave number 4 is used twice on bus 'b', by 'p' and 'd'",
            ),
            (format!("{plc}{bus}kbit_s = 1000\n"), "kbit_s of 'b' is 1000; it must be 500, 250 or 125"),
            (
                format!("{plc}{bus}frame_length = 'long'\n"),
                "unknown variant `long`, expected `fixed` or `variable`",
            ),
            (
                format!("processor_cycle_us = 5\n{plc}"),
                "processor_cycle_us of 'plant' is 5; it must be 10 to 10000",
            ),
            (format!("{plc}colour = 1\n"), "test.toml: TOML parse error at line 3, column 1"),
        ];
        for (text, expected) in cases {
            let message = PlantConfig::parse("test.toml", &text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}\n{message}\nlacks: {expected}");
        }
    }
}
