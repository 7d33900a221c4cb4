//! Registers and header fields in a snapshot: the RAM without its zeros, and the fields of the header page that belong
//! to the plant.
//!
//! Bells and their counters continue and are not restored, because processes may wait on them. Fields that describe the
//! instance and its processes are not saved either.

use super::access::{MemoryValue, load_words, store};
use super::{Cell32, Cell64, HEADER_SIZE, Header, Segment};
use crate::snapshot_fields::{Damaged, Saved, Saving};
use core::ops::Range;
use zerocopy::IntoBytes;

/// Number of bytes of a line. Lines of zeros are not saved.
const LINE: usize = 64;
/// Number of bytes that are copied and compared in one step. Large steps are faster. The difference is noticeable if a
/// program has filled all registers.
const CHUNK: usize = 64 * LINE;
const WORDS: usize = CHUNK / size_of::<u32>();
/// Marks the end of the saved registers, after the last run of lines.
const END: u32 = u32::MAX;

/// Returns the lines that these ranges touch, grouped into chunks. No line occurs twice.
fn chunks(ranges: &[Range<usize>]) -> impl Iterator<Item = Range<usize>> {
    let mut next = HEADER_SIZE;
    ranges.iter().flat_map(move |range| {
        let first = (range.start / LINE * LINE).max(next);
        next = range.end.next_multiple_of(LINE).max(next);
        let end = next;
        (first..end).step_by(CHUNK).map(move |at| at..end.min(at + CHUNK))
    })
}

/// Returns the lines of a chunk that are not zero, as contiguous runs.
fn runs(bytes: &[u8]) -> impl Iterator<Item = Range<usize>> {
    let mut lines = bytes.as_chunks::<LINE>().0.iter().map(|line| *line != [0; LINE]).enumerate().peekable();
    core::iter::from_fn(move || {
        let (first, _) = lines.find(|(_, is_kept)| *is_kept)?;
        let mut end = first + 1;
        while lines.next_if(|(_, is_kept)| *is_kept).is_some() {
            end += 1;
        }
        Some(first * LINE..end * LINE)
    })
}

impl Segment {
    /// Copies a chunk; bytes after the end of the memory segment are 0.
    fn copy_chunk<'a>(&self, chunk: &Range<usize>, into: &'a mut [u32; WORDS]) -> &'a [u8] {
        let words = &mut into[..chunk.len() / size_of::<u32>()];
        let existing = self.size().saturating_sub(chunk.start) / size_of::<u32>();
        let (copied, missing) = words.split_at_mut(existing.min(words.len()));
        // SAFETY: as many words as the memory segment has from here on; the start is aligned, since it is a multiple of
        // a line and the base is aligned to pages; the memory is mapped for as long as `self` lives.
        unsafe { load_words(self.first_byte().add(chunk.start).cast(), copied) };
        missing.fill(0);
        words.as_bytes()
    }

    /// Saves the registers in these ascending ranges.
    pub(crate) fn save_registers(&self, ranges: &[Range<usize>], to: &mut Saving) {
        let mut words = [0; WORDS];
        for chunk in chunks(ranges) {
            let bytes = self.copy_chunk(&chunk, &mut words);
            if bytes == &[0; CHUNK][..bytes.len()] {
                continue;
            }
            for run in runs(bytes) {
                to.value(&((chunk.start + run.start) as u32));
                to.value(&((run.len() / LINE) as u8));
                to.raw(&bytes[run]);
            }
        }
        to.value(&END);
    }

    /// Restores the registers in these ranges. Does not write registers that already have the saved value.
    pub(crate) fn restore_registers(
        &self,
        ranges: &[Range<usize>],
        from: &mut Saved<'_>,
    ) -> Result<(), Damaged> {
        let mut saved: u32 = from.value()?;
        let mut words = [0; WORDS];
        for chunk in chunks(ranges) {
            let mut wanted = [0; CHUNK];
            let (wanted, _) = wanted.split_at_mut(chunk.len());
            let mut next = 0;
            while chunk.contains(&(saved as usize)) {
                let at = saved as usize - chunk.start;
                let count = usize::from(from.value::<u8>()?);
                let run = at..at + count * LINE;
                let bytes = from.raw(run.len())?;
                let to = wanted.get_mut(run.clone()).filter(|_| at.is_multiple_of(LINE) && at >= next);
                to.ok_or_else(|| from.no("line of registers"))?.copy_from_slice(bytes);
                (next, saved) = (run.end, from.value()?);
            }
            if self.copy_chunk(&chunk, &mut words) != wanted {
                self.put(chunk.start, wanted);
            }
        }
        from.check(saved == END, "line of registers")
    }

    /// Stores words that differ, up to the end of the memory segment.
    fn put(&self, at: usize, bytes: &[u8]) {
        for (at, word) in (at..self.size()).step_by(4).zip(bytes.as_chunks().0) {
            // SAFETY: inside the memory segment, with a length that is a multiple of 4, aligned and mapped as above; a
            // memory segment with firmware is always writable.
            unsafe {
                let to = self.first_byte().add(at).cast_mut().cast::<u32>();
                let word = u32::from_ne_bytes(*word);
                if u32::load(to) != word {
                    store(to, word);
                }
            }
        }
    }
}

