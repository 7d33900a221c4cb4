//! Limits the steps and the stack of a script.

use core::cell::Cell;
use serde::{Deserialize, Serialize};

/// Steps of a script within a millisecond of emulated time (D-801).
pub(super) const MOST_OPERATIONS: u64 = 200_000;
/// Steps that each call of a hook counts, so that calls of empty hooks are limited, too.
const CALL: u64 = 20;
/// Stack in bytes that a hook may take, from the call on.
const MOST_STACK: usize = 1 << 20;

/// Steps taken in the present millisecond. Part of snapshots, so that a script stops at the same step after going back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Budget {
    millisecond: u64,
    used: u64,
}

impl Budget {
    /// Begins a call at `now`. Returns the number of steps that the call may take.
    pub(super) fn begin(&mut self, now: u64) -> u64 {
        let millisecond = now / 1000;
        if self.millisecond != millisecond {
            *self = Budget { millisecond, used: 0 };
        }
        self.used = self.used.saturating_add(CALL);
        MOST_OPERATIONS.saturating_sub(self.used)
    }

    /// Ends the call, which has taken this number of steps.
    pub(super) fn end(&mut self, operations: u64) {
        self.used = self.used.saturating_add(operations);
    }
}

/// Steps and stack of a running call.
#[derive(Debug, Default)]
pub(super) struct Meter {
    operations: Cell<u64>,
    allowed: Cell<u64>,
    bottom: Cell<usize>,
}

/// Limit that a call has exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exceeded {
    Operations,
    Stack,
}

impl Meter {
    /// Begins a call, which may take `allowed` steps.
    pub(super) fn begin(&self, allowed: u64) {
        self.operations.set(0);
        self.allowed.set(allowed);
        self.bottom.set(stack_position());
    }

    /// Steps of the call so far.
    pub(super) fn operations(&self) -> u64 {
        self.operations.get()
    }

    /// Counts the steps of a verb that works on many registers; the next step ends a call that has taken too many.
    pub(super) fn charge(&self, operations: u64) {
        self.operations.set(self.operations.get().saturating_add(operations));
    }

    /// Counts a step.
    pub(super) fn step(&self) -> Option<Exceeded> {
        self.charge(1);
        if self.operations.get() > self.allowed.get() {
            return Some(Exceeded::Operations);
        }
        (self.bottom.get().abs_diff(stack_position()) > MOST_STACK).then_some(Exceeded::Stack)
    }
}

/// An address in the stack of this thread.
#[inline(never)]
pub(crate) fn stack_position() -> usize {
    let here = 0_u8;
    core::ptr::from_ref(&here).addr()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_count_within_a_millisecond() {
        let mut budget = Budget::default();
        let most = MOST_OPERATIONS - CALL;
        assert_eq!(budget.begin(500), most);
        budget.end(most);
        assert_eq!((budget.begin(999), budget.begin(1000)), (0, most));
    }

    #[test]
    fn a_call_ends_after_its_steps() {
        let meter = Meter::default();
        meter.begin(2);
        assert_eq!([meter.step(), meter.step(), meter.step()], [None, None, Some(Exceeded::Operations)]);
        assert_eq!(meter.operations(), 3);
    }
}
