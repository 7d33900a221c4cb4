//! The layout hash: equal if and only if every register has the same name, address and width.

use crate::model::{Device, FieldType, Structure};
use std::fmt::Write;

/// Returns FNV-1a (64 bits) over a canonical description of names, addresses, types and dimensions. Comments,
/// documentation, meanings, owners and reset values do not count.
pub(crate) fn layout_hash(device: &Device) -> u64 {
    canonical(device).bytes().fold(0xCBF2_9CE4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3)
    })
}

fn canonical(device: &Device) -> String {
    let mut text = format!("device {}\n", device.name);
    for space in &device.spaces {
        let crate::model::Space { letter, segment, unit, first, offset, bytes, .. } = space;
        let _ = writeln!(text, "space {letter:?} {segment:?} {unit:?} {first} {offset} {bytes}");
    }
    if let Some((area, _)) = &device.retain {
        let _ = writeln!(text, "retain {} {} {}", area.name, area.first, area.bytes);
    }
    for word in &device.front {
        let _ = writeln!(text, "front {} {} {}", word.offset, word.name, word.scalar.name());
    }
    for area in &device.areas {
        let _ = write!(text, "area {} {} {}", area.name, area.first, area.bytes);
        for placed in &area.structures {
            let live = device.phase_name(placed.live);
            let live = live[..1].to_uppercase() + &live[1..];
            let _ = write!(text, " {}:{live}", device.structures[placed.structure].name);
        }
        text.push('\n');
    }
    let mut structures: Vec<_> = device.used_types().collect();
    structures.sort_by(|a, b| a.name.cmp(&b.name));
    for structure in structures {
        describe(&mut text, device, structure);
    }
    text
}

fn describe(text: &mut String, device: &Device, structure: &Structure) {
    let _ = writeln!(text, "struct {} {}", structure.name, structure.size);
    for field in &structure.fields {
        let ty = match field.kind {
            FieldType::Scalar(scalar) => scalar.name(),
            FieldType::Sub(index) => &device.substructures[index].name,
            FieldType::Padding(_) => continue,
        };
        let _ = writeln!(text, "{} {} {ty} {:?}", field.offset, field.name, field.dims);
    }
}
