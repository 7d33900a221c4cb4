//! The running hash over all events. Two runs with equal hashes are the same run.
//!
//! The hash must distinguish runs that differ in a few single bits, for example after one wrong step of an emulator.
//! With hashes for hash tables, two such differences can cancel each other. XXH3 multiplies parts of a block with each
//! other, so this does not happen. It gives the same value for the same events on every machine and in every build.
//!
//! The stream is hashed in blocks, and the hash of each block is the seed of the next block. So a snapshot stores only
//! one hash and the events of the current block.

use super::Words;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use twox_hash::XxHash3_64;

/// Events of a block.
const EVENTS: usize = 16;
/// Number of bytes of an event.
const EVENT: usize = 32;

/// Hash over a stream of events with their times.
pub(super) struct Fingerprint {
    /// Hash of all blocks before this one.
    before: u64,
    block: [u8; EVENTS * EVENT],
    /// Number of bytes in the block so far. The block always has room for one more event.
    len: usize,
}

impl Fingerprint {
    /// Hash of no events.
    pub(super) fn new() -> Self {
        Fingerprint { before: 0, block: [0; EVENTS * EVENT], len: 0 }
    }

    /// Adds an event to the hash.
    #[inline]
    pub(super) fn add(&mut self, time_us: u64, words: Words) {
        let [first, second, third] = words;
        let event = [time_us, first, second, third].map(u64::to_le);
        if let Some(room) = self.block.get_mut(self.len..self.len + EVENT) {
            room.copy_from_slice(bytemuck::bytes_of(&event));
        }
        self.len += EVENT;
        if self.len == self.block.len() {
            self.before = self.get();
            self.len = 0;
        }
    }

    /// Returns the hash of all events up to here.
    pub(super) fn get(&self) -> u64 {
        XxHash3_64::oneshot_with_seed(self.before, self.block.get(..self.len).unwrap_or_default())
    }
}

impl SnapshotFields for Fingerprint {
    fn save(&self, to: &mut Saving) {
        let Self { before, block, len } = self;
        to.value(&(before, &block[..*len]));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let events: Vec<u8>;
        (self.before, events) = from.value()?;
        self.len = events.len();
        let is_block = self.len.is_multiple_of(EVENT) && self.len < self.block.len();
        from.check(is_block, "block of events")?;
        self.block[..self.len].copy_from_slice(&events);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    /// Returns frames as the journal feeds them: time, head, eight data bytes.
    fn hash(data: &[u64]) -> u64 {
        let mut fingerprint = Fingerprint::new();
        for (n, &data) in data.iter().enumerate() {
            fingerprint.add(730 + 2000 * n as u64, [0x0001_0808_0000_0002, data, 0]);
        }
        fingerprint.get()
    }

    #[test]
    fn the_same_bit_flipped_in_two_frames_changes_it() {
        // Enough frames for several blocks.
        let frames: Vec<u64> = (0..40).map(|n| 0x0123_4567_89AB_CDEFu64.rotate_left(n)).collect();
        let mut seen = HashSet::from([hash(&frames)]);
        for bit in 0..64 {
            for first in [0, 7, 31] {
                for second in [first + 1, first + 2, frames.len() - 1] {
                    let mut flipped = frames.clone();
                    flipped[first] ^= 1 << bit;
                    flipped[second] ^= 1 << bit;
                    assert!(seen.insert(hash(&flipped)), "bit {bit} of frames {first} and {second}");
                }
            }
        }
    }

    #[test]
    fn it_is_the_same_in_every_build() {
        assert_eq!(hash(&[]), 0x2D06_8005_38D3_94C2, "XXH3 of nothing, as its specification has it");
        assert_eq!(hash(&[1, 2, 3]), 0xF053_5799_9E85_61E3, "by the reference implementation");
    }
}
