//! The soft-PLC of the demonstration: a process that knows the image file and the register map, nothing else.

use super::exchange::{DRIVES, Exchange};
use super::trace::{Trace, Who};
use crate::cli::demo::processes;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::devices::omega_drive_line_2::registers::{BAUD_RATES, CANsync_INIT_BMSTRUCT, LAYOUT_HASH, NODE2};
use crate::memory::{AttachMode, Image, View};
use std::time::Duration;

/// How long a state change may take, in real time. It takes milliseconds.
const STATE: Duration = Duration::from_secs(5);
/// How long the drives may take to lock. They take about a second of emulated time.
const LOCK: Duration = Duration::from_secs(20);

/// The soft-PLC of `commram demo`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram demo-plc default line")]
pub(crate) struct Args {
    /// Name of the instance
    instance: String,
    /// Name of the PLC
    plc: String,
    /// End when this process does
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
}

/// Attaches, initializes node 2 and exchanges process data.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if let Some(parent) = args.parent {
        processes::end_with(parent)?;
    }
    let attached = Image::attach(&args.instance, &args.plc, AttachMode::ReadWrite, Some(LAYOUT_HASH))?;
    let (pid, image) = (std::process::id(), attached.path().display().to_string());
    output::print(&format!("soft-PLC: process {pid}, attached to {image}\n"))?;
    let init = attached.segment().view::<CANsync_INIT_BMSTRUCT>(NODE2)?;
    let trace = Trace::new(attached)?;

    trace.headline("Start (manual 5.00005.03a p. 149-150)")?;
    command(&trace, 0x0000, 0x0001)?;
    command(&trace, 0x0001, 0x0002)?;
    trace.headline("Initialization data: master at 500 kbit/s, slaves 1, 2 and 3 expected")?;
    initialization_data(&trace, &init)?;
    command(&trace, 0x0002, 0x0003)?;
    trace.headline("Which words of the frames are which values (p. 151-157)")?;
    mapping(&trace)?;
    trace.headline("Set-up mode: the master sends SYNC, the drives lock (p. 134, 168)")?;
    command(&trace, 0x0020, 0x0043)?;
    lock(&trace)?;
    trace.headline("Active operation")?;
    command(&trace, 0x0040, 0x0080)?;
    Exchange::new(&trace).run()
}

/// Gives a command and waits for the state that follows.
fn command(trace: &Trace, command: u16, state: u16) -> Result<(), CliError> {
    trace.node.w_CPU_CONTROL.store(command);
    trace.note(Who::Plc, &trace.node.w_CPU_CONTROL)?;
    trace.ring()?;
    let what = format!("the state after command 16#{command:04X}");
    trace.await_value(&trace.node.w_OPTION_STATUS, state.into(), &what, STATE)?;
    trace.print()
}

/// Waits until all drives respond and are synchronized.
fn lock(trace: &Trace) -> Result<(), CliError> {
    let cells = DRIVES.map(|drive| &trace.node.a_STAT_SL[usize::from(drive)]);
    let mut states = [0; DRIVES.len()];
    while states != [0x03; DRIVES.len()] {
        let now = || cells.map(|cell| cell.load());
        trace.await_change("a drive to respond or to lock", LOCK, || now() != states)?;
        let before = std::mem::replace(&mut states, now());
        for ((cell, before), now) in cells.into_iter().zip(before).zip(states) {
            if now != before {
                trace.note(Who::Firmware, cell)?;
            }
        }
        trace.print()?;
    }
    Ok(())
}

fn initialization_data(trace: &Trace, init: &View<CANsync_INIT_BMSTRUCT>) -> Result<(), CliError> {
    let [rate, ..] = &BAUD_RATES;
    for (cell, value) in [
        (&init.b_MA_SL_MODE, 0x00),
        (&init.b_AC, 0xFF),
        (&init.b_AM, 0xFF),
        (&init.b_BT_0, rate.b_BT_0),
        (&init.b_BT_1, rate.b_BT_1),
        (&init.b_OUTPUT_CONTROL, 0xFA),
        (&init.b_CLOCK_DIVIDER, 0x07),
        (&init.b_TIME_PATTERN, rate.b_TIME_PATTERN),
    ] {
        cell.store(value);
        trace.note(Who::Plc, cell)?;
    }
    for drive in DRIVES {
        let cell = &init.a_SL_TYP[usize::from(drive)];
        cell.store(0x01);
        trace.note(Who::Plc, cell)?;
    }
    Ok(())
}

/// Reference value 0 into words 0 and 1 of frame 1, which all drives read; words 0 and 1 of each drive's frame 1
/// into its actual value 0. Every interval another slave is asked for its frame. It comes after the
/// initialization data, because taking them over clears the cyclic registers.
fn mapping(trace: &Trace) -> Result<(), CliError> {
    let node = &trace.node;
    let reference = &node._CFG_WRC_WORD;
    let mut bytes = vec![(&reference.b_CFG_WRC1_WORD0, 0x01), (&reference.b_CFG_WRC1_WORD1, 0x03)];
    for drive in DRIVES {
        let actual = &node.a_CFG_RDC_WORD[usize::from(drive)];
        bytes.extend([(&actual.b_CFG_RDC1_WORD0, 0x01), (&actual.b_CFG_RDC1_WORD1, 0x03)]);
    }
    let [.., last] = DRIVES;
    bytes.extend([(&node.b_MAX_SL_NR, last), (&node.b_CTRLREG_RD_ORDER_RDC1, 0x80)]);
    // No slave has answered yet.
    bytes.push((&node.b_STATREG_RDC1, 0xFF));
    for (cell, value) in bytes {
        cell.store(value);
        trace.note(Who::Plc, cell)?;
    }
    Ok(())
}
