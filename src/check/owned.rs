//! The watch over registers that only the firmware writes. It is for areas without other rules.

use super::{rules, word};
use crate::identity::DeviceIndex;
use crate::journal::{Finding, Journal};
use crate::layout::{Area, DeviceFit, DeviceLayout, Owner, RegisterPhase, RegisterRef};
use crate::memory::{Cell64, MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

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

/// A word with registers that only the firmware writes, and its baseline.
struct Word {
    offset: u32,
    now: View<Cell64>,
    /// Value of the word after the last check.
    left: u64,
    /// Mask of the bits that are compared.
    watched: u64,
}

/// The watch over registers that only the firmware writes.
pub(crate) struct OwnedWatch {
    plc: DeviceIndex,
    registers: Box<[RegisterRef]>,
    words: Box<[Word]>,
}

impl SnapshotFields for OwnedWatch {
    fn save(&self, to: &mut Saving) {
        let Self { plc: _, registers: _, words } = self;
        to.sparse(words.iter().map(|word| (word.left ^ word.now.load()) & word.watched));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.leave();
        for (index, difference) in from.value::<Vec<(usize, u64)>>()? {
            self.words.get_mut(index).ok_or_else(|| from.no("word"))?.left ^= difference;
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
        let mut words: Vec<Word> = Vec::new();
        for register in &registers {
            let offset = register.offset() / WORD * WORD;
            match words.last_mut().filter(|word| word.offset == offset) {
                Some(word) => word.watched |= mask(register),
                None => {
                    words.push(Word { offset, now: segment.view(offset)?, left: 0, watched: mask(register) })
                }
            }
        }
        let mut watch = OwnedWatch { plc, registers, words: words.into() };
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
        for word in &mut self.words {
            word.left = word.now.load();
        }
    }

    /// Reports writes since the last baseline.
    #[inline]
    pub(crate) fn look(&mut self, now: u64, journal: &mut Journal) {
        let differs =
            self.words.iter().fold(0, |all, word| all | (word.now.load() ^ word.left) & word.watched);
        if differs != 0 {
            self.report(now, journal);
        }
    }

    #[cold]
    fn report(&mut self, time: u64, journal: &mut Journal) {
        for word in &mut self.words {
            let now = word.now.load();
            let differs = now ^ word.left;
            let inside = |register: &&RegisterRef| register.offset() / WORD * WORD == word.offset;
            let hit = |register: &&RegisterRef| inside(register) && differs & mask(register) != 0;
            for register in self.registers.iter().filter(hit) {
                find(self.plc, register, now, time, journal);
            }
            word.left = now;
        }
    }

    /// Called when a client has written `bytes` bytes through the channel. The write counts even if it has changed no
    /// value.
    pub(crate) fn written(&mut self, offset: u32, bytes: u32, time: u64, journal: &mut Journal) {
        let hit = |register: &&RegisterRef| {
            register.offset() < offset + bytes && offset < register.offset() + register.width()
        };
        for register in self.registers.iter().filter(hit) {
            let home = |word: &&mut Word| word.offset == register.offset() / WORD * WORD;
            let Some(word) = self.words.iter_mut().find(home) else { continue };
            let now = word.now.load();
            word.left = word.left & !mask(register) | now & mask(register);
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
