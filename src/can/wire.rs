//! Duration of a frame on the bus, exact to the bit.
//!
//! A frame of the standard format begins with the start bit, identifier (11 bits), RTR, IDE, r0, length (4), data and
//! CRC (15). In the extended format SRR, IDE, the other 18 bits of the identifier, RTR, r1 and r0 follow the first 11
//! bits of the identifier. In this part of the frame, a stuff bit of opposite value is inserted after each five equal
//! bits. The CRC delimiter, the acknowledge slot with its delimiter and the end of frame (7) follow without stuff bits.
//! Then the bus is idle for the intermission (3) before a station may start the next frame (ISO 11898-1).
//!
//! This code runs for every simulated frame. For speed, it uses tables for the CRC and the stuff bits.

use super::{BitRate, Frame};

/// Returns the number of bits from start bit to CRC, without data bytes and stuff bits.
const STANDARD_PART: u32 = 34;
const EXTENDED_PART: u32 = 54;
/// Number of bits of CRC delimiter, acknowledge slot, acknowledge delimiter and end of frame.
const FIXED_PART: u32 = 1 + 1 + 1 + 7;
/// Number of bits at the end that are recessive in a frame that arrives: acknowledge delimiter and end of frame.
pub(crate) const RECESSIVE_END: u32 = 1 + 7;
/// Number of bits of the intermission.
pub(crate) const INTERMISSION: u32 = 3;
/// Number of bits of an error flag. They are equal and so violate the rule of stuff bits.
pub(crate) const ERROR_FLAG: u32 = 6;
/// Number of bits of an error delimiter.
pub(crate) const ERROR_DELIMITER: u32 = 8;
/// Number of bits that an error-passive station waits after the intermission of its own frame.
pub(crate) const SUSPENSION: u32 = 8;

/// Generator of the CRC: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
const POLYNOMIAL: u16 = 0x4599;
const CRC_BITS: u32 = 15;

/// Lengths of the longest messages from which the CRC is computed, in bytes. The standard format has 19 bits
/// of header, padded to three bytes, and eight data bytes. The extended format has 39 bits of header, padded
/// to five bytes.
const STANDARD_BYTES: usize = 11;
const EXTENDED_BYTES: usize = 13;

/// `CRC[k][b]` is the CRC of byte `b` followed by `k` zero bytes. The CRC is linear and starts at 0. So the CRC of a
/// message is the XOR over its bytes, and the processor can do the look-ups in parallel.
static CRC: [[u16; 256]; EXTENDED_BYTES] = crc_tables();

const fn crc_tables() -> [[u16; 256]; EXTENDED_BYTES] {
    let mut tables = [[0; 256]; EXTENDED_BYTES];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << (CRC_BITS - 8);
        let mut zeros = 0;
        while zeros < EXTENDED_BYTES {
            let mut bit = 0;
            while bit < 8 {
                let feedback = crc & (1 << (CRC_BITS - 1)) != 0;
                crc = (crc << 1) & 0x7FFF;
                if feedback {
                    crc ^= POLYNOMIAL;
                }
                bit += 1;
            }
            tables[zeros][byte] = crc;
            zeros += 1;
        }
        byte += 1;
    }
    tables
}

/// Returns the CRC of a right-aligned message of at most `BYTES` bytes.
#[inline]
fn crc<const BYTES: usize>(message: u128) -> u16 {
    CRC[..BYTES]
        .iter()
        .zip(message.to_le_bytes())
        .fold(0, |crc, (table, byte)| crc ^ table[usize::from(byte)])
}

/// States of the stuffing: 0..=3 after a run of 1..=4 equal bits, 4 directly after a stuff bit.
const STATES: usize = 5;
const AFTER_STUFF_BIT: usize = 4;

/// `STUFF[changes]` gives the effect of eight more bits for each state. `changes` has a 1 for each bit that
/// differs from its predecessor; the first bit is the highest. Byte s of the entry is for state s. The lower
/// six bits of this byte are eight times the next state, and its higher bits are the number of stuff bits, at
/// most 2. So one shift gives the next state, and the look-up in the table does not depend on the present
/// state.
static STUFF: [u64; 256] = stuff_table();

const fn stuff_table() -> [u64; 256] {
    let mut table = [0; 256];
    let mut changes = 0;
    while changes < table.len() {
        let mut start = 0;
        while start < STATES {
            let (next, stuffed) = stuff_byte(start, changes);
            table[changes] |= ((8 * next as u64) | (stuffed << 6)) << (8 * start);
            start += 1;
        }
        changes += 1;
    }
    table
}

