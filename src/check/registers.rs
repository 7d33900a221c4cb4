//! The watch over registers that a program must not write, or must not give some values: registers that only the firmware
//! writes, reserved registers, and registers with reserved bits or values. It is for areas without other rules.
//!
//! If structures overlay each other, the rules of the valid structure count. A program may enter a phase and write
//! registers between two checks, and their order is then unknown. Registers of a phase are therefore checked only if the
//! phase is the same at both checks (D-880).

use super::word;
use super::write_rules::WriteRule;
use crate::identity::DeviceIndex;
use crate::journal::{Finding, Journal};
use crate::layout::place::status_of;
use crate::layout::{Area, DeviceLayout, RegisterPhase, RegisterRef};
use crate::memory::{Block, Cell64, LINE, LineMarks, MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::ops::Range;
use core::slice;

const WORD: u32 = word::WORD as u32;

/// Returns the registers of a device that have rules for writes. The result does not contain the registers in the areas
/// of ports, because the firmware of a bus has its own watch for them.
#[cfg(test)]
pub(crate) fn with_rules(layout: &'static DeviceLayout) -> impl Iterator<Item = RegisterRef> {
    checked(outside_ports(layout)).map(|checked| checked.register)
}

fn outside_ports(layout: &'static DeviceLayout) -> impl Iterator<Item = &'static Area> + Clone {
    let is_ports = |area| layout.ports.iter().any(|port| core::ptr::eq(port.area, area));
    layout.areas.iter().filter(move |area| !is_ports(*area))
}

fn checked(areas: impl Iterator<Item = &'static Area>) -> impl Iterator<Item = CheckedRegister> {
    let registers = areas.flat_map(|area| area.structures.iter().flat_map(|it| area.registers_of(it)));
    registers.filter_map(|register| {
        WriteRule::of(&register).map(|rule| CheckedRegister { register, rule, phase: None })
    })
}

/// Returns the bits of a register in the 64-bit word that contains it.
fn mask(register: &RegisterRef) -> u64 {
    word::mask(register.offset(), register.width())
}

/// A register with a rule.
struct CheckedRegister {
    register: RegisterRef,
    rule: WriteRule,
    /// Index of the register that shows the phase, if other structures overlay this register.
    phase: Option<usize>,
}

/// Consecutive words with checked registers, and their baseline.
struct Run {
    /// Offset of the first word.
    first: u32,
    now: View<[Cell64; Block::WORDS]>,
    /// Values of the words after the last check.
    left: Block,
    /// Mask of the bits that are compared.
    watched: Block,
}

impl Run {
    /// Number of lines of a run.
    const LINES: usize = size_of::<Block>() / LINE;

    /// Returns the bytes of the run.
    fn bytes(&self) -> Range<usize> {
        let first = self.first as usize;
        first..first + size_of::<Block>()
    }

    /// True if a watched bit was changed after the last check.
    #[inline]
    fn differs(&self) -> bool {
        let [left, watched] = [&self.left, &self.watched].map(slice::from_ref);
        Block::differ_in(left, slice::from_ref(&*self.now), watched)
    }

    /// Stores the present values as those of the last check.
    #[inline]
    fn leave(&mut self) {
        Block::load(slice::from_mut(&mut self.left), slice::from_ref(&*self.now));
    }

    /// Returns the index of the word that contains this offset; `None` if the word is in another run.
    fn index_of(&self, offset: u32) -> Option<usize> {
        let index = (offset.checked_sub(self.first)? / WORD) as usize;
        (index < Block::WORDS).then_some(index)
    }

    /// Returns the index of the word that contains this register; `None` if this run does not compare the register.
    fn index_of_register(&self, register: &RegisterRef) -> Option<usize> {
        let index = self.index_of(register.offset())?;
        (self.watched.words()[index] & mask(register) != 0).then_some(index)
    }

    /// Returns the values after the last check of the words that contain a watched register.
    fn left_mut(&mut self) -> impl Iterator<Item = &mut u64> {
        let words = self.left.words_mut().iter_mut().zip(self.watched.words());
        words.filter(|(_, watched)| **watched != 0).map(|(left, _)| left)
    }
}

/// Runs that follow each other in memory without a gap, and the marks of the stores to them.
struct Stretch {
    runs: Range<usize>,
    /// `None` if the memory has no marks, or the marks have another reader.
    marks: Option<LineMarks>,
}

impl Stretch {
    /// Divides all runs into stretches. All runs count as stored.
    fn of(segment: &Segment, runs: &[Run]) -> Box<[Self]> {
        let adjoin = |before: &Run, run: &Run| before.bytes().end == run.bytes().start;
        let mut first = 0;
        let stretches = runs.chunk_by(adjoin).map(|part| {
            let runs = first..first + part.len();
            first = runs.end;
            let bytes = part[0].bytes().start..part[part.len() - 1].bytes().end;
            // Lines begin at multiples of their length.
            let marks = segment.line_marks(bytes.clone()).filter(|_| bytes.start.is_multiple_of(LINE));
            marks.iter().for_each(LineMarks::mark_all);
            Stretch { runs, marks }
        });
        stretches.collect()
    }

    /// True if a watched bit was changed after the last check. `runs` contains all runs of the watch.
    #[inline]
    fn differs(&self, runs: &[Run]) -> bool {
        let runs = &runs[self.runs.clone()];
        let Some(marks) = LineMarks::complete(&self.marks) else { return runs.iter().any(Run::differs) };
        let mut differs = false;
        marks.each_marked(usize::MAX, |line| differs |= runs[line / Run::LINES].differs());
        differs
    }

    /// Stores the present values as those of the last check. `runs` contains all runs of the watch.
    #[inline]
    fn leave(&self, runs: &mut [Run]) {
        let runs = &mut runs[self.runs.clone()];
        match LineMarks::complete(&self.marks) {
            None => runs.iter_mut().for_each(Run::leave),
            Some(marks) => marks.take(usize::MAX, |line| runs[line / Run::LINES].leave()),
        }
    }
}

/// The watch over registers with rules for writes.
pub(crate) struct RegisterWatch {
    plc: DeviceIndex,
    /// In ascending order of their offsets.
    registers: Box<[CheckedRegister]>,
    /// Registers that show the phase of an area with overlaid structures.
    phases: Box<[RegisterRef]>,
    runs: Box<[Run]>,
    stretches: Box<[Stretch]>,
}

impl SnapshotFields for RegisterWatch {
    fn save(&self, to: &mut Saving) {
        let Self { plc: _, registers: _, phases: _, runs, stretches: _ } = self;
        let differences = runs.iter().flat_map(|run| {
            let words = run.left.words().iter().zip(run.now.iter()).zip(run.watched.words());
            let words = words.filter(|(_, watched)| **watched != 0);
            words.map(|((left, now), watched)| (left ^ now.load()) & watched)
        });
        to.sparse(differences);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.leave();
        self.stretches.iter().filter_map(|it| it.marks.as_ref()).for_each(LineMarks::mark_all);
        let mut words: Vec<_> = self.runs.iter_mut().flat_map(Run::left_mut).collect();
        for (index, difference) in from.value::<Vec<(usize, u64)>>()? {
            **words.get_mut(index).ok_or_else(|| from.no("word"))? ^= difference;
        }
        Ok(())
    }
}

impl RegisterWatch {
    /// Creates the watch over the registers of a device outside the areas of its ports.
    ///
    /// # Errors
    /// The image is too small for the registers.
    pub(super) fn of_device(
        plc: DeviceIndex,
        segment: &Segment,
        layout: &'static DeviceLayout,
    ) -> Result<Self, MemoryError> {
        Self::new(plc, segment, outside_ports(layout))
    }

    /// Creates the watch over the registers of an area.
    ///
    /// # Errors
    /// The image is too small for the registers.
    pub(crate) fn of_area(
        plc: DeviceIndex,
        segment: &Segment,
        area: &'static Area,
    ) -> Result<Self, MemoryError> {
        Self::new(plc, segment, [area].into_iter())
    }

    fn new(
        plc: DeviceIndex,
        segment: &Segment,
        areas: impl Iterator<Item = &'static Area> + Clone,
    ) -> Result<Self, MemoryError> {
        let phases: Box<[_]> = areas.clone().filter_map(status_of).collect();
        let mut registers: Vec<_> = checked(areas).collect();
        for checked in registers.iter_mut().filter(|it| it.register.placed.live != RegisterPhase::ALWAYS) {
            checked.phase = phases.iter().position(|it| core::ptr::eq(it.area, checked.register.area));
        }
        registers.sort_by_key(|checked| checked.register.offset());
        let mut places: Vec<_> = registers.iter().map(|checked| &checked.register).chain(&phases).collect();
        places.sort_by_key(|register| register.offset());
        let mut runs: Vec<Run> = Vec::new();
        for register in places {
            if runs.last().is_none_or(|run| run.index_of(register.offset()).is_none()) {
                let (first, now) = segment.block(register.offset())?;
                let [left, watched] = [Block::new([0; Block::WORDS]); 2];
                runs.push(Run { first, now, left, watched });
            }
            if let Some(run) = runs.last_mut()
                && let Some(index) = run.index_of(register.offset())
            {
                run.watched.words_mut()[index] |= mask(register);
            }
        }
        let (registers, stretches) = (registers.into(), Stretch::of(segment, &runs));
        let mut watch = RegisterWatch { plc, registers, phases, runs: runs.into(), stretches };
        watch.leave();
        Ok(watch)
    }

    /// Stores the present registers as the baseline.
    #[inline]
    pub(crate) fn leave(&mut self) {
        self.stretches.iter().for_each(|stretch| stretch.leave(&mut self.runs));
    }

    /// Reports writes since the last baseline.
    #[inline]
    pub(crate) fn look(&mut self, now: u64, journal: &mut Journal) {
        if self.stretches.iter().any(|stretch| stretch.differs(&self.runs)) {
            self.report(now, journal);
        }
    }

    #[cold]
    fn report(&mut self, time: u64, journal: &mut Journal) {
        let phases: Vec<_> = self.phases.iter().map(|status| self.lasting_phase(status)).collect();
        let Self { plc, registers, runs, .. } = self;
        for run in runs {
            for index in 0..Block::WORDS {
                let now = run.now[index].load();
                let left = core::mem::replace(&mut run.left.words_mut()[index], now);
                let differs = (now ^ left) & run.watched.words()[index];
                if differs == 0 {
                    continue;
                }
                let offset = run.first + index as u32 * WORD;
                for checked in registers.get(within(registers, offset, WORD)).unwrap_or_default() {
                    if let Some(live) = checked.live(&phases)
                        && differs & mask(&checked.register) != 0
                    {
                        checked.judge(*plc, live, now, (time, journal));
                    }
                }
            }
        }
    }

    /// Called when a client has written `bytes` bytes through the channel. The write counts even if it has changed no
    /// value.
    pub(crate) fn written(&mut self, offset: u32, bytes: u32, time: u64, journal: &mut Journal) {
        let is_hit = |register: &RegisterRef| {
            register.offset() < offset + bytes && offset < register.offset() + register.width()
        };
        for status in self.phases.iter().filter(|status| is_hit(status)) {
            take_over(&mut self.runs, status);
        }
        let phases: Vec<_> = self.phases.iter().map(|status| self.lasting_phase(status)).collect();
        let Self { plc, registers, runs, .. } = self;
        // A register has at most as many bytes as a word.
        let first = offset.saturating_sub(WORD);
        let near = registers.get(within(registers, first, offset - first + bytes)).unwrap_or_default();
        for checked in near.iter().filter(|it| is_hit(&it.register)) {
            let Some(live) = checked.live(&phases) else { continue };
            if let Some(now) = take_over(runs, &checked.register) {
                checked.judge(*plc, live, now, (time, journal));
            }
        }
    }

    /// Returns the phase that a register shows now and showed at the last check; `None` if it has changed since then.
    fn lasting_phase(&self, status: &RegisterRef) -> Option<RegisterPhase> {
        let (run, index) = self.runs.iter().find_map(|run| Some((run, run.index_of_register(status)?)))?;
        let phase = |word| status.area.phase(Some(word::value(word, status.offset(), status.width())));
        let [was, is] = [run.left.words()[index], run.now[index].load()].map(phase);
        (was == is).then_some(is)
    }
}

/// Returns the range of the registers that begin in these bytes.
fn within(registers: &[CheckedRegister], offset: u32, bytes: u32) -> Range<usize> {
    let before = |end: u32| registers.partition_point(|it| it.register.offset() < end);
    before(offset)..before(offset + bytes)
}

/// Takes the present value of a register into the baseline. Returns its word.
fn take_over(runs: &mut [Run], register: &RegisterRef) -> Option<u64> {
    let place = |run: &mut Run| run.index_of_register(register);
    let (run, index) = runs.iter_mut().find_map(|run| place(run).map(|index| (run, index)))?;
    let now = run.now[index].load();
    let left = &mut run.left.words_mut()[index];
    *left = *left & !mask(register) | now & mask(register);
    Some(now)
}

impl CheckedRegister {
    /// Returns the phase of the register; `None` if it has changed since the last check. `phases` are those of the areas.
    fn live(&self, phases: &[Option<RegisterPhase>]) -> Option<RegisterPhase> {
        self.phase.map_or(Some(RegisterPhase::ALWAYS), |index| phases[index])
    }

    /// Reports a write that breaks the rule. `live` is the present phase of the register, and `word` is the
    /// present value of its word.
    fn judge(&self, plc: DeviceIndex, live: RegisterPhase, word: u64, (time, journal): (u64, &mut Journal)) {
        if !self.register.placed.live.is_valid_in(live) {
            return;
        }
        let offset = self.register.offset();
        let value = word::value(word, offset, self.register.width());
        if let Some(rule) = self.rule.broken_by(value) {
            journal.find(time, Finding { rule, plc, offset, live, value, late_us: 0 });
        }
    }
}
