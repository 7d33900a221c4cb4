//! The soft-PLC of a demonstration: a CANsync master brings up three drives and moves them. The soft-PLC uses only the
//! image file and the register map.

mod exchange;
mod trace;

use crate::devices::cansync::BaudRate;
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::values::{cpu_control, option_status};
use crate::devices::emulation::demo::{DemoError, Show};
use crate::layout::{DeviceLayout, Port};
use crate::memory::{Attached, View};
use exchange::{DRIVES, Exchange};
use std::time::Duration;
use trace::{Trace, Writer};

/// Time limit for a state change, in real time. A state change takes milliseconds.
const STATE: Duration = Duration::from_secs(5);
/// Time limit for the drives to lock. The drives take about a second of emulated time.
const LOCK: Duration = Duration::from_secs(20);

/// Device-specific data of the demonstration.
pub(crate) struct Master {
    /// Layout of the device that the demonstration shows.
    pub device: &'static DeviceLayout,
    /// The port of the master.
    pub port: &'static Port,
    /// Baud rate of the master.
    pub rate: &'static BaudRate,
    /// Headlines of start, initialization data, mapping and set-up mode, with the manual's pages.
    pub headlines: [&'static str; 4],
}

impl Master {
    /// Initializes the master and exchanges process data.
    ///
    /// # Errors
    /// The emulator has ended, or does not answer as it should.
    pub(crate) fn run(&self, attached: Attached, show: Show<'_>) -> Result<(), DemoError> {
        let [start, data, words, set_up] = self.headlines;
        let init = attached.segment().view::<CANsync_INIT_BMSTRUCT>(self.port.area.first)?;
        let trace = &Trace::new(attached, self.device, self.port, show)?;
        trace.headline(start)?;
        command(trace, cpu_control::RESTART, option_status::START_UP)?;
        command(trace, cpu_control::HANDSHAKE, option_status::WAITING_FOR_INIT)?;
        trace.headline(data)?;
        initialization_data(trace, &init, self.rate)?;
        command(trace, cpu_control::TAKE_OVER_INIT_DATA, option_status::WAITING_FOR_START)?;
        trace.headline(words)?;
        mapping(trace)?;
        trace.headline(set_up)?;
        command(trace, cpu_control::START_SYNCHRONOUS, option_status::MASTER_SET_UP)?;
        lock(trace)?;
        trace.headline("Active operation")?;
        command(trace, cpu_control::ENABLE_ACTIVE, option_status::MASTER_ACTIVE)?;
        Exchange::new(trace, 1_000 / u32::from(self.rate.b_TIME_PATTERN)).run()
    }
}

/// Writes a command and waits for the state that follows.
fn command(trace: &Trace<'_>, command: u16, state: u16) -> Result<(), DemoError> {
    trace.node.w_CPU_CONTROL.store(command);
    trace.note(Writer::Plc, &trace.node.w_CPU_CONTROL)?;
    trace.ring()?;
    let what = format!("the state after command 16#{command:04X}");
    trace.await_value(&trace.node.w_OPTION_STATUS, state.into(), &what, STATE)?;
    trace.print()
}

/// Waits until all drives respond and are synchronized.
fn lock(trace: &Trace<'_>) -> Result<(), DemoError> {
    let cells = DRIVES.map(|drive| &trace.node.a_STAT_SL[usize::from(drive)]);
    let mut states = [0; DRIVES.len()];
    while states != [0x03; DRIVES.len()] {
        let now = || cells.map(|cell| cell.load());
        trace.await_change("a drive to respond or to lock", LOCK, || now() != states)?;
        let before = std::mem::replace(&mut states, now());
        for ((cell, before), now) in cells.into_iter().zip(before).zip(states) {
            if now != before {
                trace.note(Writer::Firmware, cell)?;
            }
        }
        trace.print()?;
    }
    Ok(())
}

fn initialization_data(
    trace: &Trace<'_>,
    init: &View<CANsync_INIT_BMSTRUCT>,
    rate: &BaudRate,
) -> Result<(), DemoError> {
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
        trace.note(Writer::Plc, cell)?;
    }
    for drive in DRIVES {
        let cell = &init.a_SL_TYP[usize::from(drive)];
        cell.store(0x01);
        trace.note(Writer::Plc, cell)?;
    }
    Ok(())
}

/// Maps reference value 0 into words 0 and 1 of frame 1, which all drives read. Maps words 0 and 1 of each
/// drive's frame 1 into the actual value 0 of the drive. In each interval the master requests the frame of
/// another slave. The mapping must be written after the initialization data, because the firmware clears the
/// cyclic registers when it takes over the initialization data.
fn mapping(trace: &Trace<'_>) -> Result<(), DemoError> {
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
        trace.note(Writer::Plc, cell)?;
    }
    Ok(())
}
