//! Errors that end a command.

use super::exit::{self, Exit};
use super::stop::EmulatorPlace;
use super::time;
use crate::devices::emulation::demo::DemoError;
use crate::devices::folder::FolderError;
use crate::export::ExportError;
use crate::fault::FaultError;
use crate::layout::LayoutError;
use crate::layout::place::BadValue;
use crate::memory::header::BoardAssignmentError;
use crate::memory::{MemoryError, limits, room};
use crate::plant::PlantError;
use crate::runtime::RuntimeError;
use commram_layoutc::import::ImportError;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Defines the errors, each with its exit code: `Variant => Exit::X`, or `Variant(error) as error => (error)
/// exit_of(error)`.
macro_rules! errors {
    ($(
        $(#[$($attribute:tt)*])*
        $variant:ident $({ $($fields:tt)* })? $(($($tuple:tt)*))? $(as $inner:ident)? => $exit:expr,
    )*) => {
        #[derive(Debug, Error)]
        pub(crate) enum CliError {
            $(
                $(#[$($attribute)*])*
                $variant $({ $($fields)* })? $(($($tuple)*))?,
            )*
        }

        impl CliError {
            /// Returns the exit code for this error.
            pub(crate) fn exit_code(&self) -> u8 {
                match self {
                    $(Self::$variant { $(0: $inner,)? .. } => u8::from($exit),)*
                }
            }
        }
    };
}

/// Returns the usual reason of a signal, as the end of a message.
fn because(signal: i32) -> &'static str {
    if signal == signal_hook::consts::SIGKILL {
        "; the kernel kills processes when memory runs out, then `dmesg` names the process"
    } else {
        ""
    }
}

errors! {
    /// The folder is not a device.
    #[error("{0}")]
    Folder(#[from] FolderError) => Exit::WrongUse,
    /// A register or block does not exist.
    #[error("{0}")]
    Layout(#[from] LayoutError) => Exit::WrongUse,
    /// No device has this address.
    #[error(
        "`{text}` is not an address of any device: {known}; W is for words, D for double words, X and .bit for bits"
    )]
    NoDeviceHas {
        /// The address as the user wrote it.
        text: String,
        /// The addresses of the devices.
        known: String,
    } => Exit::WrongUse,
    /// The export does not exist.
    #[error("{0}")]
    Export(#[from] ExportError) => Exit::WrongUse,
    /// The register cannot hold the value.
    #[error("{0}")]
    Value(#[from] BadValue) => Exit::WrongUse,
    /// The directory for the token of `commram web` belongs to another user, or cannot be created or read.
    #[error("{reason}, so the token cannot be kept there; set XDG_RUNTIME_DIR to a directory of your own, or name a file \
        with `commram web --token-file`")]
    TokenDirectory {
        /// Path and reason.
        reason: String,
    } => Exit::NotThere,
    /// The file of `commram web --token-file` exists, and a killed server has not left it.
    #[error("{} exists, and it is not the token of a server that has ended; name a new file, or remove this one", .path.display())]
    TokenFileTaken {
        /// The file.
        path: PathBuf,
    } => Exit::NotThere,
    /// An argument is wrong, for a reason that is specific to the command.
    #[error("`{text}`: {right}")]
    Argument {
        /// The argument as the user wrote it.
        text: String,
        /// Description of the correct form.
        right: String,
    } => Exit::WrongUse,
    /// A snapshot file cannot be read, is not a snapshot, or cannot be written.
    #[error("{}: {reason}", .path.display())]
    Snapshot { path: PathBuf, reason: String } => Exit::WrongUse,
    /// An invalid setting of a board.
    #[error("{0}")]
    Board(#[from] BoardAssignmentError) => Exit::WrongUse,
    /// A register is named without its PLC, although the instance has several PLCs.
    #[error("{text}: instance '{instance}' has several PLCs ({plcs}); write for example {example}:{text}")]
    WhichPlc {
        /// The register as the user wrote it.
        text: String,
        instance: String,
        /// All PLCs of the instance.
        plcs: String,
        /// One of the PLCs.
        example: String,
    } => Exit::WrongUse,
    /// The instance does not have this PLC.
    #[error("instance '{instance}' has no PLC '{plc}'; its PLCs are: {plcs}")]
    UnknownPlc {
        /// The PLC as the user wrote it.
        plc: String,
        instance: String,
        /// All PLCs of the instance.
        plcs: String,
    } => Exit::WrongUse,
    /// The instance does not have this bus.
    #[error("instance '{instance}' has no bus '{bus}'; its buses are: {buses}")]
    UnknownBus {
        /// The bus as the user wrote it.
        bus: String,
        instance: String,
        /// All buses of the instance.
        buses: String,
    } => Exit::WrongUse,
    /// The editor sent invalid data instead of a message, or the connection failed.
    #[error("the connection to the editor: {reason}")]
    Editor { reason: io::Error } => Exit::WrongUse,
    /// The editor ended the language server without the request `shutdown`.
    #[error("the editor sent `exit` without `shutdown` before it")]
    EditorLeft => Exit::Failed,
    /// No instance of this name is running.
    #[error("instance '{instance}' is not running; start it with `commram run -i {instance}`{running}")]
    NotRunning {
        instance: String,
        /// Text with the names of the running instances.
        running: String,
    } => Exit::NotThere,
    /// The instance to be ended is not running.
    #[error("instance '{instance}' is not running, so there is nothing to end{running}")]
    NothingToEnd {
        instance: String,
        /// Text with the names of the running instances.
        running: String,
    } => Exit::NotThere,
    /// An emulator runs, but its images were removed.
    #[error(
        "instance '{instance}' runs{}, but its images were removed: no program can attach any more; end it with \
         `commram stop -i {instance}`", .pid.map_or_else(String::new, |pid| format!(" (process {pid})"))
    )]
    NoImages {
        instance: String,
        /// Process id of the emulator, if the process is visible.
        pid: Option<u32>,
    } => Exit::NotThere,
    /// An emulator runs without a channel.
    #[error(
        "instance '{instance}' runs{}, but has no channel, which this command needs; `commram peek`, `dump`, `diff` and \
         `board get` read its registers without one; to get a channel, end the emulator with `commram stop -i {instance}` \
         and start it again", .pid.map_or_else(String::new, |pid| format!(" (process {pid})"))
    )]
    NoChannel {
        instance: String,
        /// Process id of the emulator, if the process is visible.
        pid: Option<u32>,
    } => Exit::NotThere,
    /// Other users can write to the directory of the instance to be ended, and no held lock belongs to an
    /// emulator.
    #[error("{0}")]
    OpenDirectory(MemoryError) => Exit::Failed,
    /// The emulator was killed, and only its files remain.
    #[error(
        "instance '{instance}' is dead, its emulator (process {pid}) was killed; start it again with \
         `commram run -i {instance}` or remove its files with `commram stop --clean -i {instance}`"
    )]
    Dead {
        instance: String,
        /// The process id of the emulator.
        pid: u32,
    } => Exit::NotThere,
    /// The emulator was killed after it had begun to end in good order.
    #[error(
        "the emulator of instance '{instance}' (process {pid}) was killed during its end, and the last changes of NOVRAM \
         may be lost; {files}"
    )]
    KilledAtEnd {
        instance: String,
        /// The process id of the emulator.
        pid: u32,
        /// What has happened to the files of the instance, or what the user can do with them.
        files: String,
    } => Exit::NotThere,
    /// The search text does not occur in the register map.
    #[error("nothing in the register map of {device} has `{text}` in its name, meaning or values{hint}")]
    NotFound {
        /// The text to find.
        text: String,
        device: &'static str,
        /// Similar names that the user may have meant.
        hint: String,
    } => Exit::Failed,
    /// A register did not reach the expected value.
    #[error("{} did not become {} within {}; at {} it holds {}", .unmet.place, .unmet.wanted, time::long(*.within_us), time::seconds(*.time_us), .unmet.found)]
    NotMet {
        /// The register and its value.
        unmet: super::wait::UnmetCondition,
        /// How long the command waited, in emulated microseconds.
        within_us: u64,
        /// Emulated time at the end.
        time_us: u64,
    } => Exit::Failed,
    /// Several conditions were not true at the same moment, or none of them became true.
    #[error(
        "{} within {}; at {}:{}", if *.any { "none of these became true" } else { "these were not true at the same moment" },
        time::long(*.within_us), time::seconds(*.time_us), lines(.conditions)
    )]
    NoneMet {
        conditions: Vec<super::wait::UnmetCondition>,
        /// True if one of the conditions would have been enough.
        any: bool,
        /// How long the command waited, in emulated microseconds.
        within_us: u64,
        /// Emulated time at the end.
        time_us: u64,
    } => Exit::Failed,
    /// The emulator does not answer in time, because it advances the clock for this client or for another one.
    #[error(
        "instance '{instance}' did not handle the request within {after_ms} {} {}{}",
        if *.is_paused { "ms: its clock is paused (`commram speed 1` continues it) at" } else { "ms: it advances the clock, for this command or another one, and is at" },
        time::seconds(*.time_us), .waits_for.as_ref().map_or_else(String::new, |client| format!(", where it waits for {client}"))
    )]
    Busy {
        instance: String,
        /// How long the command waited, in real milliseconds.
        after_ms: u128,
        /// True if the clock is paused.
        is_paused: bool,
        /// Emulated time in microseconds.
        time_us: u64,
        /// The task or guest for which the clock waits, if any.
        waits_for: Option<String>,
    } => Exit::NotThere,
    /// The emulator was requested to end and has not ended.
    #[error(
        "instance '{instance}'{} has not ended within {seconds} s; kill it and remove its files with \
         `commram stop --clean -i {instance}`", .pid.map_or_else(String::new, |pid| format!(" (process {pid})"))
    )]
    StillThere {
        instance: String,
        /// Process id of the emulator, if the process is visible.
        pid: Option<u32>,
        /// How long the command waited, in real seconds.
        seconds: u64,
    } => Exit::Failed,
    /// The emulator was requested to end and does not answer, and no signal can reach it.
    #[error(
        "{source}; no emulator that this command can see holds the locks of '{instance}': {}", .place.text()
    )]
    Unseen {
        instance: String,
        place: EmulatorPlace,
        #[source]
        source: Box<CliError>,
    } => Exit::NotThere,
    /// The directory of a killed emulator cannot be removed.
    #[error(
        "instance '{instance}' was dead, but {} stays: these entries cannot be removed: {}", .directory.display(),
        super::output::harmless(.entries)
    )]
    Remains {
        instance: String,
        directory: PathBuf,
        /// The names of the entries.
        entries: String,
    } => Exit::NotThere,
    /// An emulator has ended and could not save its NOVRAM.
    #[error(
        "instance '{instance}' has stopped, but could not write NOVRAM: the last changes are lost; the reason is in its \
         output, or in the file of --log"
    )]
    Unsaved { instance: String } => Exit::Failed,
    /// A fault has invalid fields, or the plant does not have its target.
    #[error("{0}")]
    Fault(#[from] FaultError) => Exit::WrongUse,
    /// A request through the channel has failed.
    #[error("{0}")]
    Client(#[from] crate::channel::ClientError) as error => exit::of_client(error),
    /// The emulator cannot open the channel.
    #[error("{0}")]
    Server(#[from] crate::channel::ServerError) => Exit::NotThere,
    /// An image file cannot be used.
    #[error("{0}")]
    Memory(#[from] MemoryError) as error => exit::of_memory(error),
    /// The plant file has an error.
    #[error("{0}")]
    Plant(#[from] PlantError) => Exit::WrongUse,
    /// The emulator cannot start, or has ended with an error.
    #[error("{0}")]
    Runtime(#[from] RuntimeError) as error => exit::of_runtime(error),
    /// The other federates cannot be reached.
    #[error("{0}")]
    Helics(#[from] crate::helics::HelicsError) => Exit::NotThere,
    /// The device has no demonstration.
    #[error("there is no demonstration of {device}; `commram demo` shows one of another device")]
    NoDemo { device: &'static str } => Exit::WrongUse,
    /// The demonstration failed.
    #[error("{0}")]
    Demo(String) => Exit::Failed,
    /// The user has interrupted the command.
    #[error("interrupted")]
    Interrupted => Exit::Interrupted,
    /// An error that has already been printed.
    #[error("see above")]
    Reported => Exit::Failed,
    /// Another process or a signal determines the exit code; nothing is printed.
    #[error("see above")]
    Ended(u8) as code => *code,
    /// Wrong use that has already been reported.
    #[error("see above")]
    ReportedWrongUse => Exit::WrongUse,
    /// An invalid text of a fault.
    #[error("{0}")]
    FaultWord(#[from] crate::fault::WordError) => Exit::WrongUse,
    /// The emulator sent an unexpected reply.
    #[error("{0}")]
    WrongReply(#[from] crate::request::WrongReply) => Exit::NotThere,
    /// A scenario cannot be started.
    #[error("{0}")]
    Scenario(#[from] crate::script::ScenarioError) => Exit::Failed,
    /// The plant cannot be packed into a unit for co-simulation.
    #[error("{0}")]
    Fmu(Box<crate::fmi::ArchiveError>) => Exit::WrongUse,
    /// No connections can be accepted at an address.
    #[error("cannot listen at {address}: {reason}{}; `{option}127.0.0.1:0` selects a free port", limits::named(.reason))]
    Listen {
        address: std::net::SocketAddr,
        reason: io::Error,
        /// The option of the user's command that selects an address.
        option: &'static str,
    } => Exit::NotThere,
    /// A process cannot be started or watched.
    #[error("cannot handle a process: {reason}{}", limits::named(.reason))]
    Process { reason: io::Error } => Exit::NotThere,
    /// A process was killed before it was ready.
    #[error("{what} was killed before it was ready ({status}){}", because(*.signal))]
    Killed {
        /// Name of the process, as the subject of a sentence.
        what: String,
        /// Text of the exit status, with the signal.
        status: String,
        /// Number of the signal.
        signal: i32,
    } => Exit::Failed,
    /// The limit of the stack is too low.
    #[error(
        "this process may have {} KiB of {}, commram needs {} KiB: raise that limit (`ulimit {}`)", .limit.most / 1024,
        .limit.what, .limit.needed.div_ceil(1024), .limit.option
    )]
    LimitedMemory {
        /// Limit that the process has exceeded.
        limit: limits::space::MemoryLimit,
    } => Exit::NotThere,
    /// Signals cannot be caught.
    #[error("cannot catch signals: {reason}{}", limits::named(.reason))]
    Signals { reason: io::Error } => Exit::NotThere,
    /// There is no terminal to draw on.
    #[error("`{command}` needs a terminal for its input and its output; `commram watch` needs none")]
    NoTerminal { command: &'static str } => Exit::WrongUse,
    /// The standard output cannot be written.
    #[error("cannot write the output: {reason}{}; everything else is done", limits::named(.reason))]
    Output { reason: io::Error } => Exit::NoOutput,
    /// A file cannot be written.
    #[error("cannot write {}: {reason}{}{}", .path.display(), limits::named(.reason), room::named(.path, .reason))]
    File { path: PathBuf, reason: io::Error } => Exit::NotThere,
    /// An input file cannot be read, or does not have the expected format.
    #[error("cannot read {}: {reason}", .path.display())]
    Unreadable { path: PathBuf, reason: String } => Exit::WrongUse,
    /// The declarations cannot be imported into the layout.
    #[error("{0}")]
    Import(#[from] ImportError) as error => exit::of_import(error),
    #[error("{0}")]
    LayoutFiles(#[from] commram_layoutc::Error) => Exit::WrongUse,
    /// The layout files differ from the layout files that this program was built from.
    #[error(
        "{} has register map 16#{found:016X}, this commram {} was built with {built}; build it again there \
         with `cargo build --release`", .dir.display(), env!("CARGO_PKG_VERSION")
    )]
    OtherLayout {
        /// Directory of the layout.
        dir: PathBuf,
        /// Hash of the directory's register map.
        found: u64,
        /// Hashes of the built-in register maps.
        built: String,
    } => Exit::WrongUse,
    /// The file is not a dump, or cannot be read.
    #[error("{name} is not a dump: {reason}; `commram dump --format json` writes one")]
    NoDump { name: String, reason: String } => Exit::WrongUse,
    /// The reader has closed the standard output.
    #[error("the output has no reader")]
    BrokenPipe => Exit::Done,
}

/// Returns one line per condition: the value of its register, and the expected value.
fn lines(conditions: &[super::wait::UnmetCondition]) -> String {
    let line = |it: &super::wait::UnmetCondition| {
        let state = if it.holds { "as expected" } else { "expected:" };
        let wanted = if it.holds { String::new() } else { format!(" {}", it.wanted) };
        format!("\n  {} holds {}; {state}{wanted}", it.place, it.found)
    };
    conditions.iter().map(line).collect()
}

impl CliError {
    /// True if the error needs no further message.
    pub(crate) fn is_reported(&self) -> bool {
        matches!(self, Self::Reported | Self::ReportedWrongUse | Self::Ended(_) | Self::BrokenPipe)
    }

    /// Replaces the example in [`CliError::WhichPlc`] by a command for this PLC, because the user has named no register.
    #[must_use]
    pub(crate) fn with_command(self, command: impl FnOnce(&str) -> String) -> Self {
        match self {
            Self::WhichPlc { instance, plcs, example, .. } => {
                let right =
                    format!("it has several PLCs ({plcs}); write for example `{}`", command(&example));
                Self::Argument { text: instance, right }
            }
            other => other,
        }
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
