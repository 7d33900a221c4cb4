//! Start of an emulator in this process: the common part of `run` and `with`.

use super::error::CliError;
use super::given;
use super::{dump, log, number, output, plant_check, signals, snapshot};
use crate::devices;
use crate::identity::DeviceIndex;
use crate::journal::Names;
use crate::memory::names::channel_root;
use crate::memory::{InstanceLock, Unmapped, Width, describe_process};
use crate::plant::{FollowError, PlantConfig};
use crate::runtime::{Clock, Directory, Emulator, Options, RuntimeError};
use clap::ValueEnum;
use core::num::NonZero;
use signal_hook::consts::{SIGHUP, SIGINT};
use signal_hook::iterator::SignalsInfo;
use signal_hook::iterator::exfiltrator::WithRawSiginfo;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time that a signal during the start waits for the end of the start. After that the process ends at once.
const START_PATIENCE: Duration = Duration::from_secs(1);

/// Options of the emulator.
#[derive(clap::Args)]
pub(crate) struct Settings {
    /// Source of the emulated time
    #[arg(long, value_enum, default_value_t = ClockArg::Realtime)]
    clock: ClockArg,
    /// Emulated time per real time, 0.001 to 1000 (real-time clock only)
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speed)]
    speed: f64,
    /// Poll the registers instead of sleeping: faster answers, but it uses a whole processor core
    #[arg(long)]
    busy: bool,
    /// Keep the NOVRAM of each PLC in this directory, which no other emulator may use; without this option NOVRAM
    /// is lost at the end
    #[arg(long, value_name = "DIR")]
    novram: Option<PathBuf>,
    /// Memory in MiB for states to which a stepped instance can go back, see `commram step --back`; 0: none
    /// [default: 8]
    #[arg(long, value_name = "MIB", value_parser = number::within::<u32>(0..=4096))]
    keep_states: Option<u32>,
    /// Number of processor cores for the plant; results are identical, and so far it is hardly faster
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = number::within::<u8>(1..=64))]
    threads: u8,
    /// Record every change of these registers and blocks in the journal
    #[arg(add = super::complete::blocks_of_plant(), long = "record", alias = "watch", value_name = "REG", value_delimiter = ',', value_parser = given::text(LIST))]
    watch: Vec<String>,
    /// Start only if this program was built from the layout in this directory
    #[arg(long, value_name = "DIR")]
    layout: Option<PathBuf>,
}

/// Initial state of an emulator.
#[derive(Clone, Copy, Debug)]
pub(crate) enum InitialState<'a> {
    /// The built-in plant, at power-on.
    BuiltIn,
    /// A plant file, at power-on.
    Plant(&'a Path),
    /// A snapshot, with its plant.
    Snapshot(&'a Path),
}

/// Right form of `--record`.
const LIST: &str = "write blocks and registers, separated by commas, for example node2,node1.w_CPU_CONTROL";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ClockArg {
    /// The wall clock
    Realtime,
    /// The clock advances only by `commram step`, `commram wait` and other clients of the channel
    Stepped,
}

/// Parses a speed; the emulator checks its range.
fn speed(text: &str) -> Result<f64, &'static str> {
    text.parse().map_err(|_| "write a factor from 0.001 to 1000, for example 10")
}

impl Settings {
    /// Returns the clock that these options select.
    ///
    /// # Errors
    /// The options contain a speed and a stepped clock.
    pub(crate) fn clock(&self) -> Result<Clock, CliError> {
        match self.clock {
            ClockArg::Stepped if self.speed != 1.0 => {
                let right = "in stepped mode clients advance the clock, so there is no speed".to_owned();
                Err(CliError::Argument { text: format!("--speed {}", self.speed), right })
            }
            ClockArg::Stepped => Ok(Clock::Stepped),
            ClockArg::Realtime => Ok(Clock::RealTime { speed: self.speed }),
        }
    }

