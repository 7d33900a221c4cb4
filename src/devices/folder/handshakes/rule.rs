//! A behaviour of the tables, with the places of its registers.

use crate::devices::Context;
use crate::journal::Register;
use crate::layout::{RegisterRef, Width};
use crate::memory::Segment;

/// What the device does.
#[derive(Debug)]
pub(super) enum Rule {
    /// Shows a state after power-on.
    Ready { state: Vec<Change>, after_us: u64 },
    /// Answers a value of a register, perhaps with a value that follows the answer after a time.
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
    /// Shows a state if the program does not change a register in time, and another state when the changes continue.
    Watchdog { at: Place, within_us: u64, state: Vec<Change>, recovered: Vec<Change> },
    /// Copies registers.
    Mirror { pairs: Vec<(Place, Place)> },
}

/// The place of a register in the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) offset: u32,
    pub(super) width: Width,
}

impl Place {
    pub(super) fn of(register: &RegisterRef) -> Self {
        Place { offset: register.offset(), width: register.address().width() }
    }

    /// Its largest value.
    pub(super) fn mask(self) -> u32 {
        self.width.max_value()
    }

    /// The present value. The image has all registers of the layout.
    pub(super) fn load(self, segment: &Segment) -> u32 {
        segment.load(self.offset, self.width).unwrap_or(0)
    }

    /// Replaces `from` by `to`; returns false if the program has written another value meanwhile.
    pub(super) fn exchange(self, segment: &Segment, from: u32, to: u32) -> bool {
        matches!(segment.compare_exchange(self.offset, self.width, from, to), Ok(Ok(_)))
    }

    /// Replaces the value; returns the old and the new value.
    pub(super) fn update(self, segment: &Segment, f: impl Fn(u32) -> u32) -> (u32, u32) {
        let f = |value| f(value) & self.mask();
        let before = segment.update(self.offset, self.width, f).unwrap_or(0);
        (before, f(before))
    }

    /// As [`Place::update`], with a record of a change in the journal.
    pub(super) fn show(self, ctx: &mut Context, segment: &Segment, f: impl Fn(u32) -> u32) {
        let (from, to) = self.update(segment, f);
        if from != to {
            let origin = ctx.origin;
            ctx.report(Register { origin, offset: self.offset, from, to });
        }
    }
}

/// A change of a register.
#[derive(Debug)]
pub(super) struct Change {
    pub(super) at: Place,
    pub(super) clear: u32,
    pub(super) set: u32,
}

impl Change {
    pub(super) fn apply(&self, ctx: &mut Context, segment: &Segment) {
        self.at.show(ctx, segment, |value| (value & !self.clear) | self.set);
    }
}
