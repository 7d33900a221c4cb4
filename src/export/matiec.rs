//! Glue for IEC 61131-3 programs compiled by matiec: binds their located variables `%M?3.n` to an image. The C
//! header comes first, then what `LOCATED_VARIABLES.h` is checked against, then `matiec/glue.h`.

use super::c;
use super::scope::Scope;
use crate::layout::{Area, Fitted};
use std::fmt::Write;

const GLUE: &str = include_str!("matiec/glue.h");

pub(crate) fn generate(scope: &Scope) -> String {
    let mut out = c::generate(scope).replacen("`commram export c", "`commram export matiec", 1);
    out.push_str("\n#ifndef COMMRAM_MATIEC_H\n#define COMMRAM_MATIEC_H\n\n");
    out.push_str("/* Whether byte n of segment 3 lies in an area. */\n#define COMMRAM_IN_AREA(n) (0");
    for Area { first, bytes, .. } in &scope.areas {
        let _ = write!(out, " \\\n    || ((n) >= {first}u && (n) < {}u)", first + bytes);
    }
    out.push_str(
        ")\n\n/* Bytes of the register that byte n of segment 3 belongs to; 0 where there is none. */\n",
    );
    out.push_str("#define COMMRAM_WIDTH_AT(n) (0u");
    for (first, end, width) in widths(scope) {
        let _ = write!(out, " \\\n    + ((n) >= {first}u && (n) < {end}u ? {width}u : 0u)");
    }
    out.push_str(")\n\n");
    out.push_str(GLUE);
    out
}

/// Stretches of registers of one width: first byte, end, width. Structures that overlay each other agree on
/// the widths of what is used, but not on where they end.
fn widths(scope: &Scope) -> Vec<(u32, u32, u32)> {
    let mut stretches: Vec<(u32, u32, u32)> = Vec::new();
    for area in &scope.areas {
        let mut bytes = vec![0; area.bytes as usize];
        for found in Fitted::unknown(scope.device).used_registers(area) {
            let first = found.offset_in_structure() as usize;
            let width = found.width();
            bytes.iter_mut().skip(first).take(width as usize).for_each(|byte| *byte = width);
        }
        for (offset, width) in (area.first..).zip(bytes).filter(|(_, width)| *width > 0) {
            match stretches.last_mut() {
                Some((_, end, last)) if *end == offset && *last == width => *end += 1,
                _ => stretches.push((offset, offset + 1, width)),
            }
        }
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    #[test]
    fn widths_are_those_of_the_registers() {
        let scope = Scope::new(&DEVICE, None).unwrap();
        let widths = widths(&scope);
        let at = |n| widths.iter().find(|(first, end, _)| (*first..*end).contains(&n)).map(|found| found.2);
        assert_eq!([at(200_000), at(200_012), at(200_052), at(202_893)], [Some(2), Some(1), Some(4), None]);
        assert!(widths.iter().all(|(first, _, width)| first % width == 0));
    }
}
