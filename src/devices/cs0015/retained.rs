//! What a CS0015 keeps without supply besides its retain flags: the parameters that p. 155 has saved automatically.

use super::registers::{CS0015_PARAMETERS, DEVICE, PARAMETERS};
use crate::layout::Area;
use crate::memory::{MemoryError, Segment, View};
use zerocopy::IntoBytes;

/// Their length.
const BYTES: usize = size_of::<CS0015_PARAMETERS>();

/// Where they lie.
pub(super) fn area() -> Option<&'static Area> {
    DEVICE.areas.iter().find(|area| area.name == "parameters")
}

/// The parameters as they are stored.
pub(super) struct Retained {
    parameters: View<CS0015_PARAMETERS>,
    stored: [u8; BYTES],
    /// Counts changes of `stored`.
    generation: u32,
}

impl Retained {
    pub(super) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        let parameters = segment.view(PARAMETERS)?;
        Ok(Retained { parameters, stored: [0; BYTES], generation: 0 })
    }

    /// What NOVRAM holds, and a number that changes with it.
    pub(super) fn novram(&self) -> (&[u8], u32) {
        (&self.stored, self.generation)
    }

    /// They are stored when they change (p. 155).
    pub(super) fn keep(&mut self) {
        let mut now = [0; BYTES];
        // Of the same size by their definition.
        let _ = self.parameters.snapshot().write_to(&mut now);
        if now != self.stored {
            self.stored = now;
            self.generation = self.generation.wrapping_add(1);
        }
    }
}
