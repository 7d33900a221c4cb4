//! A run of the drive: many intervals in one step, see [`Drive::cruise`](super::super::Drive::cruise).

use super::{Slots, VRegler};
use crate::devices::cansync::drive::drivecom::DrivecomState;
use crate::devices::cansync::drive::parameters::ParameterSlot;

/// Parameters of a drive in speed mode during a run, in which only reference values are written.
pub(in crate::devices::cansync::emulation::drive) struct Run {
    pub sync_slot_us: u32,
    pub speed_reference: u32,
    /// The lowest and the highest target speed.
    bounds: (i32, i32),
    ramp: u32,
}

impl Run {
    /// Returns the target speed for this reference value.
    #[inline]
    fn target(&self, reference: u32) -> i32 {
        (reference as i32).clamp(self.bounds.0, self.bounds.1)
    }
}

impl VRegler {
    /// Starts a run of many intervals in which only reference values come. Returns `None` if the motion
    /// depends on more than the speed reference value.
    pub(in crate::devices::cansync::emulation::drive) fn begin_run(&self) -> Option<Run> {
        if self.is_following_angle() || self.store.is_settling() {
            return None;
        }
        let limit = match self.machine.state() {
            DrivecomState::OperationEnabled => self.store.get(self.slots.speed_limit),
            _ => 0,
        };
        Some(Run {
            sync_slot_us: self.store.get(self.slots.sync_slot),
            speed_reference: self.store.get(self.slots.speed_reference),
            bounds: (0_i32.saturating_sub_unsigned(limit), 0_i32.saturating_add_unsigned(limit)),
            ramp: self.store.get(self.slots.ramp),
        })
    }

    /// Returns `Some` if a run permits a reference value for this parameter. The value is true for the speed
    /// reference value.
    pub(in crate::devices::cansync::emulation::drive) fn takes_in_run(
        &self,
        target: ParameterSlot,
    ) -> Option<bool> {
        let Slots { mode, speed_limit, ramp, sync_slot, angle_reference, .. } = self.slots;
        let is_looked_at = [mode, speed_limit, ramp, sync_slot, angle_reference].contains(&target);
        let takes = !is_looked_at && self.store.takes_every_value(target);
        takes.then_some(target == self.slots.speed_reference)
    }

    /// Does the same as [`VRegler::step`] during a run.
    #[inline]
    pub(in crate::devices::cansync::emulation::drive) fn step_in_run(&mut self, run: &Run, us: u32) {
        if self.motion.step(run.target(run.speed_reference), us, run.ramp) == 0 {
            self.machine.standstill();
        }
    }

    /// Runs through one interval for each speed reference value. There must be at least one value; the last
    /// value remains in the parameter. An interval has two parts. Its reference value takes effect in the
    /// second part.
    #[inline]
    pub(in crate::devices::cansync::emulation::drive) fn steps_in_run(
        &mut self,
        run: &mut Run,
        parts: [u32; 2],
        mut references: impl DoubleEndedIterator<Item = u32> + Clone,
    ) {
        let before = run.target(run.speed_reference);
        let targets = references.clone().map(|speed| run.target(speed));
        if self.motion.steps(before, targets, parts, run.ramp) {
            self.machine.standstill();
        }
        run.speed_reference = references.next_back().unwrap_or(run.speed_reference);
    }

    /// Ends the run: stores the actual values.
    pub(in crate::devices::cansync::emulation::drive) fn end_run(&mut self) {
        self.store.set(self.slots.speed_actual, self.motion.speed() as u32);
        self.store.set(self.slots.angle_actual, self.motion.angle());
    }
}
