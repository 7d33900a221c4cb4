//! Format of a page, for the gateway and for FB2: segments, numbers and marks (p. 50-60).
//!
//! The manual does not define octets 2 to 7 of a page, nor the content of page 1 (p. 55). commram defines both (D-467),
//! so a real FB2 cannot communicate with this gateway.

use core::ops::Range;

/// Numbers of pages (p. 55).
pub(super) mod number {
    /// Requests the sizes of pages.
    pub(in crate::devices::can_dp2) const START: u16 = 0;
    /// Answers with the sizes of pages.
    pub(in crate::devices::can_dp2) const SIZES: u16 = 1;
    /// First page with definitions of sent identifiers.
    pub(in crate::devices::can_dp2) const TX: u16 = 51;
    /// First page with definitions of received identifiers.
    pub(in crate::devices::can_dp2) const RX: u16 = 151;
    /// First page with data.
    pub(in crate::devices::can_dp2) const DATA: u16 = 251;
}

/// Number of octets of a segment. The last segment of a page may be shorter (p. 54).
pub(super) const SEGMENT: usize = 32;

/// Number of octets before the content of a page: `HEAD` in the first segment, `NUMBER` in each other segment
/// (p. 55, 59).
pub(super) const HEAD: usize = 8;
const NUMBER: usize = 2;

/// Positions of counter and result in a page (D-467).
pub(super) const COUNTER: usize = 2;
pub(super) const RESULT: usize = 3;

/// Number of octets of a record that defines an identifier (p. 57-58), and of the mark after the last record.
pub(super) const RECORD: usize = 6;
pub(super) const MARK: usize = 4;

/// Octets of the mark after the last record of a page. `MORE`: the records continue on the next page. `END`:
/// there are no more records (p. 63-65).
pub(super) const MORE: u8 = 0xDD;
pub(super) const END: u8 = 0xEE;

/// Returns the positions of the octets that carry the content of a page with these segments (p. 59).
pub(super) fn places(segments: &[Range<usize>]) -> impl Iterator<Item = usize> {
    segments
        .iter()
        .enumerate()
        .flat_map(|(number, segment)| segment.clone().skip(if number == 0 { HEAD } else { NUMBER }))
}

/// Distributes identifiers over pages with room for `room` octets each. An identifier needs one octet more
/// than its data, and all its octets are on one page.
pub(super) fn divide(lengths: impl IntoIterator<Item = usize>, room: usize) -> Vec<Range<usize>> {
    let (mut pages, mut used): (Vec<Range<usize>>, usize) = (Vec::new(), 0);
    for (number, length) in lengths.into_iter().enumerate() {
        used += length + 1;
        match pages.last_mut() {
            Some(page) if used <= room => page.end = number + 1,
            _ => {
                pages.push(number..number + 1);
                used = length + 1;
            }
        }
    }
    pages
}
