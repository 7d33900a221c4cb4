//! What the board's firmware does behind the communication RAM.
//!
//! The firmware works on [`View`](crate::memory::View)s of register structures and does not know
//! whether they lie on the heap or in a mapped image. It has no clock of its own: the plant calls it at
//! the emulated times at which the device would look at its registers.

pub mod baps;
pub mod board;
pub mod cansync;
pub mod ethernet;

use crate::journal::{Event, Journal, Origin};

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
}