/// Returns the state after eight bits, and the number of stuff bits in them.
const fn stuff_byte(mut state: usize, changes: usize) -> (usize, u64) {
    let mut stuffed = 0;
    let mut bit = 8;
    while bit > 0 {
        bit -= 1;
        let change = changes >> bit & 1 != 0;
        state = if state == AFTER_STUFF_BIT {
            // The stuff bit is the opposite of its predecessor. If the next bit equals that predecessor, it
            // starts a new run. Otherwise it equals the stuff bit, and is the second bit of the stuff bit's
            // run.
            change as usize
        } else if change {
            0
        } else {
            state + 1
        };
        if state == AFTER_STUFF_BIT {
            stuffed += 1;
        }
    }
    (state, stuffed)
}

/// Returns the bits of the stuffed part, right-aligned and without stuff bits, and their number.
#[inline]
fn stuffed_part(frame: &Frame) -> (u128, u32) {
    let (field, length) = (u64::from(frame.arbitration().bits()), frame.length() as u64);
    let payload = frame.payload();
    let data_bits = 8 * payload.len().min(8) as u32;
    let data = u128::from(u64::from_be_bytes(payload.padded()));
    // The start bit, r1 and r0 are dominant, which is 0.
    let message = |header: u64| (u128::from(header) << 64 | data) >> (64 - data_bits);
    let (message, crc, rest) = if frame.arbitration().is_extended() {
        let message = message(field << 6 | length);
        (message, crc::<EXTENDED_BYTES>(message), EXTENDED_PART)
    } else {
        // IDE is the last bit of the field that a standard frame sends.
        let message = message(field >> 19 << 5 | length);
        (message, crc::<STANDARD_BYTES>(message), STANDARD_PART)
    };
    (message << CRC_BITS | u128::from(crc), rest + data_bits)
}

/// Returns the number of bits from start bit to CRC with stuff bits.
#[inline]
fn stuffed_bits(frame: &Frame) -> u32 {
    let (bits, count) = stuffed_part(frame);
    // Each change of the bit value is a 1. The start bit is a change, because it differs from the idle bus. The 1s
    // above the start bit keep the state at "run of one bit".
    let changes = (bits ^ bits >> 1) | u128::MAX << (count - 1);
    let bytes = changes.to_be_bytes();
    let [_, _, _, standard @ ..] = &bytes;
    // For all frames of a format, the function reads an equal number of bytes, so the loop needs no branch.
    count + if count <= u8::BITS * standard.len() as u32 { stuff_bits(standard) } else { stuff_bits(&bytes) }
}

/// Returns the stuff bits among the bits that `changes` describes.
#[inline]
fn stuff_bits<const BYTES: usize>(changes: &[u8; BYTES]) -> u32 {
    let (mut state, mut stuffed) = (0, 0);
    for &byte in changes {
        state = STUFF[usize::from(byte)] >> (state & 63);
        stuffed += state >> 6 & 3;
    }
    stuffed as u32
}

/// Returns the number of bits from the start bit to the end of the intermission. The frame occupies the bus during
/// these bits.
#[inline]
pub fn bits(frame: &Frame) -> u32 {
    bits_to_end_of_frame(frame) + INTERMISSION
}

/// Returns the number of bits from the start bit to the end of the end-of-frame field, at which the receivers have the
/// frame.
#[inline]
pub fn bits_to_end_of_frame(frame: &Frame) -> u32 {
    stuffed_bits(frame) + FIXED_PART
}

/// Returns the number of bits from the start bit to the acknowledge slot, exclusive.
#[inline]
pub(crate) fn bits_to_acknowledgement(frame: &Frame) -> u32 {
    stuffed_bits(frame) + 1
}

/// Duration of a frame from the start bit on, in nanoseconds, rounded up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Airtime {
    /// Time up to the end of the end-of-frame field, at which the receivers have the frame.
    pub delivery_ns: u64,
    /// Time up to the end of the intermission, at which the next frame may begin.
    pub occupation_ns: u64,
}

