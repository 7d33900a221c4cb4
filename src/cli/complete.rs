//! Shell completion of values that come from the register map or from running emulators: registers, values,
//! instances, PLCs, buses, faults.
//!
//! A completer gets only the word under the cursor; [`mod@line`] provides the words before it.

mod line;
mod running;

pub(crate) use line::within;
pub(super) use line::{front_of_last, whole};

use line::{instance, option, words};
use running::{known_buses, known_drives, known_faults, known_parameters};

use super::session::Session;
use crate::devices;
use crate::fault::{FaultKind, Field, Form};
use crate::identity::DeviceIndex;
use crate::layout::{AreaOrRegisters, DeviceFit, DeviceLayout, Fit, RegisterRef, split_plc, value};
use clap_complete::engine::CompletionCandidate as Candidate;
use clap_complete::engine::{ArgValueCompleter, PathCompleter, ValueCompleter};
use std::collections::BTreeMap;
use std::ffi::OsStr;

/// Makes a completer for `#[arg(add = ...)]` from a function that lists candidates.
fn of(list: fn(&str) -> Vec<Candidate>) -> ArgValueCompleter {
    ArgValueCompleter::new(move |current: &OsStr| current.to_str().map(list).unwrap_or_default())
}

/// Completes registers.
pub(crate) fn registers() -> ArgValueCompleter {
    of(|current| registers_with(current, ""))
}

/// Completes registers and blocks.
pub(crate) fn blocks() -> ArgValueCompleter {
    of(|current| {
        let mut all = registers_with(current, "");
        all.extend(areas(current, "").into_iter().map(|(name, help)| candidate(name, help)));
        all
    })
}

/// Completes `REG=VALUE`.
pub(crate) fn writes() -> ArgValueCompleter {
    of(|current| values_of(current, &["="]).unwrap_or_else(|| registers_with(current, "=")))
}

/// Completes `REG==VALUE` and `REG!=VALUE`.
pub(crate) fn conditions() -> ArgValueCompleter {
    of(|current| values_of(current, &["==", "!="]).unwrap_or_else(|| registers_with(current, "==")))
}

/// Completes running and killed instances.
pub(crate) fn instances() -> ArgValueCompleter {
    of(|current| {
        let images = crate::memory::list().unwrap_or_default();
        let mut names: Vec<_> = images.into_iter().map(|image| image.instance).collect();
        names.dedup();
        starting(current, names.into_iter().map(|name| (name, String::new())))
    })
}

/// Completes the PLCs of the instance.
pub(crate) fn plcs() -> ArgValueCompleter {
    of(|current| starting(current, PlcScope::load().plcs.into_iter().map(|(name, _)| (name, String::new()))))
}

/// Completes the buses of the instance.
pub(crate) fn buses() -> ArgValueCompleter {
    of(|current| starting(current, known_buses().into_iter().map(|name| (name, String::new()))))
}

/// Completes the drives of the instance.
pub(crate) fn drives() -> ArgValueCompleter {
    of(|current| starting(current, known_drives()))
}

/// Completes the parameters of the drive that the line names before this word: `P167=`.
pub(crate) fn parameters() -> ArgValueCompleter {
    of(|current| {
        let words = words();
        let drive = (0..).zip(known_drives()).find(|(_, (name, _))| words.contains(name));
        let parameters = drive.map(|(number, _)| known_parameters(number)).unwrap_or_default();
        starting(current, parameters.into_iter().map(|(name, help)| (format!("{name}="), help)))
    })
}

/// Completes the settings of a board: `NAME=`, with the PLC in front if there are several.
pub(crate) fn settings() -> ArgValueCompleter {
    of(|current| {
        let words = [
            ("dip=", "DIP switch, 0 to 31"),
            ("leds=", "LEDs, 0 to 15"),
            ("switch=run", "switch at RUN"),
            ("switch=stop", "switch at STOP"),
            ("switch=reset", "switch at RESET"),
            ("power=on", "supply on"),
            ("power=off", "supply off"),
            ("start=cold", "cold start of the program"),
            ("start=warm", "warm start of the program"),
            ("start=hot", "hot start of the program"),
            ("start=stop", "stop of the program"),
            ("project=none", "no project"),
            ("project=boot", "boot project"),
            ("project=sent", "project that was sent"),
        ];
        let scene = PlcScope::load();
        let own = scene.plcs.iter().flat_map(|(_, fitted)| fitted.device().front.iter());
        let own = own.map(|word| (format!("{}=", word.name), "switch of the front".to_owned()));
        let all: Vec<_> =
            words.map(|(word, help)| (word.to_owned(), help.to_owned())).into_iter().chain(own).collect();
        let prefixes = scene.prefixes(current);
        let named = prefixes
            .iter()
            .flat_map(|plc| all.iter().map(move |(word, help)| (format!("{plc}{word}"), help.clone())));
        starting(current, named)
    })
}

