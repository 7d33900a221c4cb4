//! Bytes of an up-/download in `a_DATA_UPDOWNBLK1`: byte n is byte n mod 4 of doubleword n / 4, low byte
//! first (decision D-01). The firmware reads and writes whole doublewords.

use crate::devices::cansync::frames::codec::updown::BLOCK;
use crate::memory::Cell32;

/// Doublewords of the data area (manual 5.00005.03a p. 166).
const DOUBLEWORDS: usize = 75;
/// Number of bytes of the data area (manual 5.00005.03a p. 167).
pub(super) const MAX_LENGTH: u16 = 4 * DOUBLEWORDS as u16;

/// Returns the bytes of a frame, beginning at `offset` in the area. Bytes beyond the first `length` bytes of
/// the area are 0 (decision D-44).
pub(super) fn read(area: &[Cell32; DOUBLEWORDS], offset: u16, length: u16) -> [u8; BLOCK] {
    let mut data = [0; BLOCK];
    for (position, byte) in (offset..length.min(MAX_LENGTH)).zip(&mut data) {
        let (cell, shift) = cell_at(area, position);
        *byte = cell.map_or(0, |cell| (cell.load() >> shift) as u8);
    }
    data
}

/// Stores the bytes of a frame, beginning at `offset` in the area. Only bytes within the first `length` bytes
/// of the area are stored; all other bytes of the area keep their values.
pub(super) fn write(area: &[Cell32; DOUBLEWORDS], offset: u16, length: u16, data: [u8; BLOCK]) {
    for (position, byte) in (offset..length.min(MAX_LENGTH)).zip(data) {
        if let (Some(cell), shift) = cell_at(area, position) {
            cell.store(cell.load() & !(0xFF << shift) | u32::from(byte) << shift);
        }
    }
}

fn cell_at(area: &[Cell32; DOUBLEWORDS], position: u16) -> (Option<&Cell32>, u32) {
    (area.get(usize::from(position / 4)), 8 * u32::from(position % 4))
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::array;
    use zerocopy::FromZeros;

    fn area() -> [Cell32; DOUBLEWORDS] {
        array::from_fn(|_| Cell32::new_zeroed())
    }

    #[test]
    fn bytes_are_stored_low_byte_first() {
        let area = area();
        area[0].store(0x4433_2211);
        area[1].store(0x8877_6655);
        area[2].store(0xCCBB_AA99);
        assert_eq!(read(&area, 0, 300), [0x11, 0x22, 0x33, 0x44, 0x55, 0x66]);
        assert_eq!(read(&area, 6, 300), [0x77, 0x88, 0x99, 0xAA, 0xBB, 0xCC]);
        assert_eq!(read(&area, 6, 9), [0x77, 0x88, 0x99, 0, 0, 0], "the last frame is filled with 0");
    }

    #[test]
    fn only_bytes_of_the_length_are_written() {
        let area = area();
        area[1].store(0xFFFF_FFFF);
        write(&area, 0, 5, [1, 2, 3, 4, 5, 6]);
        assert_eq!((area[0].load(), area[1].load()), (0x0403_0201, 0xFFFF_FF05));
    }

    #[test]
    fn no_byte_is_stored_beyond_the_area() {
        let area = area();
        write(&area, 294, u16::MAX, [9; BLOCK]);
        write(&area, 300, u16::MAX, [9; BLOCK]);
        assert_eq!(read(&area, 294, u16::MAX), [9; BLOCK]);
        assert_eq!(read(&area, 300, u16::MAX), [0; BLOCK]);
    }

    #[test]
    fn written_bytes_are_read_back_at_every_length() {
        for length in 1..=MAX_LENGTH {
            let area = area();
            let byte = |n: u16| (n as u8).wrapping_mul(7).wrapping_add(1);
            for offset in (0..length).step_by(BLOCK) {
                write(&area, offset, length, array::from_fn(|n| byte(offset + n as u16)));
            }
            for offset in (0..length).step_by(BLOCK) {
                let expected =
                    array::from_fn(
                        |n| if offset + (n as u16) < length { byte(offset + n as u16) } else { 0 },
                    );
                assert_eq!(read(&area, offset, length), expected, "{offset} of {length}");
            }
        }
    }
}