/// Returns the duration of the frame at this rate.
#[inline]
pub fn airtime(frame: &Frame, rate: BitRate) -> Airtime {
    let bits = bits_to_end_of_frame(frame);
    Airtime { delivery_ns: rate.time_ns(bits), occupation_ns: rate.time_ns(bits + INTERMISSION) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{Payload, reference};
    use embedded_can::ExtendedId;
    use proptest::prelude::*;

    fn check(frame: &Frame) {
        let expected = reference::stuffed_part(frame);
        let (bits, count) = stuffed_part(frame);
        assert_eq!(count as usize, expected.len());
        let bits: Vec<bool> = (0..count).rev().map(|i| bits >> i & 1 != 0).collect();
        assert_eq!(bits, expected, "{frame:?}");
        assert_eq!(stuffed_bits(frame) - count, reference::stuff_bits(frame), "{frame:?}");
    }

    fn filled(fill: u8, length: usize) -> Payload {
        Payload::from_padded([fill; 8], length)
    }

    #[test]
    fn every_standard_identifier_and_length() {
        for id in 0..=0x7FF {
            for length in 0..=8 {
                for fill in [0x00, 0x55, 0xFF, 0x0F] {
                    check(&Frame::standard(id, filled(fill, length)));
                }
            }
        }
    }

    #[test]
    fn known_length_without_stuff_bits() {
        // Identifier and data consist of alternating bits, so only length and CRC can need stuff bits.
        let without = |make: &dyn Fn(Payload) -> Frame| {
            let data = |last| Payload::new(&[0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55, last]).unwrap();
            let mut frames = (0..=u8::MAX).map(|last| make(data(last)));
            frames.find(|frame| reference::stuff_bits(frame) == 0).expect("one of these needs no stuff bit")
        };
        let id = ExtendedId::new(0x0AAA_AAAA).unwrap();
        let standard = without(&|data| Frame::standard(0x2AA, data));
        let extended = without(&|data| Frame::new(id, data));
        for (frame, ends) in [(standard, 44 + 64), (extended, 64 + 64)] {
            assert_eq!((bits_to_end_of_frame(&frame), bits(&frame)), (ends, ends + 3));
            for (bit_s, bit_ns) in [(1_000_000, 1000), (800_000, 1250), (500_000, 2000), (10_000, 100_000)] {
                let ends = u64::from(ends);
                let expected = Airtime { delivery_ns: ends * bit_ns, occupation_ns: (ends + 3) * bit_ns };
                assert_eq!(airtime(&frame, BitRate::new(bit_s).unwrap()), expected, "{bit_s} bit/s");
            }
        }
    }

    #[test]
    fn a_remote_frame_is_as_long_as_one_without_data() {
        let id = ExtendedId::new(0x0AAA_AAAA).unwrap();
        let lengths = [0, 8].map(|length| stuffed_part(&Frame::remote(id, length).unwrap()).1);
        assert_eq!(lengths, [54; 2]);
    }

    #[test]
    fn a_frame_stays_below_the_well_known_worst_case() {
        // The known bound from the literature is 8 n + 44 + (34 + 8 n - 1) / 4 bits. The extended format needs 20 bits
        // more.
        let patterns = [0x00, 0xFF, 0x78, 0x1E, 0x87, 0xE1, 0x0F, 0xF0, 0xC3, 0x3C];
        for length in 0..=8 {
            let data = 8 * length as u32;
            for id in 0..=0x7FF {
                for fill in patterns {
                    let standard = Frame::standard(id, filled(fill, length));
                    assert!(bits_to_end_of_frame(&standard) <= data + 44 + (33 + data) / 4, "{standard:?}");
                    let id = ExtendedId::new(u32::from(id) << 18 | u32::from(fill) << 10).unwrap();
                    let extended = Frame::new(id, filled(fill, length));
                    assert!(bits_to_end_of_frame(&extended) <= data + 64 + (53 + data) / 4, "{extended:?}");
                }
            }
        }
    }

    #[test]
    fn crc_matches_the_check_value_of_the_catalogue() {
        // Check value of CRC-15/CAN in the catalogue of parametrised CRC algorithms: "123456789".
        let message = b"123456789".iter().fold(0, |message, byte| message << 8 | u128::from(*byte));
        assert_eq!((crc::<STANDARD_BYTES>(message), crc::<EXTENDED_BYTES>(message)), (0x059E, 0x059E));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, ..crate::property_tests() })]
        #[test]
        fn tables_agree_with_the_bit_by_bit_reference(frame in reference::frame()) {
            check(&frame);
        }
    }
}
