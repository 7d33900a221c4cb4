//! The access checker of one CANsync node: detects the writes of a PLC program since the last run of the firmware.
//!
//! Access to plain RAM cannot be intercepted. So the checker keeps a copy of the node's registers after each run of the
//! firmware, and compares the registers with the copy before the next run. Each difference is a write by a program.

use super::judge::{CheckedNode, Judge};
use super::registers::{INIT_BYTES, RegisterMaps, WatchedRegister};
use super::{Facts, mapping};
use crate::check::Baseline;
use crate::check::word::WORD;
use crate::devices::cansync::registers::phases;
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT};
use crate::devices::cansync::rules;
use crate::identity::DeviceIndex;
use crate::journal::Journal;
use crate::layout::{Area, RegisterPhase, Role};
use crate::memory::{Cell64, MemoryError, Segment, View};
use crate::snapshot_fields;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use std::sync::Arc;

/// Number of 64-bit words of the longest structure.
const WORDS: usize = size_of::<CANsync_MA_CTRL_BMSTRUCT>().div_ceil(WORD);
const _: () = assert!(size_of::<CANsync_SL_CTRL_BMSTRUCT>() <= WORDS * WORD);
/// Number of words of the initialization structure.
const INIT_WORDS: usize = (INIT_BYTES as usize).div_ceil(WORD);

/// The registers of a node: the present values, and the values after the last run of the firmware.
pub(super) struct Registers {
    /// The registers as the widest possible words, for reading only.
    now: View<[Cell64; WORDS]>,
    baseline: Baseline,
}

impl Registers {
    /// Returns the present value of a byte register.
    pub(crate) fn now(&self, offset: usize) -> u8 {
        self.now.get(offset / WORD).map_or(0, |word| byte(word.load(), offset))
    }

    /// Returns the value of a byte register after the last run of the firmware.
    pub(crate) fn baseline(&self, offset: usize) -> u8 {
        byte(self.baseline.word(offset / WORD), offset)
    }

    /// Stores the first `words` words as the baseline.
    #[inline]
    fn copy(&mut self, words: usize) {
        if let Some(now) = self.now.get(..words) {
            self.baseline.copy(now);
        }
    }

    /// Does the same as [`Registers::copy`], but reads only words that were stored since the last call.
    #[inline]
    fn copy_marked(&mut self, words: usize) {
        if let Some(now) = self.now.get(..words) {
            self.baseline.copy_marked(now);
        }
    }

    /// Stores the last bytes of the initialization structure as the baseline. The next structure begins in
    /// the same word, so only a part of this word is stored.
    #[inline]
    fn copy_end_of_init(&mut self) {
        const FOLLOWING: u64 = u64::MAX << (8 * (INIT_BYTES as usize % WORD));
        if let (Some(left), Some(now)) =
            (self.baseline.word_mut(INIT_WORDS - 1), self.now.get(INIT_WORDS - 1))
        {
            *left = *left & FOLLOWING | now.load() & !FOLLOWING;
        }
    }

    /// Stores one register as the baseline.
    fn copy_register(&mut self, register: &WatchedRegister) {
        let index = usize::from(register.offset) / WORD;
        if let (Some(left), Some(now)) = (self.baseline.word_mut(index), self.now.get(index)) {
            *left = *left & !register.mask() | now.load() & register.mask();
        }
    }

    /// Collects those of the first `words` words that differ from the baseline. Each entry consists of the
    /// index and the present value.
    #[inline]
    fn compare(&self, words: usize, changed: &mut Vec<(usize, u64)>) {
        if let Some(now) = self.now.get(..words) {
            self.baseline.compare(now, changed);
        }
    }

    /// Does the same as [`Registers::compare`], but compares only words that were stored since the last copy.
    #[inline]
    fn compare_marked(&self, words: usize, changed: &mut Vec<(usize, u64)>) {
        if let Some(now) = self.now.get(..words) {
            self.baseline.compare_marked(now, changed);
        }
    }

    /// Stores one word as the baseline.
    fn set_baseline(&mut self, index: usize, word: u64) {
        if let Some(left) = self.baseline.word_mut(index) {
            *left = word;
        }
    }
}

fn byte(word: u64, offset: usize) -> u8 {
    (word >> (8 * (offset % WORD))) as u8
}

impl SnapshotFields for Registers {
    fn save(&self, to: &mut Saving) {
        to.sparse(self.baseline.words().zip(&*self.now).map(|(left, now)| left ^ now.load()));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let differences = from.sparse::<WORDS>()?;
        let words = self.baseline.words_mut().zip(&*self.now).zip(differences.iter());
        words.for_each(|((left, now), difference)| *left = now.load() ^ difference);
        Ok(())
    }
}

/// The access checker of one node.
pub(in crate::devices::cansync) struct NodeWatch {
    plc: DeviceIndex,
    /// First byte of the node's area.
    base: u32,
    maps: Arc<RegisterMaps>,
    registers: Registers,
    live: RegisterPhase,
    /// Words that differ from the baseline. This is a field only so that its memory is used again.
    changed: Vec<(usize, u64)>,
    /// True if the mapping was changed. The checker checks the mapping when the firmware takes it over.
    unsettled: bool,
}

snapshot_fields!(NodeWatch { values: live, unsettled; parts: registers; built: plc, base, maps, changed });

