//! Limits for the steps, the processor time and the stack of a script.

use core::cell::Cell;
use core::time::Duration;
use rustix::time::{ClockId, clock_gettime};
use serde::{Deserialize, Serialize};

/// Steps of a script within a millisecond of emulated time (D-801).
pub(super) const MOST_OPERATIONS: u64 = 200_000;
/// Steps that each call of a hook counts in addition to its own steps, so that calls of empty hooks are also
/// limited.
const CALL: u64 = 20;
/// Weight of a value for which an access counts one more step.
const WEIGHT_OF_ACCESS: u64 = 32;
/// Weight of `this` or a constant for which each step of a call counts one more. The engine has no hook for accesses to
/// them, but no step does more work than with the heaviest of these values.
const WEIGHT_OF_STEP: u64 = 256;
/// Steps after which the weight of a changing `this` is determined again.
const STEPS_PER_WEIGHING: u64 = 1024;
/// Processor time of this thread that a script may use within a millisecond of emulated time. It is the last resort for a
/// script that builds large values without any variable, so that it cannot block the emulator. Steps count by the size
/// of all other values (D-801).
pub(super) const LONGEST_TIME: Duration = Duration::from_secs(1);
/// As long as the script's elapsed time within a millisecond is shorter than this, it is used instead of the
/// processor time. Reading the processor time of a thread is a system call, which takes longer than a short
/// hook. The elapsed time is never shorter than the processor time, so it is a safe estimate (D-837).
const UNMEASURED: Duration = Duration::from_millis(100);
/// Steps between two reads of the time.
const STEPS_PER_LOOK: u64 = 64;
/// Stack in bytes that a hook may use, counted from its call.
const MOST_STACK: usize = 1 << 20;

/// Number of steps in the present millisecond. Snapshots contain it, so that after a return to a snapshot a
/// script stops at the same step.
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

    /// Ends the call of the script, which has taken `operations` steps.
    pub(super) fn end(&mut self, operations: u64) {
        self.used = self.used.saturating_add(operations);
    }
}

/// Steps and stack of a running call.
#[derive(Debug, Default)]
pub(super) struct Meter {
    operations: Cell<u64>,
    allowed: Cell<u64>,
    /// Steps that each step of the call counts.
    per_step: Cell<u64>,
    /// Number of steps from which the weight of `this` must be determined again.
    next_weighing: Cell<u64>,
    bottom: Cell<usize>,
    /// The millisecond of emulated time of the last call.
    millisecond: Cell<u64>,
    /// Elapsed time of all calls in this millisecond. It is counted until it exceeds [`UNMEASURED`].
    elapsed: Cell<Duration>,
    /// Processor time of all calls in this millisecond, counted when the elapsed time has exceeded
    /// [`UNMEASURED`].
    used: Cell<Duration>,
    /// Last reading of a clock in this call.
    last: Cell<Read>,
}

/// A read of the time.
#[derive(Clone, Copy, Debug, Default)]
struct Read {
    /// True for the processor time of this thread, false for the elapsed time.
    is_of_processor: bool,
    time: Duration,
}

/// Limit that a call has exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exceeded {
    Operations,
    Time,
    Stack,
}

impl Meter {
    /// Begins a call at the emulated time `now`, in microseconds. The call may take `allowed` steps. `weight` is that of the
    /// heaviest value to which the call has access without a variable: `this`, or a constant.
    pub(super) fn begin(&self, allowed: u64, now: u64, weight: u64) {
        if self.millisecond.replace(now / 1000) != now / 1000 {
            self.elapsed.set(Duration::ZERO);
            self.used.set(Duration::ZERO);
        }
        self.last.set(self.read());
        self.operations.set(0);
        self.allowed.set(allowed);
        self.per_step.set(0);
        self.weigh(weight);
        self.bottom.set(stack_position());
    }

    /// Ends the measurement of a call.
    pub(super) fn end(&self) {
        self.measure();
    }

    /// Reads the time that counts now.
    fn read(&self) -> Read {
        let is_of_processor = self.elapsed.get() > UNMEASURED;
        let clock = if is_of_processor { ClockId::ThreadCPUTime } else { ClockId::Monotonic };
        // The clock of the thread does not count the time in which other programs run.
        Read { is_of_processor, time: Duration::try_from(clock_gettime(clock)).unwrap_or_default() }
    }

