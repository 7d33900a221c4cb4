//! How long a frame is under way and how long it occupies the bus, to the bit.
//!
//! A standard data frame is start bit, identifier (11), RTR, IDE, r0, length (4), data and CRC (15); in
//! this part a bit of opposite value is stuffed in after each five equal bits. Then follow, unstuffed, the
//! CRC delimiter, the acknowledge slot and its delimiter and the end of frame (7); after it the bus
//! rests for the intermission (3) before anybody may start the next frame (ISO 11898-1).
//!
//! Every simulated frame passes through here, so both the CRC and the stuff bits come from tables.

use super::Frame;

/// Bits from start bit to CRC without data bytes and stuff bits.
const STUFFED_PART: u32 = 34;
/// CRC delimiter, acknowledge slot, acknowledge delimiter, end of frame.
const FIXED_PART: u32 = 1 + 1 + 1 + 7;
/// Intermission.
const INTERMISSION: u32 = 3;

/// Generator of the CRC: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
const POLYNOMIAL: u16 = 0x4599;
const CRC_BITS: u32 = 15;

/// The longest message under the CRC: 19 bits of header, padded to three bytes, and eight data bytes.
const MESSAGE_BYTES: usize = 11;

/// `CRC[k][b]` is the CRC of byte `b` followed by `k` zero bytes. The CRC is linear and starts at 0, so
/// that of a message is the XOR over its bytes, and the look-ups do not wait for each other.
static CRC: [[u16; 256]; MESSAGE_BYTES] = crc_tables();

