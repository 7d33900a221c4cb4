//! Values that a CAN-DP/2 keeps without supply: wake-up and SYNC time (p. 29-30; D-370).

use super::ram::SYNC_STORED;
use crate::devices::can_dp2::registers::values::wakeup_time;
use crate::devices::can_dp2::registers::{CAN_DP2_STORED, DEVICE, STORED};
use crate::devices::{Context, Firmware};
use crate::layout::Area;
use crate::memory::{MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::mem::offset_of;
use zerocopy::IntoBytes;

/// Length of the stored values.
const BYTES: usize = size_of::<CAN_DP2_STORED>();

/// Returns the area of the stored values.
pub(in crate::devices::can_dp2::emulation) fn area() -> Option<&'static Area> {
    DEVICE.areas.iter().find(|area| area.name == "stored")
}

/// Firmware of the device itself. It only handles the stored values; all other firmware runs at the ports.
pub(in crate::devices::can_dp2::emulation) struct Stored {
    registers: View<CAN_DP2_STORED>,
    stored: [u8; BYTES],
    /// Counter for changes of `stored`.
    generation: u32,
}

impl Stored {
    pub(in crate::devices::can_dp2::emulation) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        Ok(Stored { registers: segment.view(STORED)?, stored: [0; BYTES], generation: 0 })
    }

    /// If a register contains the value that means "the stored time" (p. 29-30), replaces the value by the
    /// stored time. The value itself is not stored (D-370).
    fn put_back(&self) {
        let CAN_DP2_STORED { stored_wakeup_time, stored_sync_time, .. } = &*self.registers;
        if stored_wakeup_time.load() == wakeup_time::STORED {
            stored_wakeup_time.store(self.stored[offset_of!(CAN_DP2_STORED, stored_wakeup_time)]);
        }
        if stored_sync_time.load() == SYNC_STORED {
            let at = offset_of!(CAN_DP2_STORED, stored_sync_time);
            stored_sync_time.store(u16::from_le_bytes([self.stored[at], self.stored[at + 1]]));
        }
    }
}

impl SnapshotFields for Stored {
    fn save(&self, to: &mut Saving) {
        let Self { registers: _, stored, generation: _ } = self;
        to.raw(stored);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let stored = from.raw(BYTES)?;
        // The change of the number makes the emulator write the NOVRAM file again. The file still has the
        // values from before the restoration.
        self.generation = self.generation.wrapping_add((self.stored != stored).into());
        self.stored.copy_from_slice(stored);
        Ok(())
    }
}

impl Firmware for Stored {
    fn stop(&mut self, _: &mut Context) {
        self.keep();
    }

    fn look(&mut self, _: &mut Context) {
        self.keep();
    }

    fn is_quiescent(&self) -> bool {
        true
    }

    fn kept(&self) -> Option<&'static Area> {
        area()
    }

    fn novram(&self) -> (&[u8], u32) {
        (&self.stored, self.generation)
    }

    fn keep(&mut self) {
        self.put_back();
        let mut now = [0; BYTES];
        // Source and destination are arrays of equal size by definition, so the copy cannot fail.
        let _ = self.registers.snapshot().write_to(&mut now);
        if now != self.stored {
            self.stored = now;
            self.generation = self.generation.wrapping_add(1);
        }
    }
}
