//! The PLCs that register names can refer to, and the names that match the typed text, for shells and for editors.

use super::line::{instance, option, words};
use crate::cli::device::named;
use crate::cli::session::Session;
use crate::devices;
use crate::fault::{FaultKind, Field, Form};
use crate::identity::DeviceIndex;
use crate::journal::Names;
use crate::layout::{AreaOrRegisters, DeviceFit, Fit, RegisterRef, split_plc, value};
use crate::plant::PlantConfig;
use std::collections::BTreeMap;
use std::path::Path;

/// The PLCs that register names can refer to.
pub(in crate::cli) struct PlcScope {
    /// The PLCs of the instance; if no instance runs, one entry without a name for the default device.
    plcs: Vec<(String, DeviceFit)>,
}

/// A value of a register with a name.
pub(in crate::cli) struct NamedValue {
    /// Name of the candidate; it may contain blanks.
    pub name: String,
    /// The bits of the value.
    pub bits: u32,
    /// The value with its meaning.
    pub meaning: String,
    /// The number of the bit, if the name is that of a bit and not of a value.
    pub bit: Option<u32>,
}

impl PlcScope {
    /// Returns the device that the command line names by `--device`, otherwise the PLCs of its instance. If no instance
    /// runs, returns the default device.
    pub(super) fn load() -> Self {
        if let Some(device) = option(&["--device"]).and_then(|name| named(&name)) {
            return Self { plcs: vec![(String::new(), DeviceFit::unknown(device))] };
        }
        if let Some(session) = Session::glance(&instance()) {
            let plcs = DeviceIndex::enumerate(session.plcs())
                .map(|(number, name)| (name.clone(), session.fitted(number)));
            return Self { plcs: plcs.collect() };
        }
        Self::of_default_device()
    }

    /// Returns the PLCs of the plant file that the command line names. If it names none, returns the default device.
    pub(super) fn of_plant_file() -> Self {
        let words = words();
        let files =
            words.iter().map(Path::new).filter(|word| word.extension().is_some_and(|it| it == "toml"));
        // The command line may also name a file of a federation.
        let plant = files.into_iter().find_map(|path| PlantConfig::load(path).ok());
        plant.map_or_else(Self::of_default_device, |plant| Self::of(&plant.names()))
    }

    fn of_default_device() -> Self {
        Self { plcs: vec![(String::new(), DeviceFit::unknown(devices::default().layout))] }
    }

    /// Returns the PLCs of a plant.
    pub(in crate::cli) fn of(names: &Names) -> Self {
        Self { plcs: names.plcs.iter().cloned().zip(names.devices.iter().copied()).collect() }
    }

    /// Returns the PLCs with their devices.
    pub(in crate::cli) fn plcs(&self) -> impl Iterator<Item = (&str, &DeviceFit)> {
        self.plcs.iter().map(|(name, fitted)| (name.as_str(), fitted))
    }

    /// Prefixes of register names: an empty one for a single PLC, otherwise one for each PLC.
    pub(super) fn prefixes(&self, current: &str) -> Vec<String> {
        match self.plcs.as_slice() {
            [(name, _)] => vec![if current.contains(':') { format!("{name}:") } else { String::new() }],
            several => several.iter().map(|(name, _)| format!("{name}:")).collect(),
        }
    }

    /// Returns the PLCs that match the start of `current`, each with its prefix.
    pub(in crate::cli) fn each(&self, current: &str) -> Vec<(String, DeviceFit)> {
        let named = split_plc(current).0;
        let prefix = named.map(|plc| format!("{plc}:")).unwrap_or_default();
        if let Some((_, fitted)) = self.plcs.iter().find(|(name, _)| Some(name.as_str()) == named) {
            return vec![(prefix, *fitted)];
        }
        match self.plcs.as_slice() {
            [(_, fitted)] => vec![(prefix, *fitted)],
            several => several.iter().map(|(name, fitted)| (format!("{name}:"), *fitted)).collect(),
        }
    }

    /// Returns areas with their prefix and description; the declared variables of an area if its name is typed.
    /// `suffix` follows a complete name.
    pub(in crate::cli) fn areas(&self, current: &str, suffix: &str) -> Vec<(String, String)> {
        let mut all = Vec::new();
        for (prefix, fitted) in self.each(current) {
            for area in fitted.device().named_areas().filter(|area| fitted.area(area) != Fit::Empty) {
                let mut add = |name: &str| all.push((format!("{prefix}{name}{suffix}"), area.doc.to_owned()));
                add(area.name);
                if split_plc(current).1.starts_with('_') {
                    fitted.placed(area).for_each(|placed| add(placed.variable));
                }
            }
        }
        all.retain(|(name, _)| name.starts_with(current));
        all
    }

