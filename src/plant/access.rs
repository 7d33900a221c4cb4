//! Accesses of clients by address: any width, to any registers.

use super::Plant;
use crate::identity::DeviceIndex;
use crate::journal::By;
use crate::memory::{RegisterWidths, Segment, Unmapped, Width};

impl Plant {
    /// Reads a value of `width` at `offset` of PLC `plc`.
    ///
    /// # Errors
    /// No register area covers the access, or there is no such PLC. All functions here return this
    /// error.
    pub fn load(&self, plc: DeviceIndex, offset: u32, width: Width) -> Result<u32, Unmapped> {
        let (widths, ram) = self.ram(plc, offset)?;
        widths.load(ram, offset, width)
    }

    /// Writes a value of `width` at `offset` of PLC `plc`, records it in the journal and lets the checker
    /// check it.
    ///
    /// # Errors
    /// Returns the errors of [`Plant::load`].
    pub fn store(&mut self, plc: DeviceIndex, offset: u32, width: Width, value: u32) -> Result<(), Unmapped> {
        self.keep_changes(By::Program);
        let (widths, ram) = self.ram(plc, offset)?;
        widths.store(ram, offset, width, value)?;
        self.written(plc, offset, width, value);
        Ok(())
    }

    /// Stores a value like [`Plant::store`], but writes `new` only if the memory contains `current`. The inner result
    /// is the previous value: `Ok` if `new` was written, otherwise `Err`. If a forced register cannot take `new`, the
    /// result is `Err` even if the memory contains `current` (decision D-860).
    ///
    /// # Errors
    /// Returns the errors of [`Plant::load`].
    pub fn compare_exchange(
        &mut self,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        current: u32,
        new: u32,
    ) -> Result<Result<u32, u32>, Unmapped> {
        self.keep_changes(By::Program);
        if self.forces.refuse(plc, offset, width, new) {
            // A program may have written the register since the last poll.
            self.forces.apply(&self.devices);
            return self.load(plc, offset, width).map(Err);
        }
        let (widths, ram) = self.ram(plc, offset)?;
        let outcome = widths.compare_exchange(ram, offset, width, current, new)?;
        if outcome.is_ok() {
            self.written(plc, offset, width, new);
        }
        Ok(outcome)
    }

    /// Copies bytes from the image into `to`, independently of the widths of the registers.
    ///
    /// # Errors
    /// Returns the errors of [`Plant::load`].
    pub fn read_range(&self, plc: DeviceIndex, offset: u32, to: &mut [u8]) -> Result<(), Unmapped> {
        let (widths, ram) = self.ram(plc, offset)?;
        widths.read_range(ram, offset, to)
    }

    pub(super) fn ram(&self, plc: DeviceIndex, offset: u32) -> Result<(&RegisterWidths, &Segment), Unmapped> {
        let device =
            self.devices.get(plc.index()).zip(self.widths.get(plc.index())).ok_or(Unmapped { offset })?;
        Ok((device.1, device.0.segment()))
    }

    fn written(&mut self, plc: DeviceIndex, offset: u32, width: Width, value: u32) {
        // A width is 1, 2 or 4 bytes, so the conversion loses nothing.
        self.note_channel_write(plc, offset, width.bytes() as u8, value);
    }
}
