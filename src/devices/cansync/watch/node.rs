//! The watch over one CANsync node: what a PLC program has written since the firmware last ran.
//!
//! Plain RAM traps nothing. So the checker keeps a copy of the node's registers as the firmware left them and
//! compares before the firmware runs again: whatever differs was written by somebody else.

use super::judge::{Judge, Place};
use super::registers::{INIT_BYTES, Maps, Watched};
use super::{Facts, mapping};
use crate::check::Baseline;
use crate::check::word::WORD;
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT};
use crate::devices::cansync::rules;
use crate::journal::Journal;
use crate::layout::{Area, RegisterPhase, Role};
use crate::memory::{Cell64, MemoryError, Segment, View};
use crate::snapshot_fields;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use std::sync::Arc;

/// 64-bit words that hold the longest structure.
const WORDS: usize = size_of::<CANsync_MA_CTRL_BMSTRUCT>().div_ceil(WORD);
const _: () = assert!(size_of::<CANsync_SL_CTRL_BMSTRUCT>() <= WORDS * WORD);
/// Words that hold the initialization structure.
const INIT_WORDS: usize = (INIT_BYTES as usize).div_ceil(WORD);

/// The registers of a node, now and as the firmware left them.
pub(super) struct Registers {
    /// In words as wide as possible, and only ever loaded.
    now: View<[Cell64; WORDS]>,
    left: Baseline,
}

impl Registers {
    /// A byte register as it is now.
    pub(crate) fn now(&self, offset: usize) -> u8 {
        self.now.get(offset / WORD).map_or(0, |word| byte(word.load(), offset))
    }

    /// A byte register as the firmware left it.
    pub(crate) fn left(&self, offset: usize) -> u8 {
        byte(self.left.word(offset / WORD), offset)
    }

    /// Notes the first `words` words as they are now.
    #[inline]
    fn copy(&mut self, words: usize) {
        if let Some(now) = self.now.get(..words) {
            self.left.copy(now);
        }
    }

    /// Notes the last bytes of the initialization structure, which share a word with what lies behind.
    #[inline]
    fn copy_end_of_init(&mut self) {
        const BEHIND: u64 = u64::MAX << (8 * (INIT_BYTES as usize % WORD));
        if let (Some(left), Some(now)) = (self.left.word_mut(INIT_WORDS - 1), self.now.get(INIT_WORDS - 1)) {
            *left = *left & BEHIND | now.load() & !BEHIND;
        }
    }

    /// Notes one register.
    fn copy_register(&mut self, register: &Watched) {
        let index = usize::from(register.offset) / WORD;
        if let (Some(left), Some(now)) = (self.left.word_mut(index), self.now.get(index)) {
            *left = *left & !register.mask() | now.load() & register.mask();
        }
    }

    /// Collects those of the first `words` words that differ, with what they hold now.
    #[inline]
    fn compare(&self, words: usize, changed: &mut Vec<(usize, u64)>) {
        if let Some(now) = self.now.get(..words) {
            self.left.compare(now, changed);
        }
    }

    /// Notes one word.
    fn set_left(&mut self, index: usize, word: u64) {
        if let Some(left) = self.left.word_mut(index) {
            *left = word;
        }
    }
}

fn byte(word: u64, offset: usize) -> u8 {
    (word >> (8 * (offset % WORD))) as u8
}

impl SnapshotFields for Registers {
    fn save(&self, to: &mut Saving) {
        to.sparse(self.left.words().zip(&*self.now).map(|(left, now)| left ^ now.load()));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let differences = from.sparse::<WORDS>()?;
        let words = self.left.words_mut().zip(&*self.now).zip(differences.iter());
        words.for_each(|((left, now), difference)| *left = now.load() ^ difference);
        Ok(())
    }
}

/// The watch over a node.
pub(in crate::devices::cansync) struct NodeWatch {
    plc: u16,
    /// First byte of the node's area.
    base: usize,
    maps: Arc<Maps>,
    registers: Registers,
    live: RegisterPhase,
    /// Words that differ. Kept for its memory.
    changed: Vec<(usize, u64)>,
    /// The mapping was changed and is judged when the firmware takes it over.
    unsettled: bool,
}

snapshot_fields!(NodeWatch { values: live, unsettled; parts: registers; built: plc, base, maps, changed });

impl NodeWatch {
    /// The watch over the node in `area` of PLC `plc`, whose registers are as the firmware left them.
    ///
    /// # Errors
    /// If the segment is too small for it.
    pub(crate) fn new(
        plc: u16,
        area: &'static Area,
        role: Role,
        segment: &Segment,
    ) -> Result<Self, MemoryError> {
        let base = area.first as usize;
        let registers = Registers { now: segment.view(base)?, left: Baseline::new(WORDS) };
        let mut watch = NodeWatch {
            plc,
            base,
            maps: Maps::of(area, role),
            registers,
            live: RegisterPhase::Init,
            changed: Vec::new(),
            unsettled: false,
        };
        watch.registers.copy(WORDS);
        Ok(watch)
    }

