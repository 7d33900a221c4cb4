//! The watch over the header page.

use super::{Baseline, rules};
use crate::identity::DeviceIndex;
use crate::journal::{Finding, Journal};
use crate::layout::RegisterPhase;
use crate::memory::header::{EVENT_SLOTS, EventSlot, Header};
use crate::memory::{Bell, Block, Cell64, MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::mem::offset_of;

const WORD: usize = size_of::<u64>();
/// Number of watched bytes: the header page up to the field `board`. The bytes from `board` on are not
/// watched, because both clients and the emulator write them.
const BYTES: usize = offset_of!(Header, board);
/// Number of blocks that are compared.
const BLOCKS: usize = BYTES.div_ceil(Block::WORDS * WORD);
const WORDS: usize = BLOCKS * Block::WORDS;

/// For each word, the bits that only the emulator changes, and only while the firmware runs.
const WATCHED: [u64; WORDS] = {
    let mut bytes = without([true; WORDS * WORD], BYTES, WORDS * WORD - BYTES);
    bytes = without(bytes, offset_of!(Header, state), size_of::<u32>());
    bytes = without(bytes, offset_of!(Header, doorbell), size_of::<Bell>());
    bytes = without(bytes, offset_of!(Header, answer), size_of::<Bell>());
    bytes = without(bytes, offset_of!(Header, channel_reply), size_of::<Bell>());
    let mut slot = 0;
    while slot < EVENT_SLOTS {
        bytes = without(bytes, offset_of!(Header, events) + slot * size_of::<EventSlot>(), size_of::<Bell>());
        slot += 1;
    }
    let mut words = [0; WORDS];
    let mut byte = 0;
    while byte < WORDS * WORD {
        if bytes[byte] {
            words[byte / WORD] |= 0xFF << (8 * (byte % WORD));
        }
        byte += 1;
    }
    words
};

/// [`WATCHED`] as blocks.
static WATCHED_BLOCKS: [Block; BLOCKS] = {
    let mut blocks = [Block::new([0; Block::WORDS]); BLOCKS];
    let mut block = 0;
    while block < BLOCKS {
        let mut words = [0; Block::WORDS];
        let mut word = 0;
        while word < Block::WORDS {
            words[word] = WATCHED[block * Block::WORDS + word];
            word += 1;
        }
        blocks[block] = Block::new(words);
        block += 1;
    }
    blocks
};

const fn without(mut bytes: [bool; WORDS * WORD], offset: usize, len: usize) -> [bool; WORDS * WORD] {
    let mut at = offset;
    while at < offset + len {
        bytes[at] = false;
        at += 1;
    }
    bytes
}

/// The watch over the header page of a PLC.
pub(super) struct HeaderWatch {
    plc: DeviceIndex,
    now: View<[Cell64; WORDS]>,
    /// The header page after the last check, with which the present page is compared.
    left: Baseline,
}

impl SnapshotFields for HeaderWatch {
    fn save(&self, to: &mut Saving) {
        let Self { plc: _, now, left } = self;
        let rows = left.words().zip(&**now).zip(&WATCHED);
        to.sparse(rows.map(|((left, now), watched)| (left ^ now.load()) & watched));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let differences = from.sparse::<WORDS>()?;
        for ((left, now), difference) in self.left.words_mut().zip(&*self.now).zip(differences.iter()) {
            *left = now.load() ^ difference;
        }
        Ok(())
    }
}

impl HeaderWatch {
    pub(crate) fn new(plc: DeviceIndex, segment: &Segment) -> Result<Self, MemoryError> {
        let mut watch =
            HeaderWatch { plc, now: segment.header_words()?, left: Baseline::new(segment, 0, WORDS) };
        watch.left.copy(&*watch.now);
        Ok(watch)
    }

    /// Stores the present page as the baseline.
    #[inline]
    pub(crate) fn leave(&mut self) {
        self.left.copy_marked(&*self.now);
    }

    /// Stores the emulated time in the baseline. The time advances even when the firmware has nothing to do.
    #[inline]
    pub(crate) fn show_time(&mut self, now: u64) {
        const TIME: usize = offset_of!(Header, virtual_time_us) / WORD;
        if let Some(left) = self.left.word_mut(TIME) {
            *left = now;
        }
    }

    /// Stores the speed of the clock in the baseline. The emulator changes the speed between two runs of the
    /// firmware.
    pub(crate) fn show_speed(&mut self, permille: u32) {
        const SPEED: usize = offset_of!(Header, speed);
        const SHIFT: usize = 8 * (SPEED % WORD);
        if let Some(left) = self.left.word_mut(SPEED / WORD) {
            *left = *left & !(u64::from(u32::MAX) << SHIFT) | u64::from(permille) << SHIFT;
        }
    }

    /// Reports writes since the last baseline.
    #[inline]
    pub(crate) fn look(&mut self, now: u64, journal: &mut Journal) {
        if self.left.differs_in(&*self.now, &WATCHED_BLOCKS) {
            self.report(now, journal);
        }
    }

    #[cold]
    fn report(&mut self, time: u64, journal: &mut Journal) {
        let words = self.now.iter().zip(self.left.words_mut()).zip(&WATCHED).enumerate();
        for (index, ((now, left), watched)) in words {
            let word = now.load();
            let differs = (word ^ *left) & watched;
            // The fields in a word are 32 or 64 bits wide, or text. So each 32-bit half that differs is
            // reported separately.
            for half in [0, 1] {
                if differs >> (32 * half) & u64::from(u32::MAX) != 0 {
                    let offset = (index * WORD + 4 * half) as u32;
                    let value = (word >> (32 * half)) as u32;
                    let finding = Finding {
                        rule: &rules::HEADER,
                        plc: self.plc,
                        offset,
                        live: RegisterPhase::ALWAYS,
                        value,
                        late_us: 0,
                    };
                    journal.find(time, finding);
                }
            }
            *left = word;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_that_clients_write_are_not_watched() {
        let watched = |offset: usize| WATCHED[offset / WORD] >> (8 * (offset % WORD)) & 1 != 0;
        for (offset, is_watched) in [
            (0, true),
            (28, true),
            (32, false),
            (36, true),
            (56, true),
            (128, false),
            (136, true),
            (192, false),
            (256, false),
            (320, false),
            (328, true),
            (576, true),
            (700, true),
            (704, false),
        ] {
            assert_eq!(watched(offset), is_watched, "byte {offset}");
        }
    }
}