impl NodeWatch {
    /// Creates the checker of the node in `area` of PLC `plc`. At this moment the registers must have their
    /// values after the last run of the firmware.
    ///
    /// # Errors
    /// The memory segment is too small for the node.
    pub(crate) fn new(
        plc: DeviceIndex,
        area: &'static Area,
        role: Role,
        segment: &Segment,
    ) -> Result<Self, MemoryError> {
        let base = area.first;
        let registers = Registers { now: segment.view(base)?, baseline: Baseline::new(segment, base, WORDS) };
        let mut watch = NodeWatch {
            plc,
            base,
            maps: RegisterMaps::of(area, role),
            registers,
            live: phases::INIT,
            changed: Vec::new(),
            unsettled: false,
        };
        watch.registers.copy(WORDS);
        Ok(watch)
    }

    /// Returns the number of words of the valid structure.
    fn words(&self) -> usize {
        if self.live == phases::INIT { INIT_WORDS } else { self.maps.cyclic.len().div_ceil(WORD) }
    }

    /// Stores the registers after a run of the firmware as the baseline.
    #[inline]
    pub(crate) fn leave(&mut self, live: RegisterPhase) {
        if self.live == phases::INIT && live == phases::INIT {
            self.registers.copy(INIT_WORDS - 1);
            self.registers.copy_end_of_init();
            return;
        }
        if self.live == live {
            self.registers.copy_marked(self.words());
            return;
        }
        // At a restart the cyclic registers beyond the initialization structure keep their values. So the
        // baseline must cover the longer one of the old and the new structure.
        let words = self.words();
        self.live = live;
        let words = words.max(self.words());
        self.registers.copy(words);
    }

    /// Checks the writes since the baseline.
    #[inline]
    pub(crate) fn look(&mut self, now: u64, facts: &Facts, journal: &mut Journal) {
        self.changed.clear();
        self.registers.compare_marked(self.words(), &mut self.changed);
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
    ) -> (Judge<'a>, &'a RegisterMaps, &'a [(usize, u64)]) {
        let checked = CheckedNode { plc: self.plc, base: self.base, live: self.live };
        let judge = Judge {
            node: checked,
            now,
            facts,
            registers: &self.registers,
            journal,
            unsettled: &mut self.unsettled,
        };
        (judge, &self.maps, &self.changed)
    }

    #[cold]
    fn judge(&mut self, now: u64, facts: &Facts, journal: &mut Journal) {
        let (mut judge, maps, changed) = self.judge_with(now, facts, journal);
        let map = maps.of_phase(judge.node.live);
        for &(index, word) in changed {
            let left = judge.registers.baseline.word(index);
            for register in map.registers_with(index * WORD, left ^ word) {
                judge.write(register, register.of(left), register.of(word));
            }
        }
        // The baseline is updated only after all checks, because a rule may read the old value of another
        // register.
        let is_init = self.live == phases::INIT;
        for &(index, word) in &self.changed {
            if is_init && index == INIT_WORDS - 1 {
                self.registers.copy_end_of_init();
            } else {
                self.registers.set_baseline(index, word);
            }
        }
    }

    /// Reports writes to registers after the initialization structure. Such writes are lost, because the
    /// firmware will soon clear these registers.
    #[cold]
    fn judge_before_init(&mut self, now: u64, facts: &Facts, journal: &mut Journal) {
        self.changed.clear();
        self.registers.compare(self.maps.cyclic.len().div_ceil(WORD), &mut self.changed);
        self.changed.retain(|&(index, _)| index >= INIT_WORDS - 1);
        let (mut judge, maps, changed) = self.judge_with(now, facts, journal);
        judge.node.live = phases::CYCLIC;
        for &(index, word) in changed {
            let written =
                maps.cyclic.registers_with(index * WORD, judge.registers.baseline.word(index) ^ word);
            for register in written.filter(|register| register.offset >= INIT_BYTES) {
                judge.report_violation(&rules::BEFORE_INIT, register.offset.into(), register.of(word));
            }
        }
        for &(index, word) in &self.changed {
            self.registers.set_baseline(index, word);
        }
    }

    /// Checks a write of `bytes` bytes at byte `offset` of the image through the channel. The checker sees
    /// such a write even if it changes no value. It cannot see this for a write to the mapped image.
    pub(crate) fn written(
        &mut self,
        offset: u32,
        bytes: u32,
        now: u64,
        facts: &Facts,
        journal: &mut Journal,
    ) {
        let Some(first) = offset.checked_sub(self.base) else { return };
        let (first, bytes) = (first as usize, bytes as usize);
        let (mut judge, maps, _) = self.judge_with(now, facts, journal);
        for register in maps.of_phase(judge.node.live).registers(first, bytes) {
            let start = usize::from(register.offset);
            let Some(word) = judge.registers.now.get(start / WORD).map(Cell64::load) else { continue };
            let [before, after] =
                [judge.registers.baseline.word(start / WORD), word].map(|word| register.of(word));
            judge.write(register, before, after);
        }
        for register in self.maps.of_phase(self.live).registers(first, bytes) {
            self.registers.copy_register(register);
        }
    }

    /// Checks the mapping. The firmware has just taken it over at a SYNC edge in active operation.
    #[cold]
    pub(crate) fn settle(&mut self, now: u64, facts: &Facts, journal: &mut Journal) {
        let (mut judge, ..) = self.judge_with(now, facts, journal);
        *judge.unsettled = false;
        mapping::judge(&mut judge);
    }

    /// Returns true if the mapping was changed and must still be checked.
    #[inline]
    pub(crate) fn is_unsettled(&self) -> bool {
        self.unsettled
    }
}
