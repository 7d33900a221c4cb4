//! Finds stores of other processes by comparing registers with a copy.

use super::access::load_words;
use super::{HEADER_SIZE, Segment, Width};
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// Number of bytes; ranges are extended to multiples of this number.
const LINE: usize = 64;
/// Number of words that are compared at once, because most words are unchanged. Single words are compared only if such
/// a group differs.
const AT_ONCE: usize = 256;

/// A copy of the registers in some ranges.
pub(crate) struct RegisterCopy {
    words: Vec<u32>,
    /// Buffer for the present values during a comparison.
    now: Vec<u32>,
}

/// Bytes of a word of the RAM that another process has stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct StoredBytes {
    /// Offset of the word.
    pub(crate) offset: u32,
    /// Bits of the stored bytes.
    pub(crate) mask: u32,
    /// Present value of these bytes; 0 in the other bytes.
    pub(crate) value: u32,
}

/// Returns the words that differ; the first word is at offset `first`.
fn differences(first: usize, now: &[u32], before: &[u32]) -> impl Iterator<Item = StoredBytes> {
    let words = now.iter().zip(before).enumerate().filter(|(_, (now, before))| now != before);
    words.map(move |(n, (now, before))| {
        let (is, was) = (now.to_le_bytes(), before.to_le_bytes());
        let differs = core::array::from_fn(|byte| if is[byte] == was[byte] { 0 } else { 0xFF });
        let mask = u32::from_le_bytes(differs);
        StoredBytes { offset: (first + 4 * n) as u32, mask, value: now & mask }
    })
}

impl Segment {
    /// Extends these ascending ranges to whole lines, and joins ranges that share a line.
    fn blocks(&self, ranges: &[Range<usize>]) -> impl Iterator<Item = Range<usize>> {
        let mut next = HEADER_SIZE;
        ranges.iter().map(move |range| {
            let first = (range.start / LINE * LINE).max(next);
            next = range.end.next_multiple_of(LINE).max(next);
            first..next.min(self.size()).max(first)
        })
    }

    fn copy_words(&self, ranges: &[Range<usize>], into: &mut Vec<u32>) {
        into.resize(self.blocks(ranges).map(|block| block.len() / 4).sum(), 0);
        let mut rest = into.as_mut_slice();
        for block in self.blocks(ranges).filter(|block| !block.is_empty()) {
            let (words, following) = core::mem::take(&mut rest).split_at_mut(block.len() / 4);
            // SAFETY: the block is inside the memory segment, which has a length divisible by 4, and begins at a line;
            // the memory is mapped for as long as `self` lives.
            unsafe { load_words(self.first_byte().add(block.start).cast(), words) };
            rest = following;
        }
    }

    /// Makes a copy of the registers in these ascending ranges.
    pub(crate) fn copy_registers(&self, ranges: &[Range<usize>]) -> RegisterCopy {
        let mut copy = RegisterCopy { words: Vec::new(), now: Vec::new() };
        self.renew_copy(ranges, &mut copy);
        copy
    }

    /// Reads the registers into an existing copy.
    pub(crate) fn renew_copy(&self, ranges: &[Range<usize>], copy: &mut RegisterCopy) {
        self.copy_words(ranges, &mut copy.words);
    }

    /// Returns the stores of other processes into these ranges since the copy was made, and brings the copy up to date.
    pub(crate) fn stored_since(&self, ranges: &[Range<usize>], copy: &mut RegisterCopy) -> Vec<StoredBytes> {
        self.copy_words(ranges, &mut copy.now);
        if copy.now == copy.words {
            return Vec::new();
        }
        let (mut stored, mut at) = (Vec::new(), 0);
        for block in self.blocks(ranges) {
            let words = at..at + block.len() / 4;
            at = words.end;
            let parts = copy.now[words.clone()].chunks(AT_ONCE).zip(copy.words[words].chunks(AT_ONCE));
            for (n, (now, before)) in parts.enumerate().filter(|(_, (now, before))| now != before) {
                stored.extend(differences(block.start + n * AT_ONCE * 4, now, before));
            }
        }
        core::mem::swap(&mut copy.now, &mut copy.words);
        stored
    }

    /// Repeats in this memory segment a store that another process has made in the memory segment of the same device on
    /// another host. Ignores words outside the memory segment.
    pub(crate) fn store_bytes(&self, stored: &StoredBytes) {
        let StoredBytes { offset, mask, value } = *stored;
        let _ = self.update(offset, Width::Dword, |word| word & !mask | value & mask);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::testing::DEVICE;

    #[test]
    fn stored_bytes_are_found_once_and_make_another_segment_equal() {
        let [segment, other] = [Segment::of(&DEVICE), Segment::of(&DEVICE)];
        let end = segment.size();
        let ranges =
            [HEADER_SIZE + 3..HEADER_SIZE + 70, HEADER_SIZE + 72..HEADER_SIZE + 90, end - 2..end + 500];
        let mut copy = segment.copy_registers(&ranges);
        assert_eq!(segment.stored_since(&ranges, &mut copy), []);
        let first = HEADER_SIZE as u32;
        segment.store(first + 2, Width::Byte, 0x81).unwrap();
        segment.store(first + 126, Width::Word, 0xFEDC).unwrap();
        segment.store(end as u32 - 4, Width::Dword, 0x0100_0001).unwrap();
        // This store is at an address that is not in a watched range.
        segment.store(first + 128, Width::Dword, 7).unwrap();
        let stored = segment.stored_since(&ranges, &mut copy);
        assert_eq!(
            stored,
            [
                StoredBytes { offset: first, mask: 0x00FF_0000, value: 0x0081_0000 },
                StoredBytes { offset: first + 124, mask: 0xFFFF_0000, value: 0xFEDC_0000 },
                StoredBytes { offset: end as u32 - 4, mask: 0xFF00_00FF, value: 0x0100_0001 },
            ]
        );
        assert_eq!(segment.stored_since(&ranges, &mut copy), []);
        stored.iter().for_each(|stored| other.store_bytes(stored));
        assert_eq!(other.stored_since(&ranges, &mut copy), []);
        // Outside the memory segment.
        other.store_bytes(&StoredBytes { offset: u32::MAX - 3, mask: 1, value: 1 });
    }
}
