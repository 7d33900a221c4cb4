//! A page: how it lies in its segments, and its numbers and marks (p. 50-60), for the gateway and for the block that talks to it.
//!
//! The manual leaves out octets 2 to 7 of a page and what is in page 1 (p. 55): both are ours (D-467), and a real FB2 will not talk to this.

use core::ops::Range;

/// Numbers of pages (p. 55).
pub(super) mod number {
    /// Asks for the sizes of pages.
    pub(in crate::devices::can_dp2) const START: u16 = 0;
    /// Tells them.
    pub(in crate::devices::can_dp2) const SIZES: u16 = 1;
    /// The first of those that configure what is sent.
    pub(in crate::devices::can_dp2) const TX: u16 = 51;
    /// The first of those that configure what is received.
    pub(in crate::devices::can_dp2) const RX: u16 = 151;
    /// The first one with data.
    pub(in crate::devices::can_dp2) const DATA: u16 = 251;
}

/// Octets of a segment, but for the last one (p. 54).
pub(super) const SEGMENT: usize = 32;

/// Octets in front of what a page carries: in its first segment, and in each other one (p. 55, 59).
pub(super) const HEAD: usize = 8;
const NUMBER: usize = 2;

/// Where a page has its counter and its result (D-467).
pub(super) const COUNTER: usize = 2;
pub(super) const RESULT: usize = 3;

/// Octets of a record that configures an identifier (p. 57-58), and of the mark behind the last one.
pub(super) const RECORD: usize = 6;
pub(super) const MARK: usize = 4;

/// Octets of marks: others follow on the next page, or none (p. 63-65).
pub(super) const MORE: u8 = 0xDD;
pub(super) const END: u8 = 0xEE;

/// Where the octets lie that a page of these segments carries (p. 59).
pub(super) fn places(segments: &[Range<usize>]) -> impl Iterator<Item = usize> {
    segments
        .iter()
        .enumerate()
        .flat_map(|(number, segment)| segment.clone().skip(if number == 0 { HEAD } else { NUMBER }))
}

/// The identifiers of each page that carries `room` octets: each has one octet more than its data, and none is divided.
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
