//! `commram demo`: the whole thing in one command.
//!
//! Three processes: the emulator (`commram run`), a soft-PLC ([`plc`]) that knows nothing but the image file,
//! and this one, which starts, watches and ends them.

mod exchange;
pub(crate) mod plc;
mod processes;
mod trace;

use super::error::CliError;
use super::{dump, output};
use crate::plant::PlantConfig;
use processes::{Emulator, POLL, SoftPlc};
pub(crate) use processes::{Interrupts, command, end_with};
use std::time::{Duration, Instant};

/// Everything together takes a few seconds; something hangs if it takes this long.
const WATCHDOG: Duration = Duration::from_secs(120);
/// How long the soft-PLC may take to notice and to say that the emulator is gone.
const GRACE: Duration = Duration::from_secs(2);

/// Watch a soft-PLC initialize three drives and exchange process data with them.
///
/// Starts an emulator with the built-in plant and, as a process of its own, a soft-PLC that attaches to the
/// shared memory. The soft-PLC brings CANsync node 2 from restart to active operation, exchanges reference and
/// actual values for a second, and prints each handshake as it reads it back from the RAM: emulated time, who
/// wrote, register, address, value, meaning. At the end comes a dump. Takes about three seconds and leaves
/// nothing behind.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram demo
  commram demo | less")]
pub(crate) struct Args {}

/// Runs the demonstration.
pub(crate) fn run(_args: &Args) -> Result<(), CliError> {
    let interrupts = Interrupts::catch()?;
    let instance = format!("demo-{}", std::process::id());
    let devices = PlantConfig::built_in()?.devices;
    let plc = devices.first().map_or("", |device| device.name());
    let mut emulator = Emulator::start(&instance, &interrupts)?;
    output::print(&format!("emulator: process {}, instance '{instance}'\n", emulator.pid()))?;
    let mut soft_plc = SoftPlc::start(&instance, plc)?;
    watch(&mut emulator, &mut soft_plc, &interrupts)?;
    output::print("\nNode 2 now, as `commram dump node2` shows it:\n")?;
    dump::show(&instance, &["node2".to_owned()])?;
    emulator.stop()
}

/// Waits until the soft-PLC is done.
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
            // The soft-PLC notices it as well, and can say what it was doing.
            if since.elapsed() > GRACE {
                return Err(CliError::Demo("the emulator has ended unexpectedly".to_owned()));
            }
        }
        if start.elapsed() > WATCHDOG {
            let seconds = WATCHDOG.as_secs();
            return Err(CliError::Demo(format!("the soft-PLC is not done after {seconds} s")));
        }
        std::thread::sleep(POLL);
    }
}