    /// Starts an emulator with this plant, and prints notes about files that it took over. From here on `signals`
    /// handles the termination signals.
    ///
    /// # Errors
    /// The emulator does not start.
    pub(crate) fn start(
        &self,
        begin: InitialState<'_>,
        instance: &str,
        signals: TerminationSignals,
        is_federate: bool,
    ) -> Result<(Emulator, Sender<OnSignal>), CliError> {
        let options = Options {
            instance: instance.to_owned(),
            clock: self.clock()?,
            busy: self.busy,
            novram: self.novram.clone(),
            is_federate,
        };
        if let Some(dir) = &self.layout {
            check_layout(dir)?;
        }
        log::to_stderr();
        let (started, starting) = mpsc::channel();
        let (is_ending, name) = (Arc::clone(&signals.has_any), instance.to_owned());
        in_thread(move || signals.pass_on(&starting, &name))?;
        let (config, snapshot) = match begin {
            InitialState::BuiltIn => (PlantConfig::built_in()?, None),
            InitialState::Plant(path) => (PlantConfig::load(path)?, None),
            InitialState::Snapshot(path) => {
                let file = snapshot::load(path)?;
                (file.config(&path.display().to_string())?, Some(file.snapshot))
            }
        };
        plant_check::warn(begin.path(), &config);
        crate::memory::survive_shortened_files().map_err(|reason| CliError::Signals { reason })?;
        let new = self.novram.as_deref().filter(|directory| !directory.exists());
        let mut emulator = Emulator::start_from(&config, options, snapshot.as_ref())
            .map_err(|error| explain_snapshot(begin, &config, error))?;
        if let Some(mib) = self.keep_states {
            emulator.keep_states((mib as usize) << 20);
        }
        // A plant begins with one core.
        if let Some(count) = NonZero::new(usize::from(self.threads)).filter(|count| count.get() > 1) {
            emulator.set_cores(count);
        }
        let (names, retain_bytes) = (emulator.plant().names(), emulator.plant().retain_bytes());
        // An emulator that has received a signal ends before its clock starts, so it records nothing.
        self.record(instance, &names, &retain_bytes, |plc, offset, len| {
            if is_ending.load(Ordering::Relaxed) { Ok(()) } else { emulator.keep_changes(plc, offset, len) }
        })?;
        // The user may have mistyped the name of the directory. Flags and parameters then start with their defaults, so
        // a note reports the new directory.
        if let Some(new) = new.filter(|directory| directory.exists()) {
            super::output::note(&format!(
                "NOVRAM directory {} did not exist; it was created empty",
                new.display()
            ));
        }
        report_takeover(&emulator);
        Ok((emulator, started))
    }
}

impl Settings {
    /// True if NOVRAM is kept when the emulator ends.
    pub(crate) fn keeps_novram(&self) -> bool {
        self.novram.is_some()
    }

    /// True if changes of registers are recorded.
    pub(crate) fn has_recorded(&self) -> bool {
        !self.watch.is_empty()
    }

    /// Checks the options that do not depend on the plant, without a start. Returns the clock.
    ///
    /// # Errors
    /// An emulator with these options would not start.
    pub(crate) fn check(&self) -> Result<Clock, CliError> {
        let clock = self.clock()?;
        clock.check()?;
        self.layout.as_deref().map_or(Ok(()), check_layout)?;
        let novram = self.novram.as_deref().map_or(Ok(()), Directory::check);
        novram.map_err(RuntimeError::from)?;
        Ok(clock)
    }

    /// Passes the registers of `--record` to `keep`: the index of the PLC, the first byte in the image, and the number of
    /// bytes. `retain_bytes` are the sizes of the retain flags of the PLCs.
    ///
    /// # Errors
    /// The plant has no such register, or `keep` fails.
    pub(crate) fn record(
        &self,
        instance: &str,
        names: &Names,
        retain_bytes: &[u32],
        mut keep: impl FnMut(DeviceIndex, u32, u32) -> Result<(), FollowError>,
    ) -> Result<(), CliError> {
        for text in &self.watch {
            for (plc, offset, len) in dump::stretches(instance, names, retain_bytes, text)? {
                keep(plc, offset, len).map_err(|error| {
                    let device = names.device(plc);
                    let right = match error {
                        FollowError::Unmapped(Unmapped { offset }) => {
                            device.not_covered(device.at(Width::Byte, offset))
                        }
                        FollowError::TooMany => error.to_string(),
                    };
                    CliError::Argument { text: format!("--record {text}"), right }
                })?;
            }
        }
        Ok(())
    }
}

impl<'a> InitialState<'a> {
    /// Returns the file of the initial state, if the state comes from a file.
    fn path(self) -> Option<&'a Path> {
        match self {
            InitialState::BuiltIn => None,
            InitialState::Plant(path) | InitialState::Snapshot(path) => Some(path),
        }
    }
}

/// Adds the cause to the error of a snapshot with other settings. A snapshot contains its plant. If the plant has a device
/// in a folder, the cause is a changed file of that folder.
fn explain_snapshot(begin: InitialState<'_>, config: &PlantConfig, error: RuntimeError) -> RuntimeError {
    match (begin, error) {
        (InitialState::Snapshot(_), RuntimeError::Snapshot(error)) => {
            error.caused_by(config.folders()).into()
        }
        (_, error) => error,
    }
}

/// Runs `work` in a thread.
///
/// # Errors
/// The operating system cannot start a thread.
pub(crate) fn in_thread<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, CliError> {
    let thread = std::thread::Builder::new().spawn(work);
    thread.map_err(|reason| RuntimeError::Thread { reason }.into())
}

/// A signal that requests this process to end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TerminationSignal {
    pub(crate) number: i32,
    /// True if `commram stop` has sent the signal; the signal then concerns only the emulator.
    pub(crate) is_from_stop: bool,
    /// Process id of the sender; `None` if the sender is the kernel, or a process that is not visible here.
    sender: Option<u32>,
}

