//! What the drive does in a run: many intervals in one go, see [`Drive::cruise`](super::super::Drive::cruise).

use super::{Slots, VRegler};
use crate::devices::cansync::drive::drivecom::State;
use crate::devices::cansync::drive::parameters::Slot;

/// What a drive in speed mode goes by while no parameter but its reference values is written.
pub(in crate::devices::cansync::drive) struct Run {
    pub sync_slot_us: u32,
    pub speed_reference: u32,
    /// The lowest and the highest speed that is aimed at.
    bounds: (i32, i32),
    ramp: u32,
}

impl Run {
    /// The speed that is aimed at with this reference value.
    #[inline]
    fn target(&self, reference: u32) -> i32 {
        (reference as i32).clamp(self.bounds.0, self.bounds.1)
    }
}

impl VRegler {
    /// The drive is about to run for many intervals in which nothing but reference values comes; `None` if it does not run
    /// by its speed reference value alone.
    pub(in crate::devices::cansync::drive) fn begin_run(&self) -> Option<Run> {
        if self.is_following_angle() || self.store.is_settling() {
            return None;
        }
        let limit = match self.machine.state() {
            State::OperationEnabled => self.store.get(self.slots.speed_limit),
            _ => 0,
        };
        Some(Run {
            sync_slot_us: self.store.get(self.slots.sync_slot),
            speed_reference: self.store.get(self.slots.speed_reference),
            bounds: (0_i32.saturating_sub_unsigned(limit), 0_i32.saturating_add_unsigned(limit)),
            ramp: self.store.get(self.slots.ramp),
        })
    }

    /// Whether a reference value for this parameter can come in a run, and whether it is the speed reference value.
    pub(in crate::devices::cansync::drive) fn takes_in_run(&self, target: Slot) -> Option<bool> {
        let Slots { mode, speed_limit, ramp, sync_slot, angle_reference, .. } = self.slots;
        let is_looked_at = [mode, speed_limit, ramp, sync_slot, angle_reference].contains(&target);
        let takes = !is_looked_at && self.store.takes_every_value(target);
        takes.then_some(target == self.slots.speed_reference)
    }

    /// As [`VRegler::step`], in a run.
    #[inline]
    pub(in crate::devices::cansync::drive) fn step_in_run(&mut self, run: &Run, us: u32) {
        if self.motion.step(run.target(run.speed_reference), us, run.ramp) == 0 {
            self.machine.standstill();
        }
    }

    /// Goes through one interval for each of the speed reference values, of which there is at least one and the last one stays.
    /// An interval has two parts: its reference value counts in the second one.
    #[inline]
    pub(in crate::devices::cansync::drive) fn steps_in_run(
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

    /// The run is over: its actual values can be looked at.
    pub(in crate::devices::cansync::drive) fn end_run(&mut self) {
        self.store.set(self.slots.speed_actual, self.motion.speed() as u32);
        self.store.set(self.slots.angle_actual, self.motion.angle());
    }
}