    /// Counts the time since the last read. Returns true if the calls in this millisecond have taken too long.
    fn measure(&self) -> bool {
        let (last, now) = (self.last.get(), self.read());
        let sum = if last.is_of_processor { &self.used } else { &self.elapsed };
        sum.set(sum.get() + now.time.saturating_sub(last.time));
        // If the limit for the elapsed time is exceeded now, the next reading uses the other clock.
        let changes_clock = !last.is_of_processor && self.elapsed.get() > UNMEASURED;
        self.last.set(if changes_clock { self.read() } else { now });
        self.used.get() > LONGEST_TIME.saturating_sub(UNMEASURED)
    }

    /// Number of steps that the present call has taken.
    pub(super) fn operations(&self) -> u64 {
        self.operations.get()
    }

    /// Counts the steps of a verb or an access in addition to the steps of the engine. If a call has taken too many steps, the next
    /// step ends it.
    pub(super) fn charge(&self, operations: u64) {
        self.operations.set(self.operations.get().saturating_add(operations));
    }

    /// Counts the steps of an access to a value of this weight.
    pub(super) fn access(&self, weight: u64) {
        self.charge(weight / WEIGHT_OF_ACCESS);
    }

    /// True if the weight of `this` must be determined again, because the call may have changed it.
    pub(super) fn is_weighing_due(&self) -> bool {
        self.operations.get() >= self.next_weighing.get()
    }

    /// Takes over the weight of a value to which the call has access without a variable.
    pub(super) fn weigh(&self, weight: u64) {
        self.per_step.set(self.per_step.get().max(1 + weight / WEIGHT_OF_STEP));
        self.next_weighing.set(self.operations.get().saturating_add(STEPS_PER_WEIGHING));
    }

    /// Counts a step of the script. Returns the first exceeded limit; `None` if no limit is exceeded.
    pub(super) fn step(&self) -> Option<Exceeded> {
        let before = self.operations.get();
        self.charge(self.per_step.get());
        if self.operations.get() > self.allowed.get() {
            return Some(Exceeded::Operations);
        }
        let is_due = before / STEPS_PER_LOOK != self.operations.get() / STEPS_PER_LOOK;
        if is_due && self.measure() {
            return Some(Exceeded::Time);
        }
        (self.bottom.get().abs_diff(stack_position()) > MOST_STACK).then_some(Exceeded::Stack)
    }
}

/// Returns an address in the stack of this thread.
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
        meter.begin(2, 0, 0);
        assert_eq!([meter.step(), meter.step(), meter.step()], [None, None, Some(Exceeded::Operations)]);
        assert_eq!(meter.operations(), 3);
        meter.begin(10, 0, 4 * WEIGHT_OF_STEP);
        assert_eq!([meter.step(), meter.step(), meter.step()], [None, None, Some(Exceeded::Operations)]);
        meter.begin(2, 0, 0);
        meter.access(WEIGHT_OF_ACCESS - 1);
        assert_eq!(meter.step(), None);
        meter.access(WEIGHT_OF_ACCESS);
        assert_eq!(meter.step(), Some(Exceeded::Operations));
        meter.begin(10, 0, 0);
        assert!(!meter.is_weighing_due());
        meter.charge(STEPS_PER_WEIGHING);
        assert!(meter.is_weighing_due());
        meter.weigh(0);
        assert!(!meter.is_weighing_due());
    }

    #[test]
    fn calls_of_a_millisecond_share_its_processor_time() {
        let meter = Meter::default();
        meter.begin(u64::MAX, 1000, 0);
        let mut steps = 0_u64;
        while meter.step() != Some(Exceeded::Time) {
            steps += 1;
            std::hint::black_box((0..10_000).map(std::hint::black_box).sum::<u64>());
        }
        meter.end();
        assert!(steps > STEPS_PER_LOOK, "the first read finds little time");
        let first_look = |now| {
            meter.begin(u64::MAX, now, 0);
            (0..STEPS_PER_LOOK).find_map(|_| meter.step())
        };
        assert_eq!((first_look(1999), first_look(2000)), (Some(Exceeded::Time), None));
    }
}