impl TerminationSignal {
    /// Returns the reason for the end of the emulator, which clients receive. If `parent` ends, this process ends, too.
    pub(crate) fn reason(&self, parent: Option<u32>) -> String {
        let has_parent = |number| {
            rustix::process::getppid()
                .is_some_and(|found| found.as_raw_nonzero().get().cast_unsigned() == number)
        };
        let name = match self.number {
            SIGINT => "SIGINT",
            SIGHUP => "SIGHUP",
            _ => "SIGTERM",
        };
        match (parent, self.sender) {
            (Some(parent), _) if !has_parent(parent) => format!("its parent, process {parent}, has ended"),
            (_, Some(sender)) if self.is_from_stop => format!("{} has asked it to", describe_process(sender)),
            (_, Some(sender)) => format!("{} has sent {name}", describe_process(sender)),
            (_, None) if self.number == SIGINT => "Ctrl-C at its terminal".to_owned(),
            (_, None) if self.number == SIGHUP => "its terminal was closed".to_owned(),
            (_, None) => format!("it has received {name}"),
        }
    }
}

/// Handler of a signal.
pub(crate) type OnSignal = Box<dyn FnMut(TerminationSignal) + Send>;

/// The termination signals. While this value exists, they do not end the process by themselves.
pub(crate) struct TerminationSignals {
    signals: SignalsInfo<WithRawSiginfo>,
    /// Set by the first signal.
    has_any: Arc<AtomicBool>,
}

impl TerminationSignals {
    /// Catches the termination signals. After the first signal, writes to outputs that are not read end.
    ///
    /// # Errors
    /// The operating system refuses the request.
    pub(crate) fn take() -> Result<Self, CliError> {
        let signals = SignalsInfo::new(signals::termination());
        let signals = signals.map_err(|reason| CliError::Signals { reason })?;
        let has_any = Arc::new(AtomicBool::new(false));
        output::give_up_after(Arc::clone(&has_any));
        Ok(Self { signals, has_any })
    }

    /// Passes signals to the handler of the started emulator. A signal that arrives earlier waits until the start has
    /// ended, unless the start hangs; the files of `instance` are then removed.
    fn pass_on(mut self, starting: &Receiver<OnSignal>, instance: &str) {
        let mut pending = self.signals.forever().map(|signal| TerminationSignal {
            number: signal.si_signo,
            is_from_stop: crate::memory::is_from_stop(&signal),
            sender: crate::memory::sender_of(&signal),
        });
        let Some(first) = pending.next() else { return };
        self.has_any.store(true, Ordering::Relaxed);
        match starting.recv_timeout(START_PATIENCE) {
            Ok(mut act) => {
                act(first);
                pending.for_each(act);
            }
            Err(RecvTimeoutError::Timeout) => {
                remove_unfinished(instance);
                end_by(first.number);
            }
            // The start has failed, and the process ends soon.
            Err(RecvTimeoutError::Disconnected) => {}
        }
    }
}

/// Makes the second Ctrl-C end this process at once. Only the terminal can send Ctrl-C. A SIGINT from another process,
/// such as `commram stop` or a parent, never interrupts an orderly end, even if it is sent several times.
///
/// # Errors
/// The operating system refuses the request.
pub(crate) fn end_at_second_ctrl_c() -> Result<(), CliError> {
    let was_pressed = AtomicBool::new(false);
    let act = move |signal: &libc::siginfo_t| {
        // A signal with this code comes from the kernel, and not from another process.
        if signal.si_code == libc::SI_KERNEL && was_pressed.swap(true, Ordering::Relaxed) {
            end_by(SIGINT);
        }
    };
    // SAFETY: the action only accesses an atomic and calls a function that is allowed in signal handlers.
    let registered = unsafe { signal_hook_registry::register_sigaction(SIGINT, act) };
    registered.map(drop).map_err(|reason| CliError::Signals { reason })
}

/// Removes the files of the emulator that starts in this process, if there are any. Errors are ignored: the process ends.
fn remove_unfinished(instance: &str) {
    // Only the holder of the lock may remove the channel.
    let Ok(Some(Some(holder))) = InstanceLock::holder(instance) else { return };
    if holder.pid() == std::process::id() {
        if let Ok(root) = channel_root(instance) {
            let _ = crate::channel::remove_remains(instance, &root);
        }
        Directory::remove_unfinished();
        InstanceLock::remove_unfinished(instance);
    }
}

/// Ends this process as if the signal had never been caught.
fn end_by(signal: i32) {
    let _ = signal_hook::low_level::emulate_default_handler(signal);
}

fn check_layout(dir: &Path) -> Result<(), CliError> {
    let found = commram_layoutc::read(dir)?.layout_hash;
    if devices::of_hash(found).is_some() {
        return Ok(());
    }
    let hash = |known: &devices::Registered| format!("16#{:016X}", known.layout.layout_hash);
    let built = devices::all().iter().copied().map(hash).collect::<Vec<_>>().join(" and ");
    Err(CliError::OtherLayout { dir: dir.to_owned(), found, built })
}

fn report_takeover(emulator: &Emulator) {
    for image in emulator.images() {
        if let Some(pid) = image.taken_over() {
            let path = image.path().display();
            output::note(&format!("took over {path}, which a killed emulator (process {pid}) had left"));
        }
    }
}
