//! Behaviours that tables describe, with the places of their registers in the image.

use crate::devices::Context;
use crate::devices::folder::card::{Card, Place};

/// A behaviour of the device.
#[derive(Debug)]
pub(super) enum Rule {
    /// Shows a state after power-on.
    Ready { state: Vec<Change>, after_us: u64 },
    /// Answers a value of a register. A second value may follow the answer after a time.
    Answer {
        at: Place,
        request: u16,
        answer: u16,
        after_us: u64,
        then: Option<(u16, u64)>,
        state: Vec<Change>,
    },
    /// Copies bits after a time.
    Toggle { from: Place, to: Place, bits: u32, after_us: u64 },
    /// Counts time.
    Counter { at: Place, every_us: u64 },
    /// Shows a state if the program does not change a register in time. Shows another state when the program
    /// changes the register again.
    Watchdog { at: Place, within_us: u64, state: Vec<Change>, recovered: Vec<Change> },
    /// Copies registers.
    Mirror { pairs: Vec<(Place, Place)> },
    /// The PROFIBUS port exchanges a process image. The firmware of the port does this.
    Image,
}

/// A change of a register.
#[derive(Debug)]
pub(super) struct Change {
    pub(super) at: Place,
    pub(super) clear: u32,
    pub(super) set: u32,
}

impl Change {
    pub(super) fn apply(&self, ctx: &mut Context, card: &mut Card) {
        card.show(ctx, self.at, |value| (value & !self.clear) | self.set);
    }
}