const fn crc_tables() -> [[u16; 256]; MESSAGE_BYTES] {
    let mut tables = [[0; 256]; MESSAGE_BYTES];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << (CRC_BITS - 8);
        let mut zeros = 0;
        while zeros < MESSAGE_BYTES {
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

/// States of the stuffing: 0..=3 after a run of 1..=4 equal bits, 4 right behind a stuff bit.
const STATES: usize = 5;
const AFTER_STUFF_BIT: usize = 4;

/// `STUFF[changes]` says for each state what eight more bits do; `changes` has a 1 for each bit that
/// differs from its predecessor, first bit on top. State s has byte s of the entry: in its lower six bits
/// eight times the next state, above them the number of stuff bits, at most 2. So the next state is one
/// shift away from the present one, and the look-up itself does not wait for the state.
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

/// State after eight bits, and the stuff bits among them.
const fn stuff_byte(mut state: usize, changes: usize) -> (usize, u64) {
    let mut stuffed = 0;
    let mut bit = 8;
    while bit > 0 {
        bit -= 1;
        let change = changes >> bit & 1 != 0;
        state = if state == AFTER_STUFF_BIT {
            // The stuff bit is the opposite of the bit before it: a bit that repeats the latter starts a
            // run, one that differs from it is the second of the stuff bit's run.
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

/// The bits of the stuffed part, right-aligned and without stuff bits, and how many they are.
fn stuffed_part(frame: &Frame) -> (u128, u32) {
    let len = frame.payload().len().min(8);
    // Start bit, RTR, IDE and r0 are all dominant, which is 0.
    let header = u32::from(frame.id()) << 7 | len as u32;
    let data = u64::from_be_bytes(frame.padded());
    let message = (u128::from(header) << 64 | u128::from(data)) >> (64 - 8 * len);
    let bytes = message.to_le_bytes();
    let crc = CRC.iter().zip(bytes).fold(0, |crc, (table, byte)| crc ^ table[usize::from(byte)]);
    (message << CRC_BITS | u128::from(crc), STUFFED_PART + 8 * len as u32)
}

/// Number of stuff bits in the frame.
#[inline]
pub fn stuff_bits(frame: &Frame) -> u32 {
    let (bits, count) = stuffed_part(frame);
    // A 1 per change of value. The start bit differs from the idle bus; the 1s above it only keep the
    // state at "run of one bit".
    let changes = (bits ^ bits >> 1) | u128::MAX << (count - 1);
    let bytes = changes.to_be_bytes();
    let first = bytes.len() - count.div_ceil(8) as usize;
    let (mut state, mut stuffed) = (0, 0);
    for &byte in &bytes[first..] {
        state = STUFF[usize::from(byte)] >> (state & 63);
        stuffed += state >> 6 & 3;
    }
    stuffed as u32
}

/// Bits from the start bit to the end of the intermission: what the frame occupies of the bus.
#[inline]
pub fn bits(frame: &Frame) -> u32 {
    let data = 8 * frame.payload().len() as u32;
    STUFFED_PART + data + stuff_bits(frame) + FIXED_PART + INTERMISSION
}

/// Bits from the start bit to the end of the end-of-frame field: when receivers have the frame.
#[inline]
pub fn bits_to_end_of_frame(frame: &Frame) -> u32 {
    bits(frame) - INTERMISSION
}

/// How long a frame takes from the start bit on, in microseconds, rounded up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Airtime {
    /// To the end of the end-of-frame field: its receivers have it.
    pub delivery_us: u32,
    /// To the end of the intermission: the next frame may begin.
    pub occupation_us: u32,
}

/// How long the frame takes at `kbit_s` kbit/s. A bus without a bit rate never gets a frame through: `u32::MAX`.
#[inline]
pub fn airtime(frame: &Frame, kbit_s: u32) -> Airtime {
    let bits = bits(frame);
    Airtime { delivery_us: bits_to_us(bits - INTERMISSION, kbit_s), occupation_us: bits_to_us(bits, kbit_s) }
}

#[inline]
fn bits_to_us(bits: u32, kbit_s: u32) -> u32 {
    // Constant divisors for the rates in use: the division would take as long as everything else.
    match kbit_s {
        1000 => bits,
        500 => bits * 2,
        250 => bits * 4,
        125 => bits * 8,
        0 => u32::MAX,
        other => (bits * 1000).div_ceil(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cansync::bus::Payload;
    use proptest::prelude::*;

    /// The stuffed part bit by bit, as the standard describes it.
    fn reference_bits(frame: &Frame) -> Vec<bool> {
        let mut bits = vec![false];
        bits.extend((0..11).rev().map(|i| frame.id() >> i & 1 != 0));
        bits.extend([false; 3]);
        bits.extend((0..4).rev().map(|i| frame.data().len() >> i & 1 != 0));
        bits.extend(frame.data().iter().flat_map(|byte| (0..8).rev().map(move |i| byte >> i & 1 != 0)));
        let mut crc = 0u16;
        for &bit in &bits {
            let feedback = bit != (crc & 0x4000 != 0);
            crc = crc << 1 & 0x7FFF;
            if feedback {
                crc ^= 0x4599;
            }
        }
        bits.extend((0..15).rev().map(|i| crc >> i & 1 != 0));
        bits
    }

    fn reference_stuff_bits(frame: &Frame) -> u32 {
        let (mut stuffed, mut last, mut run) = (0, true, 0);
        for bit in reference_bits(frame) {
            run = if bit == last { run + 1 } else { 1 };
            last = bit;
            if run == 5 {
                stuffed += 1;
                last = !bit;
                run = 1;
            }
        }
        stuffed
    }

    fn check(frame: &Frame) {
        let reference = reference_bits(frame);
        let (bits, count) = stuffed_part(frame);
        assert_eq!(count as usize, reference.len());
        let bits: Vec<bool> = (0..count).rev().map(|i| bits >> i & 1 != 0).collect();
        assert_eq!(bits, reference, "{frame:?}");
        assert_eq!(stuff_bits(frame), reference_stuff_bits(frame), "{frame:?}");
    }

    #[test]
    fn every_identifier_and_length() {
        for id in 0..=0x7FF {
            for len in 0..=8 {
                for fill in [0x00, 0x55, 0xFF, 0x0F] {
                    check(&Frame::new(id, &[fill; 8][..len]).unwrap());
                }
            }
        }
    }

    #[test]
    fn known_length_without_stuff_bits() {
        // Identifier and data alternate all the time, so stuffing can only happen around length and CRC.
        let frame = (0..=u8::MAX)
            .map(|last| Frame::new(0x2AA, &[0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55, last]).unwrap())
            .find(|frame| reference_stuff_bits(frame) == 0)
            .expect("one of these frames needs no stuff bit");
        assert_eq!(bits_to_end_of_frame(&frame), 44 + 64);
        assert_eq!(bits(&frame), 44 + 64 + 3);
        for (kbit_s, bit_us) in [(1000, 1), (500, 2), (250, 4), (125, 8)] {
            let expected = Airtime { delivery_us: 108 * bit_us, occupation_us: 111 * bit_us };
            assert_eq!(airtime(&frame, kbit_s), expected, "{kbit_s} kbit/s");
        }
    }

    #[test]
    fn other_rates_are_rounded_up() {
        let frame = Frame::new(0x2AA, &[]).unwrap();
        let bits = bits(&frame);
        let expected =
            Airtime { delivery_us: ((bits - 3) * 5).div_ceil(4), occupation_us: (bits * 5).div_ceil(4) };
        assert_eq!(airtime(&frame, 800), expected);
        assert_eq!(airtime(&frame, 0), Airtime { delivery_us: u32::MAX, occupation_us: u32::MAX });
    }

    #[test]
    fn a_frame_stays_below_the_well_known_worst_case() {
        // 8 n + 44 + (34 + 8 n - 1) / 4 bits is the bound of the literature.
        let worst = |len: u32| 8 * len + 44 + (33 + 8 * len) / 4;
        for len in 0..=8usize {
            let longest = (0..=0x7FF).flat_map(|id| {
                [0x00, 0xFF, 0x78, 0x1E, 0x87, 0xE1, 0x0F, 0xF0, 0xC3, 0x3C]
                    .map(|fill| bits_to_end_of_frame(&Frame::new(id, &[fill; 8][..len]).unwrap()))
            });
            assert!(longest.max().unwrap() <= worst(len as u32), "{len} bytes");
        }
    }

    #[test]
    fn crc_matches_the_check_value_of_the_catalogue() {
        // Check value of CRC-15/CAN in the catalogue of parametrised CRC algorithms: "123456789".
        let crc = b"123456789".iter().rev().zip(&CRC).fold(0, |crc, (&b, table)| crc ^ table[usize::from(b)]);
        assert_eq!(crc, 0x059E);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn tables_agree_with_the_bit_by_bit_reference(id in 0u16..0x800, bytes: [u8; 8], len in 0usize..=8) {
            check(&Frame::new(id, Payload::from_padded(bytes, len).data()).unwrap());
        }

        #[test]
        fn tables_agree_on_long_runs(id in 0u16..0x800, runs in prop::collection::vec(1u32..9, 64), start: bool) {
            let (mut data, mut level, mut used) = (0u64, start, 0);
            for run in runs {
                let keep = run.min(64 - used);
                for _ in 0..keep {
                    data = data << 1 | u64::from(level);
                }
                used += keep;
                level = !level;
            }
            check(&Frame::new(id, &data.to_be_bytes()).unwrap());
        }
    }
}
