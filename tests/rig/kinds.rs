//! The devices that tests of CANsync nodes run on, each with its own baud rates, and the places of their nodes in a
//! rig.

use commram::devices::cansync::BaudRate;
use commram::devices::{bm4_o_can_06::registers as bm4, omega_drive_line_2::registers as omega};
use commram::identity::PortNumber;
use commram::layout::DeviceLayout;
use core::fmt;

/// A device that has masters and slaves.
pub(crate) struct NodeDevice {
    pub name: &'static str,
    pub layout: &'static DeviceLayout,
    pub rates: &'static [BaudRate],
    pub master: NodePlace,
    pub slave: NodePlace,
    /// Text for [`NodeDevice::plc`].
    plc: fn(&str, u8, [Option<&str>; 2]) -> String,
    /// Value of the master's `w_OMEGA_NR`, or of the corresponding register of the device. The number differs from that
    /// of its slave.
    pub master_number: u16,
}

/// The place of a node: index of its PLC in the plant, number of its port, first byte of its registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NodePlace {
    pub plc: usize,
    pub port: PortNumber,
    pub base: u32,
}

static OMEGA: NodeDevice = NodeDevice {
    name: "Omega Drive-Line II",
    layout: &omega::DEVICE,
    rates: &omega::BAUD_RATES,
    master: NodePlace { plc: 0, port: PortNumber(2), base: omega::NODE2 },
    slave: NodePlace { plc: 1, port: PortNumber(1), base: omega::NODE1 },
    plc: |name, dip, [above, below]| {
        let above = above.map(|bus| format!("node1 = '{bus}'\nlock_time_us = 20000\n"));
        let below = below.map(|bus| format!("node2 = '{bus}'\n"));
        format!("[[plc]]\nname = '{name}'\ndip = {dip}\n{}{}", text(above), text(below))
    },
    master_number: 9,
};

/// The modules are in slots in the middle of the row. So a test that confuses the number of a slot with another number
/// fails.
static BM4: NodeDevice = NodeDevice {
    name: "b maXX PLC",
    layout: &bm4::DEVICE,
    rates: &bm4::BAUD_RATES,
    master: NodePlace { plc: 0, port: PortNumber(3), base: bm4::SLOTJ },
    slave: NodePlace { plc: 1, port: PortNumber(5), base: bm4::SLOTL },
    plc: |name, dip, [above, below]| {
        let sync_in = above.and(below).map(|_| "sync_in_from = 'L'\n".to_owned());
        let above = above.map(|bus| {
            format!(
                "[[device.module]]\nslot = 'L'\nkind = 'can-05'\nbus = '{bus}'\ndip = {dip}\nlock_time_us = 20000\n"
            )
        });
        let below =
            below.map(|bus| format!("[[device.module]]\nslot = 'J'\nkind = 'can-06'\nbus = '{bus}'\n"));
        let [above, below, sync_in] = [above, below, sync_in].map(text);
        format!("[[device]]\nkind = 'bm4-plc'\nname = '{name}'\n{above}{below}{sync_in}")
    },
    master_number: 0,
};

/// Returns the text, or an empty text if there is none.
fn text(text: Option<String>) -> String {
    text.unwrap_or_default()
}

impl NodeDevice {
    /// True if the device has the parts that only the Omega Drive-Line II has.
    pub(crate) fn is_omega(&self) -> bool {
        core::ptr::eq(self, &OMEGA)
    }

    /// Replaces `MASTER` and `SLAVE` in a text by the names of their ports.
    pub(crate) fn named(&self, text: &str) -> String {
        text.replace("MASTER", self.port(self.master)).replace("SLAVE", self.port(self.slave))
    }

    /// Replaces the names of the ports by `MASTER` and `SLAVE`, for the name of a register.
    pub(crate) fn unnamed(&self, register: &str) -> String {
        let (area, rest) = register.split_once('.').expect("area and register");
        let area = match area {
            area if area == self.port(self.master) => "MASTER",
            area if area == self.port(self.slave) => "SLAVE",
            area => area,
        };
        format!("{area}.{rest}")
    }

    fn port(&self, at: NodePlace) -> &'static str {
        self.layout.port_numbered(at.port).expect("a port of the device").name
    }

    /// Returns the plant file text of a PLC: slave number `dip` on the upper bus, and master of the lower bus.
    pub(crate) fn plc(&self, name: &str, dip: u8, above: Option<&str>, below: Option<&str>) -> String {
        (self.plc)(name, dip, [above, below])
    }
}

/// A baud rate of a device, with the values that its PLC sets.
#[derive(Clone, Copy)]
pub(crate) struct Rate {
    pub kind: &'static NodeDevice,
    pub timing: &'static BaudRate,
    pub kbit_s: u16,
    pub interval_us: u64,
}

impl fmt::Debug for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {} kbit/s", self.kind.name, self.kbit_s)
    }
}

impl Rate {
    /// Returns the next lower rate of the same device.
    pub(crate) fn slower(self) -> Rate {
        let lower = |it: &&Rate| core::ptr::eq(it.kind, self.kind) && it.kbit_s < self.kbit_s;
        *RATES.iter().filter(lower).max_by_key(|it| it.kbit_s).expect("the device has a lower one")
    }

    /// Scales `us` microseconds at 500 kbit/s to this rate's interval.
    pub(crate) fn scaled(self, us: u64) -> u64 {
        us * self.interval_us / 2_000
    }

    /// Returns a plant file with PLC `a` as master of PLC `b`; `drives` is put after the bus.
    pub(crate) fn plant(&self, drives: &str) -> String {
        let Rate { kind, .. } = self;
        let (a, b) = (
            kind.plc("a", kind.master_number as u8, None, Some("line")),
            kind.plc("b", 0, Some("line"), None),
        );
        format!("{a}{b}{}", self.bus("line", drives))
    }

    /// Returns a bus of a plant file, with drives that support this rate.
    pub(crate) fn bus(&self, name: &str, drives: &str) -> String {
        let kbit_s = self.kbit_s;
        // The only card function that supports 1 Mbit/s (5.01010.01 p. 10).
        let drives = match kbit_s {
            1000 => drives.replace("[[bus.drive]]\n", "[[bus.drive]]\ncard_function = 0\n"),
            _ => drives.to_owned(),
        };
        format!("[[bus]]\nname = '{name}'\nkbit_s = {kbit_s}\n{drives}")
    }
}

const fn rate(kind: &'static NodeDevice, timing: &'static BaudRate) -> Rate {
    Rate { kind, timing, kbit_s: timing.kbit_per_s, interval_us: timing.b_TIME_PATTERN as u64 * 1000 }
}

/// All rates of the Omega Drive-Line II, for tests of parts that only this device has.
pub(crate) static OMEGA_RATES: [Rate; 3] = [
    rate(&OMEGA, &omega::BAUD_RATES[0]),
    rate(&OMEGA, &omega::BAUD_RATES[1]),
    rate(&OMEGA, &omega::BAUD_RATES[2]),
];

/// All rates of all devices: a test that goes through this list runs at each rate.
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