    /// Returns names of registers step by step, with their descriptions: the area, then the register, then each index.
    /// `suffix` follows a complete name.
    pub(in crate::cli) fn registers(&self, current: &str, suffix: &str) -> Vec<(String, String)> {
        let (_, name) = split_plc(current);
        let Some((front, _)) = name.split_once('.') else { return self.areas(current, ".") };
        // Keeps the order of the map.
        let mut names: Vec<String> = Vec::new();
        let mut known: BTreeMap<String, String> = BTreeMap::new();
        for (prefix, fitted) in self.each(current) {
            for register in registers_of(&fitted, front) {
                let full = format!("{prefix}{front}.{}", register.path());
                let Some(rest) = full.strip_prefix(current) else { continue };
                // Completes one index at a time.
                let end = rest.find('[').map(|at| at + 1).filter(|_| !current.ends_with('['));
                let end = end.or_else(|| rest.find(']').map(|at| at + 1));
                let name = match end {
                    Some(end) if current.len() + end < full.len() || full.ends_with('[') => {
                        full[..current.len() + end].to_owned()
                    }
                    _ => full + suffix,
                };
                if !known.contains_key(&name) {
                    known.insert(name.clone(), register.register.doc.to_owned());
                    names.push(name);
                }
            }
        }
        let described = |name: String| {
            let help = known.remove(&name).unwrap_or_default();
            (name, help)
        };
        names.into_iter().map(described).collect()
    }

    /// Returns the values of a register that have names.
    pub(in crate::cli) fn values(&self, register: &str) -> Vec<NamedValue> {
        let (_, name) = split_plc(register);
        let found = self.each(register).into_iter();
        let found = found.filter_map(|(_, fitted)| fitted.register(name.trim()).ok()).next();
        let Some((meaning, found)) = found.and_then(|found| Some((found.register.meaning?, found))) else {
            return Vec::new();
        };
        let named = value::names(meaning).into_iter();
        let is_value = |name: &str, bits: u32| {
            let mut same =
                meaning.values.iter().filter(|value| value.first == bits && value.first == value.last);
            same.any(|value| [value.id, value.text].iter().any(|text| text.eq_ignore_ascii_case(name)))
        };
        let with_bit = named.map(|(name, bits)| {
            let bit = (!is_value(&name, bits)).then(|| bits.trailing_zeros());
            NamedValue { meaning: found.decode(bits), name, bits, bit }
        });
        with_bit.collect()
    }

    /// Returns the fields that belong to the kind of fault among `words` and are not given yet, as `NAME=`. After `=`,
    /// returns the values of the field. Each candidate has a description, which may be empty.
    pub(in crate::cli) fn fault_fields(
        &self,
        current: &str,
        words: &[String],
        buses: impl Fn() -> Vec<String>,
    ) -> Vec<(String, String)> {
        let named = |word: &String| {
            let mut kinds = devices::emulation::catalogue::known_fault_kinds().into_iter();
            kinds.rfind(|kind: &&'static FaultKind| kind.name() == word.replace('-', "_"))
        };
        let Some(kind) = words.iter().find_map(named) else { return Vec::new() };
        let is_it = |field: &Field, name: &str| field.name() == name || field.other_name() == Some(name);
        if let Some((name, _)) = current.split_once('=') {
            let field = kind.all_fields().find(|field| is_it(field, name));
            let values = field.map(|field| self.field_values(field, buses)).unwrap_or_default();
            return values.into_iter().map(|value| (format!("{name}={value}"), String::new())).collect();
        }
        let is_given = |field: &Field| {
            words.iter().any(|word| word.split_once('=').is_some_and(|(name, _)| is_it(field, name)))
        };
        let left = kind.usable_fields().filter(|field| !is_given(field));
        left.map(|field| (format!("{}=", field.name()), field.about().to_owned())).collect()
    }

    /// Returns the values of a field, if the values have names.
    fn field_values(&self, field: &Field, buses: impl Fn() -> Vec<String>) -> Vec<String> {
        match field.form() {
            Form::Word(words) => words.iter().map(|word| (*word).to_owned()).collect(),
            Form::Name if field.name() == "bus" => buses(),
            Form::Name => self.plcs.iter().map(|(name, _)| name.clone()).collect(),
            Form::Port => {
                let ports = self.plcs.iter().flat_map(|(_, fitted)| fitted.device().ports);
                let mut ports: Vec<_> = ports.map(|port| port.name.to_owned()).collect();
                ports.dedup();
                ports
            }
            _ => Vec::new(),
        }
    }
}

fn registers_of(fitted: &DeviceFit, front: &str) -> Vec<RegisterRef> {
    match fitted.area_or_registers(front) {
        Ok(AreaOrRegisters::Area(area)) => {
            fitted.placed(area).flat_map(|placed| area.registers_of(placed)).collect()
        }
        Ok(AreaOrRegisters::Registers(registers)) => registers,
        Err(_) => Vec::new(),
    }
}