/// Completes the fields of the kind of fault that the line names, with their known values.
pub(crate) fn fault_fields() -> ArgValueCompleter {
    of(|current| {
        let kind = words().into_iter().find_map(|word| {
            devices::fault_kinds()
                .iter()
                .copied()
                .find(|kind: &&'static FaultKind| kind.name() == word.replace('-', "_"))
        });
        let Some(kind) = kind else { return Vec::new() };
        let field_of = |name: &str| {
            kind.all_fields().find(|field| field.name() == name || field.other_name() == Some(name))
        };
        match current.split_once('=') {
            Some((name, _)) => {
                let values = field_of(name).map(values_of_field).unwrap_or_default();
                starting(current, values.into_iter().map(|value| (format!("{name}={value}"), String::new())))
            }
            None => {
                let words = words();
                let given = |field: &Field| {
                    let is_it = |name: &str| field.name() == name || field.other_name() == Some(name);
                    words.iter().any(|word| word.split_once('=').is_some_and(|(name, _)| is_it(name)))
                };
                let left = kind.all_fields().filter(|field| !given(field));
                starting(current, left.map(|field| (format!("{}=", field.name()), field.about().to_owned())))
            }
        }
    })
}

/// Completes the numbers of pending and active faults.
pub(crate) fn fault_numbers() -> ArgValueCompleter {
    of(|current| {
        let words = words();
        let left = known_faults().into_iter().filter(|(number, _)| !words.contains(number));
        starting(current, left)
    })
}

/// Completes files with one of these extensions, and directories.
pub(crate) fn files(endings: &'static [&'static str]) -> ArgValueCompleter {
    let has_ending = move |path: &std::path::Path| {
        path.extension().is_some_and(|found| endings.iter().any(|ending| found == *ending))
    };
    ArgValueCompleter::new(move |current: &OsStr| PathCompleter::any().filter(has_ending).complete(current))
}

/// Returns the values of a field, if they are names.
fn values_of_field(field: &Field) -> Vec<String> {
    match field.form() {
        Form::Word(words) => words.iter().map(|word| (*word).to_owned()).collect(),
        Form::Name if field.name() == "bus" => known_buses(),
        Form::Name => PlcScope::load().plcs.into_iter().map(|(name, _)| name).collect(),
        Form::Port => {
            let scene = PlcScope::load();
            let mut ports: Vec<_> = scene
                .plcs
                .iter()
                .flat_map(|(_, fitted)| fitted.device().ports)
                .map(|port| port.name.to_owned())
                .collect();
            ports.dedup();
            ports
        }
        _ => Vec::new(),
    }
}

fn candidate(name: String, help: String) -> Candidate {
    let first = help.lines().next().unwrap_or_default();
    Candidate::new(name).help((!first.is_empty()).then(|| first.to_owned().into()))
}

fn starting(current: &str, all: impl IntoIterator<Item = (String, String)>) -> Vec<Candidate> {
    all.into_iter()
        .filter(|(name, _)| name.starts_with(current))
        .map(|(name, help)| candidate(name, help))
        .collect()
}

/// The PLCs that register names can refer to.
struct PlcScope {
    /// The PLCs of the instance; if no instance runs, one entry without a name for the default device.
    plcs: Vec<(String, DeviceFit)>,
}

impl PlcScope {
    fn load() -> Self {
        if let Some(session) = Session::glance(&instance()) {
            let plcs = DeviceIndex::enumerate(session.plcs())
                .map(|(number, name)| (name.clone(), session.fitted(number)));
            return Self { plcs: plcs.collect() };
        }
        let named = option(&["--device"]);
        let device: &'static DeviceLayout =
            named.and_then(|name| devices::find(&name)).unwrap_or_else(devices::default).layout;
        Self { plcs: vec![(String::new(), DeviceFit::unknown(device))] }
    }

    /// Prefixes of register names: empty for a single PLC, else one for each PLC.
    fn prefixes(&self, current: &str) -> Vec<String> {
        match self.plcs.as_slice() {
            [(name, _)] => vec![if current.contains(':') { format!("{name}:") } else { String::new() }],
            several => several.iter().map(|(name, _)| format!("{name}:")).collect(),
        }
    }

    /// The PLCs that match the start of `current`, each with its prefix.
    fn each(&self, current: &str) -> Vec<(String, DeviceFit)> {
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
}

/// Areas with their prefix; the declared variables of an area if its name is typed. `suffix` follows a complete
/// name.
fn areas(current: &str, suffix: &str) -> Vec<(String, String)> {
    let mut all = Vec::new();
    for (prefix, fitted) in PlcScope::load().each(current) {
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

/// Completes register names step by step: the area, then the register, then each index. `suffix` follows a complete
/// name.
fn registers_with(current: &str, suffix: &str) -> Vec<Candidate> {
    let (_, name) = split_plc(current);
    let Some((front, _)) = name.split_once('.') else {
        return areas(current, ".").into_iter().map(|(name, help)| candidate(name, help)).collect();
    };
    // Keeps the order of the map.
    let mut names: Vec<String> = Vec::new();
    let mut known: BTreeMap<String, String> = BTreeMap::new();
    for (prefix, fitted) in PlcScope::load().each(current) {
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
    names
        .into_iter()
        .map(|name| (known.remove(&name).unwrap_or_default(), name))
        .map(|(help, name)| candidate(name, help))
        .collect()
}

/// Names of registers that begin with `current`; incomplete names can be continued.
pub(crate) fn register_names(current: &str) -> Vec<String> {
    let name = |candidate: Candidate| candidate.get_value().to_string_lossy().into_owned();
    registers_with(current, "").into_iter().map(name).collect()
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

/// Completes the values of a register if one of these operators precedes the cursor.
fn values_of(current: &str, signs: &[&str]) -> Option<Vec<Candidate>> {
    let (register, front) = signs.iter().find_map(|sign| {
        let (register, _) = current.split_once(sign)?;
        Some((register, format!("{register}{sign}")))
    })?;
    let (_, name) = split_plc(register);
    let found = PlcScope::load().each(register).into_iter();
    let found = found.filter_map(|(_, fitted)| fitted.register(name.trim()).ok()).next();
    let names = found.and_then(|found| Some((found.register.meaning?, found)));
    let named = names.into_iter().flat_map(|(meaning, found)| {
        let names = value::names(meaning).into_iter().filter(|(name, _)| !name.contains(' '));
        names.map(move |(name, value)| (name, found.decode(value)))
    });
    Some(starting(current, named.map(|(name, help)| (format!("{front}{name}"), help))))
}
