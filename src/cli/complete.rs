//! Shell completion of values that come from the register map or from running emulators: registers, values,
//! instances, PLCs, buses, faults.
//!
//! A completer gets only the word under the cursor; [`mod@line`] provides the words before it.

mod line;
mod running;
mod scope;

pub(crate) use line::within;
pub(super) use line::{front_of_last, whole};
pub(super) use scope::{NamedValue, PlcScope};

use crate::plain_text::is_interpreted;
use line::words;
use running::{known_buses, known_drives, known_faults, known_parameters};

use clap_complete::engine::CompletionCandidate as Candidate;
use clap_complete::engine::{ArgValueCompleter, PathCompleter, ValueCompleter};
use std::ffi::OsStr;

/// Returns the place at which the word at the end of a text begins. Characters between words may have several bytes, such
/// as the no-break space.
pub(super) fn start_of_word(before: &str) -> usize {
    before.trim_end_matches(|letter: char| !letter.is_whitespace()).len()
}

/// Makes a completer for `#[arg(add = ...)]` from a function that lists candidates.
fn of(list: fn(&str) -> Vec<Candidate>) -> ArgValueCompleter {
    ArgValueCompleter::new(move |current: &OsStr| current.to_str().map(list).unwrap_or_default())
}

/// Completes the names of registers.
pub(crate) fn registers() -> ArgValueCompleter {
    of(|current| registers_with(current, ""))
}

/// Completes registers and blocks.
pub(crate) fn blocks() -> ArgValueCompleter {
    of(|current| blocks_of(&PlcScope::load(), current))
}

/// Completes registers and blocks of the plant that the command line names.
pub(crate) fn blocks_of_plant() -> ArgValueCompleter {
    of(|current| blocks_of(&PlcScope::of_plant_file(), current))
}

fn blocks_of(scope: &PlcScope, current: &str) -> Vec<Candidate> {
    let all = scope.registers(current, "").into_iter().chain(scope.areas(current, ""));
    all.map(|(name, help)| candidate(name, help)).collect()
}

/// Completes the areas of a device.
pub(crate) fn areas() -> ArgValueCompleter {
    of(|current| {
        PlcScope::load().areas(current, "").into_iter().map(|(name, help)| candidate(name, help)).collect()
    })
}

/// Completes arguments of the form `REG=VALUE`.
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
    of(|current| starting(current, PlcScope::load().plcs().map(|(name, _)| (name.to_owned(), String::new()))))
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
        let own = scene.plcs().flat_map(|(_, fitted)| fitted.device().front.iter());
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
    of(|current| starting(current, PlcScope::load().fault_fields(current, &words(), known_buses)))
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
    ArgValueCompleter::new(move |current: &OsStr| readable(&PathCompleter::any().filter(has_ending), current))
}

/// Completes files and directories.
pub(crate) fn any_files() -> ArgValueCompleter {
    ArgValueCompleter::new(|current: &OsStr| readable(&PathCompleter::any(), current))
}

/// Returns the candidates without names that contain characters which a terminal interprets, or a shell reads as the
/// end of a candidate.
fn readable(paths: &PathCompleter, current: &OsStr) -> Vec<Candidate> {
    let mut found = paths.complete(current);
    found.retain(|it| !it.get_value().to_string_lossy().contains(is_interpreted));
    found
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

/// Returns names of registers that begin with `current`; incomplete names can be continued.
pub(crate) fn register_names(current: &str) -> Vec<String> {
    PlcScope::load().registers(current, "").into_iter().map(|(name, _)| name).collect()
}

/// Completes register names step by step; `suffix` follows a complete name.
fn registers_with(current: &str, suffix: &str) -> Vec<Candidate> {
    let found = PlcScope::load().registers(current, suffix).into_iter();
    found.map(|(name, help)| candidate(name, help)).collect()
}

/// Completes the value of a register if the text before the cursor is a register and one of these operators.
fn values_of(current: &str, signs: &[&str]) -> Option<Vec<Candidate>> {
    let (register, front) = signs.iter().find_map(|sign| {
        let (register, _) = current.split_once(sign)?;
        Some((register, format!("{register}{sign}")))
    })?;
    let named = PlcScope::load().values(register).into_iter().filter(|value| !value.name.contains(' '));
    Some(starting(current, named.map(|value| (format!("{front}{}", value.name), value.meaning))))
}
