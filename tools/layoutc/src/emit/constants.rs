//! Hash, areas, DIP range, timing table.

use super::text::doc;
use crate::model::{BaudRate, Device};
use std::fmt::Write;

pub fn emit(out: &mut String, device: &Device, layout_hash: u64) {
    let manual = &device.manual;
    let _ = writeln!(
        out,
        "/// Hash over everything that affects addresses or widths.\n\
         pub const LAYOUT_HASH: u64 = 0x{layout_hash:016X};\n\n\
         /// Lowest number the DIP switches S33 can be set to.\n\
         pub const DIP_FIRST: u8 = {};\n\n\
         /// Highest number the DIP switches S33 can be set to.\n\
         pub const DIP_LAST: u8 = {};\n",
        device.dip_first, device.dip_last
    );
    for area in &device.areas {
        let name = area.name.to_uppercase();
        out.push_str(&doc("", &format!("{} (manual {manual} p. {}).", area.doc, area.page)));
        let _ = writeln!(
            out,
            "///\n/// The value is the area's first byte in `%MB3.`.\npub const {name}: usize = {};",
            area.first
        );
        let _ = writeln!(out, "/// Bytes of the area `{}`.", area.name);
        let _ = writeln!(out, "pub const {name}_BYTES: usize = {};\n", area.bytes);
    }
    let _ = writeln!(out, "/// One past the last byte of the last area.");
    let end =
        device.areas.iter().map(|area| u64::from(area.first) + u64::from(area.bytes)).max().unwrap_or(0);
    let _ = writeln!(out, "pub const SEGMENT_END: usize = {end};\n");
    baud_rates(out, device);
}

fn baud_rates(out: &mut String, device: &Device) {
    let _ = writeln!(
        out,
        "/// Baud rate, interval and slot times of the CANsync bus that belong together.\n\
         /// Times `t_` are microseconds after the SYNC edge, each the latest start of that frame.\n\
         #[derive(Debug, Clone, Copy, PartialEq, Eq)]\n\
         pub struct BaudRate {{"
    );
    for (name, ty, text) in FIELDS {
        let _ = writeln!(out, "    /// {text}.\n    pub {name}: {ty},");
    }
    let rates = &device.baud_rates;
    let _ = writeln!(
        out,
        "}}\n\n/// The legal pairs of baud rate and interval with their times, fastest first.\n\
         pub static BAUD_RATES: [BaudRate; {}] = [",
        rates.len()
    );
    for rate in rates {
        let values: Vec<String> =
            FIELDS.iter().zip(numbers(rate)).map(|((name, ..), n)| format!("{name}: {n}")).collect();
        let _ = writeln!(out, "    BaudRate {{ {} }},", values.join(", "));
    }
    out.push_str("];\n\n");
}

const FIELDS: [(&str, &str, &str); 14] = [
    ("kbit_per_s", "u16", "Baud rate in kbit/s"),
    ("us_BAUDRATE", "u8", "Code of the baud rate at function block `CANsync_INIT`"),
    ("b_BT_0", "u8", "Bit timing register 0 of the CAN controller"),
    ("b_BT_1", "u8", "Bit timing register 1 of the CAN controller"),
    ("b_TIME_PATTERN", "u8", "Interval in ms"),
    ("t_WRC1", "u32", "Reference value frame 1"),
    ("t_RDC1", "u32", "Actual value frame 1"),
    ("t_WRC2", "u32", "Reference value frame 2"),
    ("t_RDC2", "u32", "Actual value frame 2"),
    ("t_CC", "u32", "Command channel"),
    ("t_RC", "u32", "Response channel, in the next interval"),
    ("t_RSPTO", "u32", "Longest time a slave may take to answer, in us"),
    (
        "deadline",
        "u32",
        "Reference values must be there this long after the start of the event task, in us (D-09)",
    ),
    ("max_bus_m", "u16", "Longest bus in metres"),
];

fn numbers(rate: &BaudRate) -> [u32; 14] {
    [
        rate.kbit_per_s.into(),
        rate.us_BAUDRATE.into(),
        rate.b_BT_0.into(),
        rate.b_BT_1.into(),
        rate.b_TIME_PATTERN.into(),
        rate.t_WRC1,
        rate.t_RDC1,
        rate.t_WRC2,
        rate.t_RDC2,
        rate.t_CC,
        rate.t_RC,
        rate.t_RSPTO,
        rate.deadline,
        rate.max_bus_m.into(),
    ]
}
