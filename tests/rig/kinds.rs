//! The devices that tests of CANsync nodes run on, each with its own baud rates, and where in a rig their nodes are.

use commram::devices::cansync::BaudRate;
use commram::devices::{bm4_o_can_06::registers as bm4, omega_drive_line_2::registers as omega};
use commram::layout::Device;
use core::fmt;

/// A device that has masters and slaves.
pub(crate) struct Kind {
    pub name: &'static str,
    pub layout: &'static Device,
    pub rates: &'static [BaudRate],
    pub master: At,
    pub slave: At,
    /// PLCs `a` and `b` of a plant file, at bus `line`.
    plcs: &'static str,
    /// What `w_OMEGA_NR` of the master holds, or what it calls the register: a number that is not that of its slave.
    pub master_number: u16,
}

/// Where a node is: index of its PLC in the plant, number of the port there, first byte of its registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct At {
    pub plc: usize,
    pub port: u8,
    pub base: usize,
}

static OMEGA: Kind = Kind {
    name: "Omega Drive-Line II",
    layout: &omega::DEVICE,
    rates: &omega::BAUD_RATES,
    master: At { plc: 0, port: 2, base: omega::NODE2 },
    slave: At { plc: 1, port: 1, base: omega::NODE1 },
    plcs: "[[plc]]\nname = 'a'\ndip = 9\nnode2 = 'line'\n\
           [[plc]]\nname = 'b'\ndip = 0\nnode1 = 'line'\nlock_time_us = 20000\n",
    master_number: 9,
};

/// Slots in the middle, so that no number is right by chance.
static BM4: Kind = Kind {
    name: "b maXX PLC",
    layout: &bm4::DEVICE,
    rates: &bm4::BAUD_RATES,
    master: At { plc: 0, port: 3, base: bm4::SLOTJ },
    slave: At { plc: 1, port: 5, base: bm4::SLOTL },
    plcs: "[[device]]\nkind = 'bm4-plc'\nname = 'a'\n\
           [[device.module]]\nslot = 'J'\nkind = 'can-06'\nbus = 'line'\n\
           [[device]]\nkind = 'bm4-plc'\nname = 'b'\n\
           [[device.module]]\nslot = 'L'\nkind = 'can-05'\nbus = 'line'\ndip = 0\nlock_time_us = 20000\n",
    master_number: 0,
};

impl Kind {
    /// The plant file; `drives` is put behind the bus.
    pub(crate) fn plant(&self, kbit_s: u16, drives: &str) -> String {
        // The one card function that knows 1 Mbit/s (5.01010.01 p. 10).
        let drives = match kbit_s {
            1000 => drives.replace("[[bus.drive]]\n", "[[bus.drive]]\ncard_function = 0\n"),
            _ => drives.to_owned(),
        };
        format!("{}[[bus]]\nname = 'line'\nkbit_s = {kbit_s}\n{drives}", self.plcs)
    }
}

/// A baud rate of a device, as its PLC sets it.
#[derive(Clone, Copy)]
pub(crate) struct Rate {
    pub kind: &'static Kind,
    pub timing: &'static BaudRate,
    pub kbit_s: u16,
    pub interval_us: u64,
}

impl fmt::Debug for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {} kbit/s", self.kind.name, self.kbit_s)
    }
}

const fn rate(kind: &'static Kind, timing: &'static BaudRate) -> Rate {
    Rate { kind, timing, kbit_s: timing.kbit_per_s, interval_us: timing.b_TIME_PATTERN as u64 * 1000 }
}

/// All rates of the Omega Drive-Line II, for tests of what only this device has.
pub(crate) static OMEGA_RATES: [Rate; 3] = [
    rate(&OMEGA, &omega::BAUD_RATES[0]),
    rate(&OMEGA, &omega::BAUD_RATES[1]),
    rate(&OMEGA, &omega::BAUD_RATES[2]),
];

/// All rates of all devices: a test over this list runs the same on each.
pub(crate) static RATES: [Rate; 7] = [
    OMEGA_RATES[0],
    OMEGA_RATES[1],
    OMEGA_RATES[2],
    rate(&BM4, &bm4::BAUD_RATES[0]),
    rate(&BM4, &bm4::BAUD_RATES[1]),
    rate(&BM4, &bm4::BAUD_RATES[2]),
    rate(&BM4, &bm4::BAUD_RATES[3]),
];

/// Each device at its highest rate.
pub(crate) static FASTEST: [Rate; 2] = [RATES[0], RATES[3]];
