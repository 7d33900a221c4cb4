//! `commram demo`: a complete example in one command.
//!
//! The demo has three processes: the emulator (`commram run`), a soft-PLC ([`plc`]) that uses only the image file, and
//! this process, which starts, watches and ends the other two.

pub(crate) mod plc;
mod processes;

use super::error::CliError;
use super::{Instance, dump, output};
use crate::devices::{self, emulation::demo::Demo};
use crate::plant::PlantConfig;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use processes::{Emulator, POLL, SoftPlc};
pub(crate) use processes::{Interrupts, command, end_with, terminate};
use std::io::{self, Write};
use std::time::{Duration, Instant};

/// Maximum duration of a run, which normally takes a few seconds.
const WATCHDOG: Duration = Duration::from_secs(120);
/// Time that the soft-PLC has to detect and report the end of the emulator.
const GRACE: Duration = Duration::from_secs(2);

/// Watch a soft-PLC initialize three drives and exchange process data with them.
///
/// Starts an emulator with a plant of the device and, in a separate process, a soft-PLC that attaches to the shared
/// memory. The soft-PLC brings the master of a bus from restart to active operation and exchanges reference and
/// actual values for a second. It prints each handshake as it reads it back from the RAM: emulated time, writer,
/// register, address, value, meaning. A dump follows at the end. The demonstration takes about three seconds and
/// removes its files.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram demo
  commram demo | less")]
pub(crate) struct Args {
    /// Type of the device
    #[arg(long, value_name = "DEVICE", value_parser = with_demo(), default_value = devices::default().layout.name)]
    device: &'static Demo,
}

/// Accepts the names of devices that have a demonstration, and returns the demonstration.
fn with_demo() -> impl TypedValueParser<Value = &'static Demo> {
    let names = devices::all().iter().filter(|known| known.emulation.demo.is_some());
    let names = names.map(|known| PossibleValue::new(known.layout.name).help(known.layout.title));
    PossibleValuesParser::new(names).try_map(|name| {
        devices::find(&name)
            .and_then(|known| known.emulation.demo)
            .ok_or("no demonstration of a device of this name")
    })
}

/// Runs `commram demo`.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let interrupts = Interrupts::catch()?;
    let instance = format!("demo-{}", std::process::id());
    let demo = args.device;
    let devices = match demo.plant {
        Some(plant) => PlantConfig::parse("the demonstration's plant", plant)?.devices,
        None => PlantConfig::built_in()?.devices,
    };
    let plc = devices.first().map_or("", |device| device.name());
    let mut emulator = Emulator::start(&instance, demo.plant, &interrupts)?;
    output::print(&format!("emulator: process {}, instance '{instance}'\n", emulator.pid()))?;
    let mut soft_plc = SoftPlc::start(&instance, plc)?;
    watch(&mut emulator, &mut soft_plc, &interrupts)?;
    output::print(&format!("\n{} now, as `commram dump {}` shows it:\n", demo.title, demo.area))?;
    dump::show(&Instance::running(&instance), &[demo.area.to_owned()])?;
    emulator.stop()
}

/// Shows the output of a soft-PLC.
fn show(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush())
}

/// Waits until the soft-PLC has finished.
fn watch(emulator: &mut Emulator, plc: &mut SoftPlc, interrupts: &Interrupts) -> Result<(), CliError> {
    let start = Instant::now();
    let mut emulator_ended = None;
    loop {
        if interrupts.any() {
            return Err(CliError::Interrupted);
        }
        if let Some(outcome) = plc.outcome()? {
            return outcome;
        }
        if emulator.has_ended()? {
            let since: &mut Instant = emulator_ended.get_or_insert_with(Instant::now);
            // The emulator has ended. The soft-PLC detects this, too, and gets some time to report its last action.
            if since.elapsed() > GRACE {
                return Err(CliError::Demo("the emulator has ended unexpectedly".to_owned()));
            }
        }
        if start.elapsed() > WATCHDOG {
            let seconds = WATCHDOG.as_secs();
            return Err(CliError::Demo(format!("the soft-PLC has not finished after {seconds} s")));
        }
        std::thread::sleep(POLL);
    }
}
