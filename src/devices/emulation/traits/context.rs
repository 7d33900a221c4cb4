//! Arguments of each call of a device's firmware.
//!
//! The firmware works on [`View`](crate::memory::View)s of register structures. These are on the heap or in a
//! mapped image. The firmware has no clock: the plant calls it at the emulated times at which the device
//! would poll its registers.

use crate::journal::{EventText, Finding, Handshake, Journal, Origin, Rule};
use crate::layout::RegisterPhase;

/// Arguments of each call of the firmware: the time, the journal, and the node that reports.
pub struct Context<'a> {
    /// Emulated time in microseconds.
    pub now: u64,
    /// Journal of the plant, which records events of the firmware.
    pub journal: &'a mut Journal,
    /// The node for which the firmware runs.
    pub origin: Origin,
    /// Offset of the first byte of the firmware's area. The firmware gives offsets relative to this byte.
    pub base: u32,
}

impl Context<'_> {
    /// Writes an event into the journal at the present time.
    #[inline]
    pub fn report(&mut self, event: impl EventText) {
        self.journal.push(self.now, event);
    }

    /// Returns the offset in the RAM of the register at `offset` in the area.
    #[inline]
    pub fn at(&self, offset: usize) -> u32 {
        self.base + offset as u32 // areas are a few megabytes long
    }

    /// Reports the answer to a handshake register at `offset` in the area. Before the answer, the register
    /// contained `request`.
    pub fn answered(&mut self, offset: usize, request: u16, answer: u16) {
        let (origin, offset) = (self.origin, self.at(offset));
        self.report(Handshake { origin, offset, request, answer, more_answers_follow: false });
    }

    /// Reports that the PLC has broken a rule. The rule is about the register at `offset` in the area, in the
    /// structure that is valid in phase `live`.
    pub fn find(&mut self, rule: &'static Rule, live: RegisterPhase, offset: usize, value: u32) {
        let (plc, offset) = (self.origin.plc, self.at(offset));
        self.journal.find(self.now, Finding { rule, plc, offset, live, value, late_us: 0 });
    }
}
