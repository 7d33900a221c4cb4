//! `commram run`: the emulator process.

use super::demo::end_with;
use super::detach::{self, Detached};
use super::error::CliError;
use super::exit::Exit;
use super::overwrite::refuse_inputs;
use super::start::{InitialState, Settings, TerminationSignals, end_at_second_ctrl_c, in_thread};
use super::table::Format;
use super::web::WebProcess;
use super::{InstanceName, output, plant_check};
use crate::input_file;
use crate::journal::Keep;
use crate::memory::Segment;
use crate::plant::{Plant, PlantConfig};
use crate::runtime::{Clock, Emulator};
use signal_hook::consts::SIGINT;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::Duration;

/// Longest wait, when the emulator ends, for the output of the line that reports its start.
const LONGEST_PRINT: Duration = Duration::from_millis(500);

/// Run an emulator until it is stopped.
///
/// Stays in the foreground and prints one line when it is ready. With --detach the emulator continues in the
/// background, and this command ends when the emulator is ready or has failed to start. Ctrl-C, SIGTERM and
/// `commram stop` end the emulator and remove its files, even if several of them arrive; only a second Ctrl-C at
/// the terminal ends it at once. If the content of NOVRAM cannot be written at the end either, the exit code is 1.
/// Without a plant file the command runs the built-in plant: PLC `line`, whose node 2 is the master of three drives
/// with slave numbers 1, 2 and 3.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram run
  commram run --detach
  commram run --clock stepped -i test-1
  commram run plant.toml --speed 10
  commram run --check plant.toml
  commram run --novram ~/.local/state/commram
  commram run --from active.snap --clock stepped
  commram run --web
  commram run --record node2.w_CPU_CONTROL,node1   # every change in the journal
  commram run --layout layouts/DEVICE")]
pub(crate) struct Args {
    /// The plant file: PLCs, buses, drives
    #[arg(add = super::complete::files(&["toml"]), value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// Start with the plant and the state of this snapshot, see `commram snapshot`
    #[arg(add = super::complete::files(&["snap"]), long, value_name = "FILE", conflicts_with_all = ["plant", "check"])]
    from: Option<PathBuf>,
    /// Check the plant file and the other options, and start nothing
    #[arg(long)]
    check: bool,
    /// Output format of --check
    #[arg(long, value_enum, value_name = "FORMAT", requires = "check")]
    format: Option<Format>,
    /// Return when the emulator is ready; it continues in the background until `commram stop`
    #[arg(long)]
    detach: bool,
    /// File for the messages of the background process [default: messages are discarded]
    #[arg(long, value_name = "FILE", requires = "detach")]
    log: Option<PathBuf>,
    /// Serve a page and an HTTP interface, as `commram web` does, at this address
    #[arg(long, value_name = "ADDRESS:PORT", num_args = 0..=1, require_equals = true, default_missing_value = super::web::USUAL_ADDRESS, value_parser = super::web::listen_address)]
    web: Option<SocketAddr>,
    /// Internal option: this process was started by `--detach`
    #[arg(long, hide = true)]
    detached: bool,
    /// End when the process with this id ends
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    federate: super::federate::FederateArgs,
    #[command(flatten)]
    instance: InstanceName,
}

impl Args {
    fn begin(&self) -> InitialState<'_> {
        match (&self.from, &self.plant) {
            (Some(snapshot), _) => InitialState::Snapshot(snapshot),
            (None, Some(plant)) => InitialState::Plant(plant),
            (None, None) => InitialState::BuiltIn,
        }
    }
}

/// True if the plant or the snapshot is the standard input.
fn reads_input(args: &Args) -> bool {
    args.plant.iter().chain(&args.from).any(|path| input_file::is_standard(path))
}

