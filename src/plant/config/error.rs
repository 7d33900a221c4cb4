//! Errors in a plant file.

use super::MOST;
use crate::devices::BuildError;
use crate::devices::folder::FolderError;
use crate::fault::FaultError;
use std::path::PathBuf;
use thiserror::Error;

/// Error in a plant file.
#[derive(Debug, Error)]
pub enum PlantError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// Path of the plant file that cannot be read.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a plant file.
    #[error("{file}: {}{what}", in_line(*.line))]
    Syntax {
        /// Path of the plant file.
        file: String,
        /// Line of the error, counted from 1, if it is known.
        line: Option<usize>,
        /// Description of the error in one line.
        what: String,
    },
    /// An error at a place in a plant file.
    #[error("{file}: {}{source}", in_line(*.line))]
    At {
        /// Path of the plant file.
        file: String,
        /// Line of the error, counted from 1. `None` if the file lacks something, which has no line.
        line: Option<usize>,
        /// Error of the plant that the file describes.
        source: Box<PlantError>,
    },
    /// The plant has no PLC.
    #[error("the plant has no PLC; add a [[plc]] section with a name")]
    NoPlc,
    /// The plant has more entries of a kind than journal and channel can number.
    #[error("the plant has {count} {}; there can be at most {MOST}", several(what))]
    TooMany {
        /// Kind of the entries: "PLC" or "bus".
        what: &'static str,
        /// Number of entries in the plant.
        count: usize,
    },
    /// A name that cannot be used.
    #[error("{what} name '{name}': use 1 to 31 characters of A-Z, a-z, 0-9, '_' and '-'")]
    Name {
        /// Kind of the entry with the name: "PLC", "bus" or "drive".
        what: &'static str,
        /// Name that breaks the rules.
        name: String,
    },
    /// A name is given twice.
    #[error("there are two {} named '{name}'; names must be unique", several(what))]
    Duplicate {
        /// Kind of the entries with the name: "PLC", "bus" or "drive".
        what: &'static str,
        /// Name that two entries have.
        name: String,
    },
    /// An entry has the name of a section, but is not a section.
    #[error("{file}: line {line}: [[{name}]] begins a section; there can be several")]
    NoSection {
        /// Path of the plant file.
        file: String,
        /// Line of the entry in the plant file, from 1.
        line: usize,
        /// Name of the sections, for example `plc`.
        name: &'static str,
    },
    /// A section has an unknown kind.
    #[error("{file}: line {line}: there is no {what} of kind '{kind}'; kinds are: {known}")]
    Kind {
        /// Path of the plant file.
        file: String,
        /// Line of the key `kind` in the plant file, from 1.
        line: usize,
        /// Object that the section describes: "device", "bus" or "option card".
        what: &'static str,
        /// Kind that the section names.
        kind: String,
        /// Names of all kinds that the section can have, separated by commas.
        known: String,
    },
    /// The folder that `kind` names is not a device.
    #[error("{file}: line {line}: {source}")]
    Folder {
        /// Path of the plant file.
        file: String,
        /// Line of the key `kind` in the plant file, from 1.
        line: usize,
        /// Reason why the folder is not a device.
        source: FolderError,
    },
    /// A device refers to a bus that does not exist.
    #[error("{port} of PLC '{plc}' is on bus '{bus}', which does not exist; buses are: {known}")]
    UnknownBus {
        /// Name of the PLC that refers to the bus.
        plc: String,
        /// Name of the port that should be on the bus.
        port: String,
        /// Name of the bus in the device's section.
        bus: String,
        /// Names of all buses of the plant, separated by commas.
        known: String,
    },
    /// A device refers to a bus of a kind that its port does not fit.
    #[error("{port} of PLC '{plc}' is on bus '{bus}' of kind '{kind}'; it needs one of kind '{right}'")]
    OtherKind {
        /// Name of the PLC that refers to the bus.
        plc: String,
        /// Name of the port that should be on the bus.
        port: String,
        /// Name of the bus in the device's section.
        bus: String,
        /// Kind of the named bus.
        kind: &'static str,
        /// Kind of bus that the port needs.
        right: &'static str,
    },
    /// Two masters on one bus.
    #[error(
        "bus '{bus}' has two masters, {first_port} of '{first}' and {second_port} of '{second}'; a bus of its kind has one"
    )]
    TwoMasters {
        /// Name of the bus with two masters.
        bus: String,
        /// The device of the first port.
        first: String,
        /// Name of the first master port on the bus.
        first_port: String,
        /// The device of the second port; it may be the same device.
        second: String,
        /// Name of the second master port on the bus.
        second_port: String,
    },
    /// Two slaves with one number.
    #[error("slave number {number} is used twice on bus '{bus}', by '{first}' and '{second}'")]
    SlaveNumber {
        /// Name of the bus on which both slaves are.
        bus: String,
        /// Slave number that both slaves have.
        number: u8,
        /// Name of the first slave with the number.
        first: String,
        /// Name of the second slave with the number.
        second: String,
    },
    /// A device or bus cannot be built: a number is out of its range, or the device or bus itself has refused
    /// its settings.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A fault is refused.
    #[error("[[fault]] {number}: {source}")]
    Fault {
        /// Number of the fault in the file, from 1.
        number: usize,
        /// Reason why the fault is refused.
        source: FaultError,
    },
}

/// `line 3: `, if it is known.
fn in_line(line: Option<usize>) -> String {
    line.map_or_else(String::new, |line| format!("line {line}: "))
}

/// Returns the plural of a noun.
fn several(what: &str) -> String {
    format!("{what}{}", if what.ends_with('s') { "es" } else { "s" })
}
