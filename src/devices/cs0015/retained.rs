//! What a CS0015 keeps without supply besides its retain flags: the parameters that p. 155 has saved automatically, and the EEPROM.

use super::registers::{CS0015_PARAMETERS, DEVICE, PARAMETERS};
use crate::layout::Area;
use crate::memory::{MemoryError, Segment, View};
use crate::state::{Damaged, Saved, Saving, State};
use zerocopy::IntoBytes;

/// Its length.
const BYTES: usize = size_of::<CS0015_PARAMETERS>();
/// What tells that something has changed: everything but the EEPROM, whose writes are counted there.
const HEAD: usize = core::mem::offset_of!(CS0015_PARAMETERS, a_EEPROM);

/// Where it lies.
pub(super) fn area() -> Option<&'static Area> {
    DEVICE.areas.iter().find(|area| area.name == "parameters")
}

/// It as it is stored.
pub(super) struct Retained {
    parameters: View<CS0015_PARAMETERS>,
    segment: Segment,
    stored: [u8; BYTES],
    /// Counts changes of `stored`.
    generation: u32,
}

impl State for Retained {
    fn save(&self, to: &mut Saving) {
        let Self { parameters: _, segment: _, stored, generation: _ } = self;
        to.raw(stored);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let stored = from.raw(BYTES)?;
        // Its number goes on: the file has what was there before.
        self.generation = self.generation.wrapping_add((self.stored != stored).into());
        self.stored.copy_from_slice(stored);
        Ok(())
    }
}

impl Retained {
    pub(super) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        let parameters = segment.view(PARAMETERS)?;
        Ok(Retained { parameters, segment: segment.clone(), stored: [0; BYTES], generation: 0 })
    }

    /// What NOVRAM holds, and a number that changes with it.
    pub(super) fn novram(&self) -> (&[u8], u32) {
        (&self.stored, self.generation)
    }

    /// It is stored when it changes (p. 155).
    pub(super) fn keep(&mut self) {
        let mut head = [0; HEAD];
        // It lies in the image.
        let _ = self.segment.read_range(PARAMETERS as u32, &mut head);
        if !self.stored.starts_with(&head) {
            // Of the same size by its definition.
            let _ = self.parameters.snapshot().write_to(&mut self.stored);
            self.generation = self.generation.wrapping_add(1);
        }
    }
}
