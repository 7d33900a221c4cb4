//! `commram run`: be the emulator.

use super::demo::end_with;
use super::error::CliError;
use super::{Instance, output};
use crate::devices;
use crate::plant::PlantConfig;
use crate::runtime::{Clock, Emulator, Options, StopHandle};
use clap::ValueEnum;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::Duration;

/// How long a signal that comes during the start waits for its end. Then there is no good order to end in.
const START_PATIENCE: Duration = Duration::from_secs(1);

/// Run an emulator until it is stopped.
///
/// Stays in the foreground and says in one line when it is ready. Ctrl-C, SIGTERM and `commram stop` end it
/// and remove its files; a second Ctrl-C ends it at once. If what NOVRAM holds cannot be written at the end either, the
/// exit code is 1. Without a plant file it runs the built-in plant:
/// PLC `line`, whose node 2 is the master of three drives with slave numbers 1, 2 and 3.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram run
  commram run --clock stepped -i test-1
  commram run plant.toml --speed 10
  commram run --novram ~/.local/state/commram
  commram run --layout layouts/DEVICE")]
pub(crate) struct Args {
    /// The plant: PLCs, buses, drives
    #[arg(value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// What drives the emulated time
    #[arg(long, value_enum, default_value_t = ClockArg::Realtime)]
    clock: ClockArg,
    /// Emulated time per real time, 0.001 to 1000 (real-time clock only)
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// Poll the registers instead of sleeping: faster answers, but it takes a whole processor core
    #[arg(long)]
    busy: bool,
    /// Keep the NOVRAM of each PLC in this directory, which no other emulator may use; without it, it is forgotten at
    /// the end
    #[arg(long, value_name = "DIR")]
    novram: Option<PathBuf>,
    /// Start only if this program was built from the layout in this directory
    #[arg(long, value_name = "DIR")]
    layout: Option<PathBuf>,
    /// End when this process does
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
    #[command(flatten)]
    instance: Instance,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ClockArg {
    /// The wall clock
    Realtime,
    /// `commram step`, `commram wait` and other clients of the channel; time stands still in between
    Stepped,
}

/// Runs the emulator.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let options = Options {
        instance: args.instance.name.clone(),
        clock: clock(args)?,
        busy: args.busy,
        novram: args.novram.clone(),
    };
    if let Some(dir) = &args.layout {
        check_layout(dir)?;
    }
    log_to_stderr();
    let config = match &args.plant {
        Some(path) => PlantConfig::load(path)?,
        None => PlantConfig::built_in()?,
    };
    // From here on a signal ends the emulator in good order, unless its start hangs.
    let signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).map_err(|reason| CliError::Signals { reason })?;
    if let Some(parent) = args.parent {
        end_with(parent)?;
    }
    let (started, starting) = mpsc::channel();
    std::thread::spawn(move || stop_on_signal(signals, &starting));
    crate::memory::survive_shortened_files().map_err(|reason| CliError::Signals { reason })?;
    let mut emulator = Emulator::start(&config, options)?;
    report_takeover(&emulator);
    // A reader that has gone away is no reason to end.
    let _ = output::print(&ready_line(&args.instance.name, &emulator, clock(args)?));
    // The thread ends with a second signal only, which ends the process.
    let _ = started.send(emulator.stop_handle());
    Ok(emulator.run()?)
}

fn check_layout(dir: &Path) -> Result<(), CliError> {
    let found = commram_layoutc::compile(dir)?.layout_hash;
    if devices::of_hash(found).is_some() {
        return Ok(());
    }
    let hash = |known: &devices::Registered| format!("16#{:016X}", known.layout.layout_hash);
    let built = devices::all().iter().copied().map(hash).collect::<Vec<_>>().join(" and ");
    Err(CliError::OtherLayout { dir: dir.to_owned(), found, built })
}

fn clock(args: &Args) -> Result<Clock, CliError> {
    match args.clock {
        ClockArg::Stepped if args.speed != 1.0 => {
            let right = "in stepped mode time passes on request, there is no speed".to_owned();
            Err(CliError::Argument { text: format!("--speed {}", args.speed), right })
        }
        ClockArg::Stepped => Ok(Clock::Stepped),
        ClockArg::Realtime => Ok(Clock::RealTime { speed: args.speed }),
    }
}

/// The first signal ends the emulator in good order, if need be once it has started, the second at once.
fn stop_on_signal(mut signals: Signals, starting: &Receiver<StopHandle>) {
    let mut pending = signals.forever();
    let Some(first) = pending.next() else { return };
    match starting.recv_timeout(START_PATIENCE) {
        Ok(emulator) => emulator.stop(),
        Err(RecvTimeoutError::Timeout) => end_by(first),
        // The start has failed, the process is about to end.
        Err(RecvTimeoutError::Disconnected) => return,
    }
    if let Some(second) = pending.next() {
        end_by(second);
    }
}

/// Ends this process as if the signal had never been caught.
fn end_by(signal: i32) {
    let _ = signal_hook::low_level::emulate_default_handler(signal);
}

fn report_takeover(emulator: &Emulator) {
    for image in emulator.images() {
        if let Some(pid) = image.taken_over() {
            let path = image.path().display();
            output::note(&format!("took over {path}, which a killed emulator (process {pid}) had left"));
        }
    }
}

fn ready_line(instance: &str, emulator: &Emulator, clock: Clock) -> String {
    let plcs = emulator.plant().devices().iter().zip(emulator.images());
    let plcs: Vec<_> =
        plcs.map(|(plc, image)| format!("{} ({})", plc.name(), image.path().display())).collect();
    let clock = match clock {
        Clock::Stepped => "stepped".to_owned(),
        Clock::RealTime { speed } => real_time_name(speed),
    };
    let doors: String =
        emulator.doors().iter().map(|(bus, door)| format!(", door {door} to bus {bus}")).collect();
    format!("commram: instance '{instance}' ready: {}, clock {clock}{doors}\n", plcs.join(", "))
}

/// `real time`, or `real time x 2.5`.
pub(crate) fn real_time_name(speed: f64) -> String {
    if speed == 1.0 { "real time".to_owned() } else { format!("real time x {speed}") }
}

fn log_to_stderr() {
    tracing_subscriber::fmt()
        .with_max_level(tracing::Level::WARN)
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .with_target(false)
        .without_time()
        .init();
}
