//! Demonstration for `commram demo --device bm4-plc`: a BM4-O-CAN-06 in slot G at 1 Mbit/s (manual
//! 5.02066.01a).

use crate::devices::bm4_o_can_06::registers::{BAUD_RATES, DEVICE};
use crate::devices::cansync::demo::Master;
use crate::devices::emulation::demo::{Demo, DemoError, Show};
use crate::memory::Attached;

pub(crate) static DEMO: Demo = Demo {
    plant: Some(include_str!("demo.toml")),
    area: "slotG",
    title: "The module in slot G",
    program: run,
};

fn run(attached: Attached, show: Show<'_>) -> Result<(), DemoError> {
    let master = Master {
        device: &DEVICE,
        port: DEVICE.port_named("slotG")?,
        // 1 Mbit/s.
        rate: &BAUD_RATES[0],
        headlines: [
            "Start (manual 5.02066.01a p. 49-50)",
            "Initialization data: master at 1 Mbit/s, slaves 1, 2 and 3 expected (p. 49-51, 126-127)",
            "Which words of the frames are which values (p. 51-58)",
            "Set-up mode: the master sends SYNC, the drives lock (p. 50, 70-71)",
        ],
    };
    master.run(attached, show)
}
