//! The access checker: reports accesses of PLC programs that contradict the manual.
//!
//! The rules are data ([`Rule`](crate::journal::Rule)); `docs/reference/checker.md` lists them. A violation is a
//! [`Finding`](crate::journal::Finding), which is an event of the journal. The journal counts the findings of each rule
//! in its table of [`Findings`](crate::journal::Findings). Findings come from two sources:
//!
//! - Before the firmware runs, a watch compares registers with their contents after the last run. So it detects writes
//!   of programs that have mapped the image. The plant reports writes through the channel to the watch. [`DeviceWatch`]
//!   is for any device; a family with rules about its registers has its own watch.
//! - The firmware reports violations when it takes over a command or initialization data.
//!
//! Nothing in this module changes a register or depends on a device.

use crate::identity::DeviceIndex;
use crate::snapshot_fields;

mod baseline;
mod header;
mod registers;
pub mod rules;
pub(crate) mod word;
mod write_rules;

pub(crate) use baseline::Baseline;
pub(crate) use registers::RegisterWatch;
#[cfg(test)]
pub(crate) use registers::with_rules;

use crate::journal::Journal;
use crate::layout::DeviceLayout;
use crate::memory::{MemoryError, Segment};
use header::HeaderWatch;

/// The watch for any device: over the header page, and over registers outside its ports that have rules for writes.
pub struct DeviceWatch {
    header: HeaderWatch,
    registers: RegisterWatch,
}

snapshot_fields!(DeviceWatch { parts: header, registers });

impl DeviceWatch {
    /// Creates the watch over device number `plc` of the plant, with the present registers as baseline.
    ///
    /// # Errors
    /// The memory segment is too small for the device.
    pub fn new(
        plc: DeviceIndex,
        segment: &Segment,
        layout: &'static DeviceLayout,
    ) -> Result<Self, MemoryError> {
        Ok(DeviceWatch {
            header: HeaderWatch::new(plc, segment)?,
            registers: RegisterWatch::of_device(plc, segment, layout)?,
        })
    }

    /// Called before the firmware runs: checks the writes since [`DeviceWatch::leave`].
    #[inline]
    pub fn look(&mut self, now: u64, journal: &mut Journal) {
        self.header.look(now, journal);
        self.registers.look(now, journal);
    }

    /// Called after the firmware has run: stores the baseline.
    #[inline]
    pub fn leave(&mut self) {
        self.header.leave();
        self.registers.leave();
    }

    /// Called when the emulator has set the speed of the clock in the header page.
    pub(crate) fn show_speed(&mut self, permille: u32) {
        self.header.show_speed(permille);
    }

    /// Called when the emulator has set the emulated time in the header page.
    #[inline]
    pub fn show_time(&mut self, now: u64) {
        self.header.show_time(now);
    }

    /// Called when a client has written `bytes` bytes at byte `offset` of the image through the channel.
    pub fn written(&mut self, offset: u32, bytes: u32, now: u64, journal: &mut Journal) {
        self.registers.written(offset, bytes, now, journal);
    }
}