    /// Words of the structure that is valid.
    fn words(&self) -> usize {
        if self.live == RegisterPhase::Init { INIT_WORDS } else { self.maps.cyclic.len().div_ceil(WORD) }
    }

    /// Notes the registers as the firmware leaves them.
    #[inline]
    pub(crate) fn leave(&mut self, live: RegisterPhase) {
        if self.live == RegisterPhase::Init && live == RegisterPhase::Init {
            self.registers.copy(INIT_WORDS - 1);
            self.registers.copy_end_of_init();
            return;
        }
        // A node that was restarted still has its cyclic registers behind the initialization structure.
        let words = self.words();
        self.live = live;
        let words = words.max(self.words());
        self.registers.copy(words);
    }

    /// Judges what was written since.
    #[inline]
    pub(crate) fn look(&mut self, now: u64, facts: &Facts, journal: &mut Journal) {
        self.changed.clear();
        self.registers.compare(self.words(), &mut self.changed);
        if !self.changed.is_empty() {
            self.judge(now, facts, journal);
        }
        if facts.takes_over_init {
            self.judge_before_init(now, facts, journal);
        }
    }

    fn judge_with<'a>(
        &'a mut self,
        now: u64,
        facts: &'a Facts,
        journal: &'a mut Journal,
    ) -> (Judge<'a>, &'a Maps, &'a [(usize, u64)]) {
        let place = Place { plc: self.plc, base: self.base, live: self.live };
        let judge =
            Judge { place, now, facts, registers: &self.registers, journal, unsettled: &mut self.unsettled };
        (judge, &self.maps, &self.changed)
    }

    #[cold]
    fn judge(&mut self, now: u64, facts: &Facts, journal: &mut Journal) {
        let (mut judge, maps, changed) = self.judge_with(now, facts, journal);
        let map = maps.of_phase(judge.place.live);
        for &(index, word) in changed {
            let left = judge.registers.left.word(index);
            for register in map.registers_with(index * WORD, left ^ word) {
                judge.write(register, register.of(left), register.of(word));
            }
        }
        // Only now: a rule may look at what other registers held before.
        let is_init = self.live == RegisterPhase::Init;
        for &(index, word) in &self.changed {
            if is_init && index == INIT_WORDS - 1 {
                self.registers.copy_end_of_init();
            } else {
                self.registers.set_left(index, word);
            }
        }
    }

    /// The firmware is going to clear everything behind the initialization structure: what was written there
    /// is lost.
    #[cold]
    fn judge_before_init(&mut self, now: u64, facts: &Facts, journal: &mut Journal) {
        self.changed.clear();
        self.registers.compare(self.maps.cyclic.len().div_ceil(WORD), &mut self.changed);
        self.changed.retain(|&(index, _)| index >= INIT_WORDS - 1);
        let (mut judge, maps, changed) = self.judge_with(now, facts, journal);
        judge.place.live = RegisterPhase::Cyclic;
        for &(index, word) in changed {
            let written = maps.cyclic.registers_with(index * WORD, judge.registers.left.word(index) ^ word);
            for register in written.filter(|register| register.offset >= INIT_BYTES) {
                judge.find(&rules::BEFORE_INIT, register.offset.into(), register.of(word));
            }
        }
        for &(index, word) in &self.changed {
            self.registers.set_left(index, word);
        }
    }

    /// A write of `bytes` bytes at byte `offset` of the image came through the channel. Unlike those through the map it
    /// is seen even if it has changed nothing.
    pub(crate) fn written(
        &mut self,
        offset: usize,
        bytes: usize,
        now: u64,
        facts: &Facts,
        journal: &mut Journal,
    ) {
        let Some(offset) = offset.checked_sub(self.base) else { return };
        let (mut judge, maps, _) = self.judge_with(now, facts, journal);
        for register in maps.of_phase(judge.place.live).registers(offset, bytes) {
            let start = usize::from(register.offset);
            let Some(word) = judge.registers.now.get(start / WORD).map(Cell64::load) else { continue };
            let [before, after] =
                [judge.registers.left.word(start / WORD), word].map(|word| register.of(word));
            judge.write(register, before, after);
        }
        for register in self.maps.of_phase(self.live).registers(offset, bytes) {
            self.registers.copy_register(register);
        }
    }

    /// The firmware has taken the mapping over, at a SYNC edge in active operation.
    #[cold]
    pub(crate) fn settle(&mut self, now: u64, facts: &Facts, journal: &mut Journal) {
        let (mut judge, ..) = self.judge_with(now, facts, journal);
        *judge.unsettled = false;
        mapping::judge(&mut judge);
    }

    /// Whether the mapping waits to be judged.
    #[inline]
    pub(crate) fn is_unsettled(&self) -> bool {
        self.unsettled
    }
}
