//! The two registers through which a slave's application and the firmware hand a job to and fro
//! (manual 5.00005.03a p. 189, 191).
//!
//! The control register decides. Who writes, writes the status register first and the control register
//! then; who reads, reads the control register first.

use crate::firmware::Context;
use crate::journal::Event;
use crate::memory::Cell8;

/// Bit 0: set by the firmware when a job arrives, cleared by the application when it is done with it.
pub(super) const ACTIVE: u8 = 1 << 0;
/// Bit 5: set by the application together with an error number.
pub(super) const ERROR: u8 = 1 << 5;
/// Bit 6: the answer has not been sent yet.
pub(super) const BUSY: u8 = 1 << 6;
/// Bit 7: the application has seen that the master changed the job.
pub(super) const RESET: u8 = 1 << 7;

/// Control and status register of a job.
pub(super) struct Handshake<'a> {
    pub(super) control: &'a Cell8,
    pub(super) status: &'a Cell8,
    /// Absolute `%MB3` offset of the control register, for the journal.
    pub(super) offset: usize,
}

impl Handshake<'_> {
    /// The register that decides.
    pub(super) fn control(&self) -> u8 {
        self.control.load()
    }

    /// Shows a job to the application, whatever was in the registers. Data come first.
    pub(super) fn show(&self, ctx: &mut Context, value: u8) {
        self.change(ctx, |_| value);
    }

    /// Changes bits without losing what the application writes at the same time.
    pub(super) fn change(&self, ctx: &mut Context, change: impl Fn(u8) -> u8) {
        self.status.update(&change);
        let before = self.control.update(&change);
        let after = change(before);
        if before != after {
            let (origin, offset) = (ctx.origin, self.offset as u32);
            ctx.report(Event::Handshake {
                origin,
                offset,
                request: u16::from(before),
                answer: u16::from(after),
            });
        }
    }
}
