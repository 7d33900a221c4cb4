//! Demonstration of the Omega Drive-Line II for `commram demo`. Its node 2 is a CANsync master (manual
//! 5.00005.03a).

use crate::devices::cansync::demo::Master;
use crate::devices::emulation::demo::{Demo, DemoError, Show};
use crate::devices::omega_drive_line_2::registers::{BAUD_RATES, DEVICE};
use crate::memory::Attached;

pub(crate) static DEMO: Demo = Demo { plant: None, area: "node2", title: "Node 2", program: run };

fn run(attached: Attached, show: Show<'_>) -> Result<(), DemoError> {
    let master = Master {
        device: &DEVICE,
        port: DEVICE.port_named("node2")?,
        // 500 kbit/s.
        rate: &BAUD_RATES[0],
        headlines: [
            "Start (manual 5.00005.03a p. 149-150)",
            "Initialization data: master at 500 kbit/s, slaves 1, 2 and 3 expected",
            "Which words of the frames are which values (p. 151-157)",
            "Set-up mode: the master sends SYNC, the drives lock (p. 134, 168)",
        ],
    };
    master.run(attached, show)
}