/// Runs an emulator until it is stopped.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if args.check {
        let format = args.format.unwrap_or(Format::Text);
        return plant_check::run(args.plant.as_deref(), format, |config| check_options(args, config));
    }
    refuse_inputs(args.log.as_deref(), args.plant.as_deref().into_iter().chain(args.from.as_deref()))?;
    let name = &args.instance.name;
    if args.detach && !args.detached {
        return detach::start(name, reads_input(args));
    }
    let detached = args.detached.then(|| Detached::begin(args.log.as_deref())).transpose()?;
    let clock = args.settings.clock()?;
    args.federate.check(clock, args.settings.keeps_novram())?;
    // From here on, a signal makes the emulator end in an orderly way. If the start hangs, the signal ends the process.
    let signals = TerminationSignals::take()?;
    end_at_second_ctrl_c()?;
    if let Some(parent) = args.parent {
        end_with(parent)?;
    }
    let is_federate = args.federate.is_federate();
    let (mut emulator, started) = args.settings.start(args.begin(), name, signals, is_federate)?;
    args.federate.join(&mut emulator)?;
    let ready = ready_line(name, &emulator, clock);
    let let_go = move || detached.map_or(Ok(()), Detached::let_go);
    let (web, printed) = match args.web {
        Some(listen) => {
            let (stop, instance) = (emulator.stop_handle(), name.clone());
            let then = move |address: Option<String>| {
                match address {
                    // The parent of a detached process does not read the exit code, so an error at the output is
                    // ignored.
                    Some(address) => drop(announce(&instance, &(ready + &address))),
                    None => stop.stop(),
                }
                let _ = let_go();
            };
            (Some(WebProcess::start(name, listen, then)?), None)
        }
        None => {
            let instance = name.clone();
            let (send, printed) = mpsc::channel();
            // Prints in a thread: the emulator serves its clients even if its output is not read.
            in_thread(move || drop(send.send(announce(&instance, &ready).and(let_go()))))?;
            (None, Some(printed))
        }
    };
    let by_ctrl_c = Arc::new(AtomicBool::new(false));
    let (stop, interrupted) = (emulator.stop_handle(), Arc::clone(&by_ctrl_c));
    let (mut is_ending, parent) = (false, args.parent);
    // The first signal starts an orderly end; further signals have no effect.
    let _ = started.send(Box::new(move |signal| {
        if !core::mem::replace(&mut is_ending, true) {
            interrupted.store(signal.number == SIGINT, Ordering::Relaxed);
            stop.stop_because(signal.reason(parent));
        }
    }));
    emulator.run()?;
    web.map_or(Ok(()), WebProcess::end)?;
    if by_ctrl_c.load(Ordering::Relaxed) {
        return Err(CliError::Ended(Exit::Interrupted.code()));
    }
    match printed.map(|printed| printed.recv_timeout(LONGEST_PRINT)) {
        Some(Ok(Err(error @ CliError::Output { .. }))) => Err(error),
        _ => Ok(()),
    }
}

/// Checks the other options with a plant, as far as this is possible without a start.
///
/// # Errors
/// An option has a value with which the emulator would not start.
fn check_options(args: &Args, config: &PlantConfig) -> Result<(), CliError> {
    let clock = args.settings.check()?;
    args.federate.check(clock, args.settings.keeps_novram())?;
    args.federate.check_doors(config.buses.iter().flat_map(|bus| {
        let doors = bus.doors().iter();
        doors.map(|door| (bus.name(), *door))
    }))?;
    // Skips the check if no option needs it, because a large plant takes long to build.
    if !args.settings.has_recorded() && !args.federate.has_exchange() {
        return Ok(());
    }
    let mut plant = Plant::new(config, |_plc, device| Ok::<_, CliError>(Segment::of(device)))?;
    args.federate.coupling(&plant)?;
    let (names, retain_bytes) = (plant.names(), plant.retain_bytes());
    args.settings.record(&args.instance.name, &names, &retain_bytes, |plc, offset, len| {
        plant.follow_registers(plc, offset, len, Keep::InJournal)
    })
}

/// Prints the line that reports a ready emulator. If the output is closed or full, the emulator continues.
fn announce(instance: &str, line: &str) -> Result<(), CliError> {
    output::print(line).inspect_err(|error| {
        if !error.is_reported() && !matches!(error, CliError::Interrupted) {
            output::note(&format!("instance '{instance}' is ready, but its output cannot be written"));
        }
    })
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

/// Returns `real time`, `real time x 2.5`, or `real time, paused`.
pub(crate) fn real_time_name(speed: f64) -> String {
    match speed {
        0.0 => "real time, paused".to_owned(),
        1.0 => "real time".to_owned(),
        speed => format!("real time x {speed}"),
    }
}
