//! The watch over the header page.

use super::rules;
use crate::journal::{Finding, Journal};
use crate::layout::Live;
use crate::memory::header::{EVENT_SLOTS, EventSlot, Header};
use crate::memory::{Bell, Cell64, MemoryError, Segment, View};
use crate::state::{Damaged, Saved, Saving, State};
use core::mem::offset_of;

const WORD: usize = size_of::<u64>();
/// Words up to the board. From there on clients and emulator write side by side, and in the requests both write the
/// same fields.
const WORDS: usize = offset_of!(Header, board) / WORD;
// They are looked at four at a time.
const _: () = assert!(WORDS.is_multiple_of(4));

/// For each word the bits that only the emulator changes, and only while the firmware runs.
const WATCHED: [u64; WORDS] = {
    let mut bytes = [true; WORDS * WORD];
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
    plc: u16,
    now: View<[Cell64; WORDS]>,
    left: [u64; WORDS],
}

impl State for HeaderWatch {
    fn save(&self, to: &mut Saving) {
        let Self { plc: _, now, left } = self;
        let rows = left.iter().zip(&**now).zip(&WATCHED);
        to.sparse(rows.map(|((left, now), watched)| (left ^ now.load()) & watched));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let differences = from.sparse::<WORDS>()?;
        for ((left, now), difference) in self.left.iter_mut().zip(&*self.now).zip(differences.iter()) {
            *left = now.load() ^ difference;
        }
        Ok(())
    }
}

impl HeaderWatch {
    pub(crate) fn new(plc: u16, segment: &Segment) -> Result<Self, MemoryError> {
        let mut watch = HeaderWatch { plc, now: segment.header_words()?, left: [0; WORDS] };
        watch.leave();
        Ok(watch)
    }

    /// Notes the page as the firmware leaves it.
    #[inline]
    pub(crate) fn leave(&mut self) {
        for (left, now) in self.left.as_chunks_mut().0.iter_mut().zip(self.now.as_chunks().0) {
            *left = Cell64::load_four(now);
        }
    }

    /// Notes the emulated time, which goes on also when the firmware has nothing to do.
    #[inline]
    pub(crate) fn show_time(&mut self, now: u64) {
        const TIME: usize = offset_of!(Header, virtual_time_us) / WORD;
        self.left[TIME] = now;
    }

    /// Reports what was written since.
    #[inline]
    pub(crate) fn look(&mut self, now: u64, journal: &mut Journal) {
        let mut bits = [0; 4];
        let (left, watched) = (self.left.as_chunks::<4>().0, WATCHED.as_chunks::<4>().0);
        let rows = self.now.as_chunks::<4>().0.iter().zip(left).zip(watched);
        for ((now, left), watched) in rows {
            let words = Cell64::load_four(now).into_iter().zip(left).zip(watched);
            for (bits, ((now, left), watched)) in bits.iter_mut().zip(words) {
                *bits |= (now ^ left) & watched;
            }
        }
        if bits != [0; 4] {
            self.report(now, journal);
        }
    }

    #[cold]
    fn report(&mut self, time: u64, journal: &mut Journal) {
        let words = self.now.iter().zip(&mut self.left).zip(&WATCHED).enumerate();
        for (index, ((now, left), watched)) in words {
            let word = now.load();
            let differs = (word ^ *left) & watched;
            // Fields are 32 or 64 bits wide, or text; of each half that differs the value is told.
            for half in [0, 1] {
                if differs >> (32 * half) & u64::from(u32::MAX) != 0 {
                    let offset = (index * WORD + 4 * half) as u32;
                    let value = (word >> (32 * half)) as u32;
                    let finding = Finding {
                        rule: &rules::HEADER,
                        plc: self.plc,
                        offset,
                        live: Live::Always,
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
    fn what_clients_write_is_not_watched() {
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
        ] {
            assert_eq!(watched(offset), is_watched, "byte {offset}");
        }
    }
}