impl Header {
    /// Returns the fields that belong to the plant, in saved order.
    fn kept(&self) -> impl Iterator<Item = &Cell32> {
        let Header { board, program, initial_flag, opt_init, .. } = self;
        let board = [&board.dip, &board.leds, &board.display, &board.switch];
        let program = [
            &program.state,
            &program.start_request,
            &program.start_kind,
            &program.power,
            &program.restarts,
            &program.dip_latched,
            &self.program_cycles,
            &self.project_request,
            &self.project,
        ];
        let flag = initial_flag;
        let flag = [&flag.flag, &flag.width, &flag.value, &flag.request, &flag.answer, &flag.result];
        let interrupts = self.interrupts.iter().flat_map(|it| [&it.request, &it.answer, &it.result]);
        let timers = opt_init.timers.iter().flat_map(|it| [&it.divider, &it.enable, &it.cfg_mode]);
        let opt_init =
            opt_init.triggers.iter().chain([&opt_init.request, &opt_init.answer, &opt_init.result]);
        let ports = self.ports.iter().flat_map(|port| [&port.dip, &port.leds]);
        let front = board.into_iter().chain(program).chain(flag).chain(interrupts).chain(timers);
        front.chain(opt_init).chain(ports).chain([&self.board_requests]).chain(&self.front)
    }

    /// Returns times of the last events.
    fn kept_times(&self) -> impl Iterator<Item = &Cell64> {
        self.events.iter().chain(&self.triggers).chain(&self.timers).map(|slot| &slot.time_us)
    }

    /// Saves the fields of the page that belong to the plant.
    pub(crate) fn save(&self, to: &mut Saving) {
        self.kept().for_each(|cell| to.value(&cell.load()));
        self.kept_times().for_each(|cell| to.value(&cell.load()));
    }

    /// Restores the fields of the page that belong to the plant.
    pub(crate) fn restore(&self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.kept().try_for_each(|cell| from.value().map(|value| cell.store(value)))?;
        self.kept_times().try_for_each(|cell| from.value().map(|value| cell.store(value)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::Width;

    #[test]
    fn adjacent_ranges_give_each_line_once() {
        let of = |ranges: &[Range<usize>]| chunks(ranges).collect::<Vec<_>>();
        assert_eq!(
            of(&[4096..4097, 4100..4230, 4230..4231, 8200..8201]),
            [4096..4160, 4160..4288, 8192..8256],
            "the third one is inside the second one"
        );
        assert_eq!(of(std::slice::from_ref(&(4096..12_290))), [4096..8192, 8192..12_288, 12_288..12_352]);
        assert_eq!(of(&[0..10, 20..30]), [] as [Range<usize>; 0], "the header page has no registers");
    }

    #[test]
    fn runs_have_no_gap() {
        let mut bytes = [0; 6 * LINE];
        assert_eq!(runs(&bytes).count(), 0);
        for line in [0, 1, 3, 5] {
            bytes[line * LINE + line] = 1;
        }
        let lines = |run: Range<usize>| run.start / LINE..run.end / LINE;
        assert_eq!(runs(&bytes).map(lines).collect::<Vec<_>>(), [0..2, 3..4, 5..6]);
    }

    #[test]
    fn a_run_at_another_address_is_damage() {
        let segment = Segment::heap(4096 + CHUNK);
        let ranges = std::iter::once(4096..4096 + CHUNK).collect::<Vec<_>>();
        for (at, lines) in [(4096, 65), (4097, 1), (4096 + CHUNK - LINE, 2), (4096 + CHUNK, 1), (0, 1)] {
            let mut saving = Saving::default();
            saving.value(&(at as u32));
            saving.value(&(lines as u8));
            saving.raw(&vec![1; lines * LINE]);
            saving.value(&END);
            let refused = segment.restore_registers(&ranges, &mut Saved::new(saving.bytes()));
            assert!(refused.is_err(), "{lines} lines at {at}");
        }
    }

    #[test]
    fn full_chunks_are_restored() {
        let (segment, other) = (Segment::heap(4096 + 3 * CHUNK + 36), Segment::heap(4096 + 3 * CHUNK + 36));
        let ranges = std::iter::once(4096..segment.size()).collect::<Vec<_>>();
        for offset in (4096..segment.size() as u32).step_by(4) {
            segment.store(offset, Width::Dword, offset.wrapping_mul(0x9E37_79B1)).unwrap();
        }
        let mut saving = Saving::default();
        segment.save_registers(&ranges, &mut saving);
        other.restore_registers(&ranges, &mut Saved::new(saving.bytes())).unwrap();
        let held = |segment: &Segment| {
            let mut bytes = vec![0; segment.size() - 4096];
            segment.copy_bytes(4096, &mut bytes);
            bytes
        };
        assert_eq!(held(&segment), held(&other));
        segment.restore_registers(&ranges, &mut Saved::new(&[0xFF, 0xFF, 0xFF, 0xFF, 0x0F])).unwrap();
        assert!(held(&segment).iter().all(|byte| *byte == 0));
    }

    #[test]
    fn registers_are_restored_and_all_else_is_zero() {
        let (segment, ranges) = (Segment::heap(4096 + 1028), [4096..4200, 5000..5124]);
        let store = |offset, value| segment.store(offset, Width::Dword, value).unwrap();
        store(4100, 7);
        store(5120, 8);
        let mut saving = Saving::default();
        segment.save_registers(&ranges, &mut saving);
        let runs = 2 * (LINE + 1) + 2 + 2;
        assert_eq!(saving.bytes().len(), runs + 5, "two runs of a line, and the end");
        store(4100, 0);
        store(4160, 9);
        store(5120, 1);
        store(4500, 3);
        segment.restore_registers(&ranges, &mut Saved::new(saving.bytes())).unwrap();
        let held = [4100, 4160, 5120, 4500].map(|offset| segment.load(offset, Width::Dword).unwrap());
        assert_eq!(held, [7, 0, 8, 3], "the last one is outside all ranges");
        let mut rest = Saved::new(&saving.bytes()[..saving.bytes().len() - 1]);
        assert!(segment.restore_registers(&ranges, &mut rest).is_err());
        assert!(segment.restore_registers(&ranges[1..], &mut Saved::new(saving.bytes())).is_err());
    }
}
