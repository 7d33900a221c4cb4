//! The retain flags `%MB10000000` and up: a segment of their own on the device (manual 5.00005.03a p. 41-42).
//!
//! In the image they lie where segment 3 has nothing (decision D-194), so that a byte of the image is named in one
//! way only: below `%MB3.80000` as a flag, from there on as a byte of segment 3.

use super::Address;
use super::descriptor::{Area, Provenance};
use core::ops::Range;

/// Number of the first retain flag: the n of `%MBn`.
pub const FIRST_FLAG: u32 = 10_000_000;
/// Where it lies in the image.
pub const RETAIN_OFFSET: u32 = 8192;
/// Number of retain flags in bytes, unless the plant file says otherwise: `%MB10000000` to `%MB10019999` (p. 42).
pub const RETAIN_SIZE: u32 = 20_000;
/// Most retain flags in bytes that a plant can have: up to the first area of segment 3, `%MB3.80000`.
pub const MOST_RETAIN: u32 = 80_000 - RETAIN_OFFSET;

/// The bytes of the image that can be retain flags.
pub const RETAIN: Range<u32> = RETAIN_OFFSET..RETAIN_OFFSET + MOST_RETAIN;

/// The retain flags as an area of plain RAM. It is none of segment 3, so no register map has it.
pub static RETAIN_AREA: Area = Area {
    name: "retain",
    name_from: Provenance::Inferred("D-220"),
    first: RETAIN_OFFSET,
    bytes: MOST_RETAIN,
    cpu: None,
    doc: "Retain flags",
    page: "41-42",
    structures: &[],
};

/// Whether byte `offset` of the image is a retain flag, or can be one.
#[must_use]
pub const fn is_flag(offset: u32) -> bool {
    RETAIN.start <= offset && offset < RETAIN.end
}

/// Why nothing lies at `address`, for people.
#[must_use]
pub fn not_covered(address: Address) -> String {
    let width = address.width();
    if is_flag(address.offset()) {
        format!(
            "this PLC has fewer retain flags than this {width} needs; `retain_bytes` in the plant file gives it more"
        )
    } else {
        format!("no register area of the device covers this {width}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::omega_drive_line_2::registers::DEVICE;

    #[test]
    fn the_flags_end_where_segment_3_begins() {
        assert_eq!(DEVICE.areas.first().map(|area| area.first), Some(RETAIN.end));
        assert!(
            RETAIN_SIZE <= MOST_RETAIN && RETAIN_OFFSET.is_multiple_of(4) && FIRST_FLAG.is_multiple_of(4)
        );
    }
}
