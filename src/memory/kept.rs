//! What a snapshot holds of the RAM: where it is not 0, and what of the header page is the plant's own.
//!
//! Bells and the counters beside them count on whatever is restored, since somebody may be waiting on them; what belongs to
//! the instance and to the processes that take part in it is no part of the plant.

use super::access::{Value, load_four};
use super::{Cell32, Cell64, HEADER_SIZE, Header, Segment};
use crate::state::{Damaged, Saved, Saving};
use core::ops::Range;

/// What is compared and kept at once.
const LINE: usize = 64;
const WORDS: usize = LINE / size_of::<u64>();
/// Stands behind the last line.
const END: u32 = u32::MAX;

/// The lines in which these ranges lie, each once.
fn lines(ranges: &[Range<usize>]) -> impl Iterator<Item = usize> {
    let mut next = HEADER_SIZE;
    ranges.iter().flat_map(move |range| {
        let first = (range.start / LINE * LINE).max(next);
        next = range.end.next_multiple_of(LINE).max(next);
        (first..next).step_by(LINE)
    })
}

impl Segment {
    /// The line at `at`; what lies behind the end of the segment is 0.
    #[inline]
    fn line(&self, at: usize) -> [u64; WORDS] {
        let mut line = [0; WORDS];
        if at + LINE <= self.size() {
            for (index, four) in line.as_chunks_mut().0.iter_mut().enumerate() {
                // SAFETY: the line lies inside the segment (just checked) and is aligned, since the base is aligned to
                // pages; the memory is mapped for as long as `self` lives, and accessed by that module only.
                *four = unsafe { load_four(self.base().add(at).cast::<[u64; 4]>().add(index)) };
            }
            return line;
        }
        let mut bytes = [0; LINE];
        let there = self.size().saturating_sub(at);
        self.copy_bytes(at, &mut bytes[..there]);
        line.iter_mut().zip(bytes.as_chunks().0).for_each(|(word, bytes)| *word = u64::from_ne_bytes(*bytes));
        line
    }

    /// Whether the line at `at` lies inside the segment and is 0. Most lines are, so nothing is copied for that.
    #[inline(always)]
    fn is_blank(&self, at: usize) -> bool {
        if at + LINE > self.size() {
            return false;
        }
        // SAFETY: as in `line`.
        let four = |index| unsafe { load_four(self.base().add(at).cast::<[u64; 4]>().add(index)) };
        four(0).iter().chain(&four(1)).fold(0, |all, word| all | word) == 0
    }

    /// Saves the registers in these ranges, which ascend.
    pub(crate) fn save_registers(&self, ranges: &[Range<usize>], to: &mut Saving) {
        for at in lines(ranges).filter(|at| !self.is_blank(*at)) {
            let line = self.line(at);
            if line != [0; WORDS] {
                to.value(&((at / LINE) as u32));
                to.raw(line.map(u64::to_ne_bytes).as_flattened());
            }
        }
        to.value(&END);
    }

    /// Restores the registers in these ranges. Those that are as they were saved are not written.
    pub(crate) fn restore_registers(
        &self,
        ranges: &[Range<usize>],
        from: &mut Saved<'_>,
    ) -> Result<(), Damaged> {
        let mut saved: u32 = from.value()?;
        for at in lines(ranges) {
            if saved as usize != at / LINE {
                if !self.is_blank(at) {
                    self.put(at, &[0; LINE]);
                }
                continue;
            }
            let mut bytes = [0; LINE];
            bytes.copy_from_slice(from.raw(LINE)?);
            saved = from.value()?;
            let mut line = [0; WORDS];
            line.iter_mut().zip(bytes.as_chunks().0).for_each(|(to, bytes)| *to = u64::from_ne_bytes(*bytes));
            if self.line(at) != line {
                self.put(at, &bytes);
            }
        }
        from.check(saved == END, "line of registers")
    }

    fn put(&self, at: usize, bytes: &[u8; LINE]) {
        for (at, word) in (at..self.size()).step_by(4).zip(bytes.as_chunks().0) {
            // SAFETY: inside the segment, whose length is a multiple of 4, aligned and mapped as above; only a segment
            // that is writable has firmware.
            unsafe {
                let to = self.base().add(at).cast_mut().cast::<u32>();
                let word = u32::from_ne_bytes(*word);
                if u32::load(to) != word {
                    u32::store(to, word);
                }
            }
        }
    }
}

impl Header {
    /// What belongs to the plant, in the order in which it is kept.
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

    /// When what occurred last.
    fn kept_times(&self) -> impl Iterator<Item = &Cell64> {
        self.events.iter().chain(&self.triggers).chain(&self.timers).map(|slot| &slot.time_us)
    }

    /// Saves what of the page belongs to the plant.
    pub(crate) fn save(&self, to: &mut Saving) {
        self.kept().for_each(|cell| to.value(&cell.load()));
        self.kept_times().for_each(|cell| to.value(&cell.load()));
    }

    /// Restores it.
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
    fn lines_of_ranges_that_meet_come_once() {
        let of = |ranges: &[Range<usize>]| lines(ranges).collect::<Vec<_>>();
        assert_eq!(of(&[4096..4097, 4100..4230, 4230..4231, 8200..8201]), [4096, 4160, 4224, 8192]);
        assert_eq!(of(&[0..10, 20..30]), [] as [usize; 0], "the header page has no registers");
    }

    #[test]
    fn registers_come_back_and_all_else_is_zero() {
        let (segment, ranges) = (Segment::heap(4096 + 1028), [4096..4200, 5000..5124]);
        let store = |offset, value| segment.store(offset, Width::Dword, value).unwrap();
        store(4100, 7);
        store(5120, 8);
        let mut saving = Saving::default();
        segment.save_registers(&ranges, &mut saving);
        assert_eq!(saving.bytes().len(), 2 * (1 + LINE) + 5);
        store(4100, 0);
        store(4160, 9);
        store(5120, 1);
        store(4500, 3);
        segment.restore_registers(&ranges, &mut Saved::new(saving.bytes())).unwrap();
        let held = [4100, 4160, 5120, 4500].map(|offset| segment.load(offset, Width::Dword).unwrap());
        assert_eq!(held, [7, 0, 8, 3], "the last one lies in no range");
        let mut rest = Saved::new(&saving.bytes()[..saving.bytes().len() - 1]);
        assert!(segment.restore_registers(&ranges, &mut rest).is_err());
        assert!(segment.restore_registers(&ranges[1..], &mut Saved::new(saving.bytes())).is_err());
    }
}
