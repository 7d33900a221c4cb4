//! The watch over the registers of BAPS and Ethernet diagnosis that only the firmware writes. The CANsync nodes have
//! a [`NodeWatch`](super::node::NodeWatch), which knows many more rules.

use super::{rules, word};
use crate::devices::omega_drive_line_2::registers::{BAPS, DEVICE, ETHERNET};
use crate::journal::{Finding, Journal};
use crate::layout::{Live, Owner, RegisterRef};
use crate::memory::{Cell64, MemoryError, Segment, View};
use std::sync::LazyLock;

const WORD: u32 = word::WORD as u32;

/// The registers, in ascending order.
static OWNED: LazyLock<Vec<RegisterRef>> = LazyLock::new(|| {
    let areas = DEVICE.areas.iter().filter(|area| [BAPS, ETHERNET].contains(&(area.first as usize)));
    let registers = areas.flat_map(|area| area.registers(Live::Always));
    registers.filter(|register| register.owner() == Owner::Firmware).collect()
});

/// The bits of a register in its word.
fn mask(register: &RegisterRef) -> u64 {
    word::mask(register.offset(), register.width())
}

/// A word with such registers in it, now and as the firmware left it.
struct Word {
    offset: u32,
    now: View<Cell64>,
    left: u64,
    watched: u64,
}

/// The watch over a PLC's registers.
pub(super) struct OwnedWatch {
    plc: u16,
    words: Box<[Word]>,
}

impl OwnedWatch {
    pub fn new(plc: u16, segment: &Segment) -> Result<Self, MemoryError> {
        let mut words: Vec<Word> = Vec::new();
        for register in OWNED.iter() {
            let offset = register.offset() / WORD * WORD;
            match words.last_mut().filter(|word| word.offset == offset) {
                Some(word) => word.watched |= mask(register),
                None => words.push(Word {
                    offset,
                    now: segment.view(offset as usize)?,
                    left: 0,
                    watched: mask(register),
                }),
            }
        }
        let mut watch = OwnedWatch { plc, words: words.into() };
        watch.leave();
        Ok(watch)
    }

    /// Notes the registers as the firmware leaves them.
    #[inline]
    pub fn leave(&mut self) {
        for word in &mut self.words {
            word.left = word.now.load();
        }
    }

    /// Reports what was written since.
    #[inline]
    pub fn look(&mut self, now: u64, journal: &mut Journal) {
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
            for register in OWNED.iter().filter(inside).filter(|register| differs & mask(register) != 0) {
                find(self.plc, register, now, time, journal);
            }
            word.left = now;
        }
    }

    /// A write of `bytes` bytes came through the channel, which is seen even if it has changed nothing.
    pub fn written(&mut self, offset: u32, bytes: u32, time: u64, journal: &mut Journal) {
        let hit = |register: &&RegisterRef| {
            register.offset() < offset + bytes && offset < register.offset() + register.width()
        };
        for register in OWNED.iter().filter(hit) {
            let home = |word: &&mut Word| word.offset == register.offset() / WORD * WORD;
            let Some(word) = self.words.iter_mut().find(home) else { continue };
            let now = word.now.load();
            word.left = word.left & !mask(register) | now & mask(register);
            find(self.plc, register, now, time, journal);
        }
    }
}

fn find(plc: u16, register: &RegisterRef, word: u64, time: u64, journal: &mut Journal) {
    let (offset, live) = (register.offset(), Live::Always);
    let value = word::value(word, offset, register.width());
    let finding = Finding { rule: &rules::OWNER, plc, offset, live, value, late_us: 0 };
    journal.find(time, finding);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_register_maps_say_what_is_watched() {
        let names: Vec<_> = OWNED.iter().map(RegisterRef::name).collect();
        for name in ["baps.w_STATUSWORD", "baps.a_RD_VALUE[7]", "ethernet.w_DIP_NR"] {
            assert!(names.iter().any(|it| it == name), "{name} in {names:?}");
        }
        assert!(!names.iter().any(|name| name == "baps.w_CONTROLWORD"), "{names:?}");
        let offsets: Vec<_> = OWNED.iter().map(RegisterRef::offset).collect();
        assert!(offsets.is_sorted(), "each word is there once: {offsets:?}");
    }
}
