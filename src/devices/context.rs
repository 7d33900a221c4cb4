//! What a device's firmware is given at each call.
//!
//! The firmware works on [`View`](crate::memory::View)s of register structures and does not know
//! whether they lie on the heap or in a mapped image. It has no clock of its own: the plant calls it at
//! the emulated times at which the device would look at its registers.

use crate::check::{Finding, Rule};
use crate::journal::{Event, Journal, Origin};
use crate::layout::Live;

/// What the firmware is given at each call: the time, a place to report to, and who is reporting.
pub struct Context<'a> {
    /// Emulated time in microseconds.
    pub now: u64,
    /// The journal.
    pub journal: &'a mut Journal,
    /// The node on whose behalf the firmware runs.
    pub origin: Origin,
}

impl Context<'_> {
    /// Writes `event` into the journal at the present time.
    pub fn report(&mut self, event: Event) {
        self.journal.push(self.now, event);
    }

    /// Reports that the PLC has broken a rule at the register at `offset` of the RAM, which belongs to the
    /// structure of phase `live`.
    pub fn find(&mut self, rule: Rule, live: Live, offset: u32, value: u32) {
        let plc = self.origin.plc;
        self.report(Event::Finding(Finding { rule, plc, offset, live, value, late_us: 0 }));
    }
}
