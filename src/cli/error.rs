//! What a command can end with instead of success.

use super::time;
use crate::devices::demo::DemoError;
use crate::export::ExportError;
use crate::fault::FaultError;
use crate::layout::LayoutError;
use crate::layout::place::BadValue;
use crate::memory::header::BoardWordError;
use crate::memory::{MemoryError, limits};
use crate::plant::PlantError;
use crate::runtime::RuntimeError;
use commram_layoutc::import::ImportError;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a command did not do what it was asked for.
#[derive(Debug, Error)]
pub(crate) enum CliError {
    /// A register or block that does not exist.
    #[error("{0}")]
    Layout(#[from] LayoutError),
    /// An address that no device has.
    #[error(
        "`{text}` is no address of any device: {known}; W is for words, D for double words, X and .bit for bits"
    )]
    NoDeviceHas {
        /// The address as given.
        text: String,
        /// The addresses of the devices.
        known: String,
    },
    /// No such export.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// A value that the register cannot hold.
    #[error(transparent)]
    Value(#[from] BadValue),
    /// An argument in a notation of its own.
    #[error("`{text}`: {right}")]
    Argument {
        /// As given.
        text: String,
        /// What would be right.
        right: String,
    },
    /// A file with a snapshot that cannot be read, or is none, or where none can be.
    #[error("{}: {reason}", .path.display())]
    Snapshot {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A text that is no setting of a board.
    #[error(transparent)]
    Board(#[from] BoardWordError),
    /// A register without a PLC in front, and several it could be in.
    #[error("{text}: instance '{instance}' has several PLCs ({plcs}); write for example {example}:{text}")]
    WhichPlc {
        /// The register as given.
        text: String,
        /// The instance.
        instance: String,
        /// Its PLCs.
        plcs: String,
        /// One of them.
        example: String,
    },
    /// A PLC that the instance does not have.
    #[error("instance '{instance}' has no PLC '{plc}'; its PLCs are: {plcs}")]
    UnknownPlc {
        /// The PLC as given.
        plc: String,
        /// The instance.
        instance: String,
        /// Its PLCs.
        plcs: String,
    },
    /// A bus that the instance does not have.
    #[error("instance '{instance}' has no bus '{bus}'; its buses are: {buses}")]
    UnknownBus {
        /// The bus as given.
        bus: String,
        /// The instance.
        instance: String,
        /// Its buses.
        buses: String,
    },
    /// Nothing runs under this name.
    #[error("instance '{instance}' is not running; start it with `commram run -i {instance}`{running}")]
    NotRunning {
        /// The instance.
        instance: String,
        /// What does run.
        running: String,
    },
    /// Nothing runs under the name of what is to be ended.
    #[error("instance '{instance}' is not running, so there is nothing to end{running}")]
    NothingToEnd {
        /// The instance.
        instance: String,
        /// What does run.
        running: String,
    },
    /// An emulator runs, but somebody has removed its images.
    #[error(
        "instance '{instance}' runs{}, but its images were removed: nobody can attach any more; end it with \
         `commram stop -i {instance}`", .pid.map_or_else(String::new, |pid| format!(" (process {pid})"))
    )]
    NoImages {
        /// The instance.
        instance: String,
        /// The emulator's process, if it can be seen.
        pid: Option<u32>,
    },
    /// Only the remains of a killed emulator are there.
    #[error(
        "instance '{instance}' is dead, its emulator (process {pid}) was killed; start it again with \
         `commram run -i {instance}` or remove what it left with `commram stop --clean -i {instance}`"
    )]
    Dead {
        /// The instance.
        instance: String,
        /// The emulator's process.
        pid: u32,
    },
    /// Nothing like this is in the register map.
    #[error("nothing in the register map of {device} has `{text}` in its name, meaning or values{hint}")]
    NotFound {
        /// What was looked for.
        text: String,
        /// The device.
        device: &'static str,
        /// Names that may be meant.
        hint: String,
    },
    /// A register did not become what was awaited.
    #[error("{} did not become {} within {}; at {} it holds {}", .unmet.place, .unmet.wanted, time::short(*.within_us), time::seconds(*.time_us), .unmet.found)]
    NotMet {
        /// The register.
        unmet: super::wait::Unmet,
        /// How long, in emulated microseconds.
        within_us: u64,
        /// Emulated time at the end.
        time_us: u64,
    },
    /// Several conditions did not come to hold at one moment, or none of them did.
    #[error(
        "{} within {}; at {}:{}", if *.any { "none of these came to hold" } else { "these did not come to hold together" },
        time::short(*.within_us), time::seconds(*.time_us), lines(.conditions)
    )]
    NoneMet {
        /// The conditions.
        conditions: Vec<super::wait::Unmet>,
        /// Whether one of them would have been enough.
        any: bool,
        /// How long, in emulated microseconds.
        within_us: u64,
        /// Emulated time at the end.
        time_us: u64,
    },
    /// The emulator lets time pass for another client.
    #[error(
        "instance '{instance}' did not come to this within {after_ms} ms: it lets time pass for another command and is at {}{}",
        time::seconds(*.time_us), .waits_for.as_ref().map_or_else(String::new, |who| format!(", where it waits for {who}"))
    )]
    Busy {
        /// The instance.
        instance: String,
        /// How long it was waited for.
        after_ms: u128,
        /// Emulated time.
        time_us: u64,
        /// For whom emulated time waits, if it does.
        waits_for: Option<String>,
    },
    /// The emulator was asked to end and did not.
    #[error(
        "instance '{instance}'{} has not ended within {seconds} s; kill it and remove what it leaves with \
         `commram stop --clean -i {instance}`", .pid.map_or_else(String::new, |pid| format!(" (process {pid})"))
    )]
    StillThere {
        /// The instance.
        instance: String,
        /// The emulator's process, if it can be seen.
        pid: Option<u32>,
        /// How long it was waited for.
        seconds: u64,
    },
    /// An emulator has ended and lost something.
    #[error(
        "instance '{instance}' has stopped, but could not write NOVRAM: the last changes are lost; why stands in what it \
         printed, or in the file of --log"
    )]
    Unsaved {
        /// The instance.
        instance: String,
    },
    /// A fault that cannot be, or not here.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// The channel.
    #[error(transparent)]
    Client(#[from] crate::channel::ClientError),
    /// The emulator's end of the channel.
    #[error(transparent)]
    Server(#[from] crate::channel::ServerError),
    /// The image files.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The plant file.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The emulator.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// There is no way to the other federates.
    #[error(transparent)]
    Helics(#[from] crate::helics::HelicsError),
    /// There is nothing to demonstrate.
    #[error("there is no demonstration of {device}; `commram demo` shows one of another device")]
    NoDemo {
        /// The device.
        device: &'static str,
    },
    /// The demonstration fails.
    #[error("{0}")]
    Demo(String),
    /// The user does not want to wait for the end.
    #[error("interrupted")]
    Interrupted,
    /// What is wrong has been said already.
    #[error("see above")]
    Reported,
    /// The end of another process, or a signal, decides how this one ends; there is nothing more to say.
    #[error("see above")]
    Ended {
        /// The exit code.
        code: u8,
    },
    /// Wrong use has been reported already.
    #[error("see above")]
    ReportedWrongUse,
    /// A fault that cannot be read.
    #[error(transparent)]
    FaultWord(#[from] crate::fault::WordError),
    /// The emulator answers something else.
    #[error(transparent)]
    WrongReply(#[from] crate::request::WrongReply),
    /// A scenario cannot begin.
    #[error(transparent)]
    Scenario(#[from] crate::script::ScenarioError),
    /// There is no unit for other simulators of a plant.
    #[error(transparent)]
    Fmu(Box<crate::fmi::ArchiveError>),
    /// A process cannot be started or watched.
    #[error("cannot handle a process: {reason}{}", limits::named(.reason))]
    Process {
        /// What the system says.
        reason: io::Error,
    },
    /// Signals cannot be caught.
    #[error("cannot catch signals: {reason}{}", limits::named(.reason))]
    Signals {
        /// What the system says.
        reason: io::Error,
    },
    /// There is no terminal to draw on.
    #[error("`{command}` needs a terminal for its input and its output; `commram watch` needs none")]
    NoTerminal {
        /// The command.
        command: &'static str,
    },
    /// The standard output cannot be written.
    #[error("cannot write the output: {reason}; what else was asked for is done")]
    Output {
        /// What the system says.
        reason: io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {reason}{}", .path.display(), limits::named(.reason))]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// A file that was handed in cannot be read, or is none of its kind.
    #[error("cannot read {}: {reason}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Declarations that cannot be taken over into the layout.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// A layout that is wrong.
    #[error(transparent)]
    LayoutFiles(#[from] commram_layoutc::Error),
    /// The layout files are not those that this program was built from.
    #[error(
        "{} has register map 16#{found:016X}, this commram {} was built with {built}; build it again there \
         with `cargo build --release`", .dir.display(), env!("CARGO_PKG_VERSION")
    )]
    OtherLayout {
        /// The layout.
        dir: PathBuf,
        /// Its hash.
        found: u64,
        /// Those of our devices.
        built: String,
    },
    /// A file is no dump, or cannot be read.
    #[error("{name} is no dump: {reason}; `commram dump --format json` writes one")]
    NoDump {
        /// The file.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// Nobody reads the standard output any more.
    #[error("nobody reads the output")]
    BrokenPipe,
}

/// A line for each condition: what its register holds, and what it should.
fn lines(conditions: &[super::wait::Unmet]) -> String {
    let line = |it: &super::wait::Unmet| {
        let state = if it.holds { "as awaited" } else { "awaited:" };
        let wanted = if it.holds { String::new() } else { format!(" {}", it.wanted) };
        format!("\n  {} holds {}; {state}{wanted}", it.place, it.found)
    };
    conditions.iter().map(line).collect()
}

impl CliError {
    /// Whether there is nothing left to say.
    pub(crate) fn is_told(&self) -> bool {
        matches!(self, Self::Reported | Self::ReportedWrongUse | Self::Ended { .. } | Self::BrokenPipe)
    }
}

impl From<DemoError> for CliError {
    fn from(error: DemoError) -> Self {
        match error {
            DemoError::Memory(error) => error.into(),
            DemoError::Layout(error) => error.into(),
            DemoError::Output(reason) if reason.kind() == io::ErrorKind::BrokenPipe => Self::BrokenPipe,
            DemoError::Output(reason) => Self::Output { reason },
            other => Self::Demo(other.to_string()),
        }
    }
}
