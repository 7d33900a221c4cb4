//! Detects writes of a program that violate the manual.

use crate::devices::cs0015::emulation::ram::{Registers, UNNAMED};
use crate::devices::cs0015::emulation::rules;
use crate::devices::cs0015::registers::OUTPUTS;
use crate::journal::Rule;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

/// A broken rule: the rule, the offset, and the value.
pub(crate) type WatchFinding = (&'static Rule, u32, u32);

/// Values that the unnamed flags of the operating system had at the last check.
#[derive(Clone, Debug)]
pub(crate) struct Watch {
    unnamed: [u8; UNNAMED],
}

impl Default for Watch {
    fn default() -> Self {
        Watch { unnamed: [0; UNNAMED] }
    }
}

impl SnapshotFields for Watch {
    fn save(&self, to: &mut Saving) {
        let Self { unnamed } = self;
        to.raw(unnamed);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.unnamed.copy_from_slice(from.raw(UNNAMED)?);
        Ok(())
    }
}

impl Watch {
    /// Checks the unnamed flags of the operating system. Returns a finding for the first word that a program
    /// has changed.
    pub(crate) fn look(&mut self, registers: &Registers) -> Option<WatchFinding> {
        let now = registers.unnamed();
        let before = core::mem::replace(&mut self.unnamed, now);
        if before == now {
            return None;
        }
        let words = before.as_chunks::<2>().0.iter().zip(now.as_chunks::<2>().0);
        let (word, (_, value)) = words.enumerate().find(|(_, (before, now))| before != now)?;
        let at = registers.unnamed_at() + 2 * word as u32;
        Some((&rules::SYSTEM_AREA, at, u16::from_le_bytes(*value).into()))
    }
}

/// If a program has changed one of the outputs that PWM drives, returns a finding.
pub(crate) fn pwm_outputs(before: u16, now: u16, pwm: u16) -> Option<WatchFinding> {
    let is_changed = (before ^ now) & pwm != 0;
    is_changed.then_some((&rules::PWM_OUTPUT, OUTPUTS, now.into()))
}
