//! The watch over registers that only the firmware writes. It is for areas without other rules.

use super::{rules, word};
use crate::identity::DeviceIndex;
use crate::journal::{Finding, Journal};
use crate::layout::{Area, DeviceFit, DeviceLayout, Owner, RegisterPhase, RegisterRef};
use crate::memory::{Block, Cell64, MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

use core::slice;

const WORD: u32 = word::WORD as u32;

/// Returns the registers of a device that only its own firmware writes, in ascending order. The result does
/// not contain the registers in the areas of ports, because the firmware of a bus has its own watch for them.
pub(crate) fn owned(layout: &'static DeviceLayout) -> impl Iterator<Item = RegisterRef> {
    let is_ports = |area| layout.ports.iter().any(|port| core::ptr::eq(port.area, area));
    let areas = layout.areas.iter().filter(move |area| !is_ports(*area));
    areas.flat_map(move |area| owned_in(layout, area))
}

/// Lists the registers like [`owned`], but only of a single area.
fn owned_in(layout: &'static DeviceLayout, area: &'static Area) -> impl Iterator<Item = RegisterRef> {
    let registers = DeviceFit::unknown(layout).registers_in(area, RegisterPhase::ALWAYS);
    registers.filter(|register| register.owner() == Owner::Firmware)
}

/// Returns the bits of a register in the 64-bit word that contains it.
fn mask(register: &RegisterRef) -> u64 {
    word::mask(register.offset(), register.width())
}

/// Consecutive words with registers that only the firmware writes, and their baseline.
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
    /// Returns the index of the word that contains this offset; `None` if the word is in another run.
    fn index_of(&self, offset: u32) -> Option<usize> {
        let index = (offset.checked_sub(self.first)? / WORD) as usize;
        (index < Block::WORDS).then_some(index)
    }

    /// Returns the words that contain a watched register: their values after the last check, their present values, and
    /// the bits that are compared.
    fn words(&mut self) -> impl Iterator<Item = (&mut u64, &Cell64, u64)> {
        let words = self.left.words_mut().iter_mut().zip(self.now.iter()).zip(self.watched.words());
        words.filter(|(_, watched)| **watched != 0).map(|((left, now), watched)| (left, now, *watched))
    }
}

/// The watch over registers that only the firmware writes.
pub(crate) struct OwnedWatch {
    plc: DeviceIndex,
    registers: Box<[RegisterRef]>,
    runs: Box<[Run]>,
}

impl SnapshotFields for OwnedWatch {
    fn save(&self, to: &mut Saving) {
        let Self { plc: _, registers: _, runs } = self;
        let differences = runs.iter().flat_map(|run| {
            let words = run.left.words().iter().zip(run.now.iter()).zip(run.watched.words());
            let words = words.filter(|(_, watched)| **watched != 0);
            words.map(|((left, now), watched)| (left ^ now.load()) & watched)
        });
        to.sparse(differences);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.leave();
        let mut words: Vec<_> = self.runs.iter_mut().flat_map(Run::words).map(|(left, ..)| left).collect();
        for (index, difference) in from.value::<Vec<(usize, u64)>>()? {
            **words.get_mut(index).ok_or_else(|| from.no("word"))? ^= difference;
        }
        Ok(())
    }
}

impl OwnedWatch {
    /// Creates the watch over these registers of a device's image. The registers must be in ascending order.
    ///
    /// # Errors
    /// The image is too small for the registers.
    pub(crate) fn new(
        plc: DeviceIndex,
        segment: &Segment,
        registers: impl Iterator<Item = RegisterRef>,
    ) -> Result<Self, MemoryError> {
        let registers: Box<[_]> = registers.collect();
        let mut runs: Vec<Run> = Vec::new();
        for register in &registers {
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
        let mut watch = OwnedWatch { plc, registers, runs: runs.into() };
        watch.leave();
        Ok(watch)
    }

    /// Creates the watch over the registers that only the firmware writes in an area of `layout`. The structures of the
    /// area must always be valid.
    ///
    /// # Errors
    /// The image is too small for the registers.
    pub(crate) fn of_area(
        plc: DeviceIndex,
        segment: &Segment,
        layout: &'static DeviceLayout,
        area: &'static Area,
    ) -> Result<Self, MemoryError> {
        Self::new(plc, segment, owned_in(layout, area))
    }

    /// Stores the present registers as the baseline.
    #[inline]
    pub(crate) fn leave(&mut self) {
        for run in &mut self.runs {
            Block::load(slice::from_mut(&mut run.left), slice::from_ref(&*run.now));
        }
    }

    /// Reports writes since the last baseline.
    #[inline]
    pub(crate) fn look(&mut self, now: u64, journal: &mut Journal) {
        let differs = |run: &Run| {
            let [left, watched] = [&run.left, &run.watched].map(slice::from_ref);
            Block::differ_in(left, slice::from_ref(&*run.now), watched)
        };
        if self.runs.iter().any(differs) {
            self.report(now, journal);
        }
    }

    #[cold]
    fn report(&mut self, time: u64, journal: &mut Journal) {
        let Self { plc, registers, runs } = self;
        for run in runs {
            let first = run.first;
            for index in 0..Block::WORDS {
                let now = run.now[index].load();
                let left = core::mem::replace(&mut run.left.words_mut()[index], now);
                let (offset, differs) =
                    (first + index as u32 * WORD, (now ^ left) & run.watched.words()[index]);
                let inside = |register: &&RegisterRef| register.offset() / WORD * WORD == offset;
                let hit = |register: &&RegisterRef| inside(register) && differs & mask(register) != 0;
                if differs != 0 {
                    registers
                        .iter()
                        .filter(hit)
                        .for_each(|register| find(*plc, register, now, time, journal));
                }
            }
        }
    }

    /// Called when a client has written `bytes` bytes through the channel. The write counts even if it has changed no
    /// value.
    pub(crate) fn written(&mut self, offset: u32, bytes: u32, time: u64, journal: &mut Journal) {
        let hit = |register: &&RegisterRef| {
            register.offset() < offset + bytes && offset < register.offset() + register.width()
        };
        for register in self.registers.iter().filter(hit) {
            let place = |run: &mut Run| {
                let index = run.index_of(register.offset())?;
                (run.watched.words()[index] & mask(register) != 0).then_some(index)
            };
            let found = self.runs.iter_mut().find_map(|run| place(run).map(|index| (run, index)));
            let Some((run, index)) = found else { continue };
            let now = run.now[index].load();
            let left = &mut run.left.words_mut()[index];
            *left = *left & !mask(register) | now & mask(register);
            find(self.plc, register, now, time, journal);
        }
    }
}

fn find(plc: DeviceIndex, register: &RegisterRef, word: u64, time: u64, journal: &mut Journal) {
    let (offset, live) = (register.offset(), RegisterPhase::ALWAYS);
    let value = word::value(word, offset, register.width());
    let finding = Finding { rule: &rules::OWNER, plc, offset, live, value, late_us: 0 };
    journal.find(time, finding);
}
