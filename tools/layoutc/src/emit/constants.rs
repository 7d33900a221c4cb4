//! Constants of a device: hash, areas, DIP range, timing table.

use super::tables::provenance;
use super::text::doc;
use crate::model::{Deadline, Device};
use std::fmt::Write;

pub(crate) fn emit(out: &mut String, device: &Device, layout_hash: u64) {
    let manual = &device.manual;
    let _ = writeln!(
        out,
        "/// Hash over everything that affects addresses or widths.\n\
         pub const LAYOUT_HASH: u64 = 0x{layout_hash:016X};\n\n\
         /// Lowest number that can be set at the DIP switches.\n\
         pub const DIP_FIRST: u8 = {};\n\n\
         /// Highest number that can be set at the DIP switches.\n\
         pub const DIP_LAST: u8 = {};\n",
        device.dip_first, device.dip_last
    );
    let retain = device.retain.iter().map(|(area, _)| area);
    for area in device.areas.iter().chain(retain) {
        let name = area.name.to_uppercase();
        out.push_str(&doc("", &format!("{} (manual {manual} p. {}).", area.doc, area.page)));
        let _ = writeln!(
            out,
            "///\n/// The value is the area's first byte in the image.\npub const {name}: u32 = {};",
            area.first
        );
        let _ = writeln!(out, "/// Bytes of the area `{}`.", area.name);
        let _ = writeln!(out, "pub const {name}_BYTES: usize = {};\n", area.bytes);
    }
    if let Some((area, default)) = &device.retain {
        let name = area.name.to_uppercase();
        let _ = writeln!(
            out,
            "/// Bytes of the area `{}` in a plant that does not say otherwise.\n\
             pub const {name}_DEFAULT_BYTES: u32 = {default};\n",
            area.name
        );
    }
    for word in &device.front {
        out.push_str(&doc("", &format!("{} (manual {manual} p. {}).", word.doc, word.page)));
        let _ = writeln!(
            out,
            "///\n/// The value is the number of the word in the header page's front.\npub const FRONT_{}: usize = {};\n",
            word.name.to_uppercase(),
            word.offset / 4
        );
    }
    let _ = writeln!(out, "/// One past the last byte of the last area.");
    let areas = device.areas.iter().chain(device.retain.iter().map(|(area, _)| area));
    let end = areas.map(|area| u64::from(area.first) + u64::from(area.bytes)).max().unwrap_or(0);
    let _ = writeln!(out, "pub const SEGMENT_END: usize = {end};\n");
    baud_rates(out, device);
}

fn baud_rates(out: &mut String, device: &Device) {
    let rates = &device.baud_rates;
    if rates.is_empty() {
        return;
    }
    let _ = writeln!(
        out,
        "/// The legal pairs of baud rate and interval with their times, fastest first.\n\
         pub static BAUD_RATES: [commram::devices::cansync::BaudRate; {}] = [",
        rates.len()
    );
    for rate in rates {
        let numbers = rate.numbers.iter().map(|(name, number)| format!("{name}: {number}"));
        let deadlines = rate.deadlines.iter().map(|(name, deadline)| {
            let Deadline { earliest, latest, source } = deadline;
            let source = provenance(source);
            format!(
                "{name}: commram::devices::cansync::Deadline {{ earliest: {earliest}, latest: {latest}, \
                 source: commram::layout::{source} }}"
            )
        });
        let fields: Vec<String> = numbers.chain(deadlines).collect();
        let _ = writeln!(out, "    commram::devices::cansync::BaudRate {{ {} }},", fields.join(", "));
    }
    out.push_str("];\n\n");
}
