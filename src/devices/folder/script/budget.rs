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

/// Steps and time of a device's script in the present millisecond. Snapshots contain the steps, so that after a return to a
/// snapshot the script stops at the same step. They do not contain the time: a device that goes back begins to measure anew.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Budget {
    millisecond: u64,
    used: u64,
    #[serde(skip)]
    time: Time,
}

/// Real time of calls.
#[derive(Clone, Copy, Debug, Default)]
struct Time {
    /// Elapsed time. It is counted until it exceeds [`UNMEASURED`].
    elapsed: Duration,
    /// Processor time, counted when the elapsed time has exceeded [`UNMEASURED`].
    of_processor: Duration,
}

impl Budget {
    /// Begins a call at the emulated time `now`, in microseconds. `meter` counts its steps and its time. `weight` is that of
    /// the heaviest value to which the call has access without a variable: `this`, or a constant.
    pub(super) fn begin(&mut self, meter: &Meter, now: u64, weight: u64) {
        let millisecond = now / 1000;
        if self.millisecond != millisecond {
            *self = Budget { millisecond, ..Budget::default() };
        }
        self.used = self.used.saturating_add(CALL);
        meter.begin(MOST_OPERATIONS.saturating_sub(self.used), self.time, weight);
    }

    /// Ends the call that `meter` has measured.
    pub(super) fn end(&mut self, meter: &Meter) {
        meter.measure();
        self.time = meter.time.get();
        self.used = self.used.saturating_add(meter.operations());
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
    /// Time of the script in this millisecond.
    time: Cell<Time>,
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
    /// Begins a call that may take `allowed` steps, of a script that has taken `time` in this millisecond.
    fn begin(&self, allowed: u64, time: Time, weight: u64) {
        self.time.set(time);
        self.last.set(self.read());
        self.operations.set(0);
        self.allowed.set(allowed);
        self.per_step.set(0);
        self.weigh(weight);
        self.bottom.set(stack_position());
    }

    /// Begins a measurement without a limit for the steps.
    #[cfg(test)]
    pub(super) fn begin_unlimited(&self) {
        self.begin(u64::MAX, Time::default(), 0);
    }

    /// Reads the time that counts now.
    fn read(&self) -> Read {
        let is_of_processor = self.time.get().elapsed > UNMEASURED;
        let clock = if is_of_processor { ClockId::ThreadCPUTime } else { ClockId::Monotonic };
        // The clock of the thread does not count the time in which other programs run.
        Read { is_of_processor, time: Duration::try_from(clock_gettime(clock)).unwrap_or_default() }
    }

    /// Counts the time since the last read. Returns true if the calls in this millisecond have taken too long.
    fn measure(&self) -> bool {
        let (last, now, mut time) = (self.last.get(), self.read(), self.time.get());
        let sum = if last.is_of_processor { &mut time.of_processor } else { &mut time.elapsed };
        *sum += now.time.saturating_sub(last.time);
        self.time.set(time);
        // If the limit for the elapsed time is exceeded now, the next reading uses the other clock.
        let changes_clock = !last.is_of_processor && time.elapsed > UNMEASURED;
        self.last.set(if changes_clock { self.read() } else { now });
        time.of_processor > LONGEST_TIME.saturating_sub(UNMEASURED)
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
        let (mut budget, meter) = (Budget::default(), Meter::default());
        let mut allowed = |now, steps| {
            budget.begin(&meter, now, 0);
            meter.charge(steps);
            budget.end(&meter);
            meter.allowed.get()
        };
        let most = MOST_OPERATIONS - CALL;
        assert_eq!([allowed(500, most), allowed(999, 0), allowed(1000, 0)], [most, 0, most]);
    }

    #[test]
    fn a_call_ends_after_its_steps() {
        let meter = Meter::default();
        let begin = |allowed, weight| meter.begin(allowed, Time::default(), weight);
        begin(2, 0);
        assert_eq!([meter.step(), meter.step(), meter.step()], [None, None, Some(Exceeded::Operations)]);
        assert_eq!(meter.operations(), 3);
        begin(10, 4 * WEIGHT_OF_STEP);
        assert_eq!([meter.step(), meter.step(), meter.step()], [None, None, Some(Exceeded::Operations)]);
        begin(2, 0);
        meter.access(WEIGHT_OF_ACCESS - 1);
        assert_eq!(meter.step(), None);
        meter.access(WEIGHT_OF_ACCESS);
        assert_eq!(meter.step(), Some(Exceeded::Operations));
        begin(10, 0);
        assert!(!meter.is_weighing_due());
        meter.charge(STEPS_PER_WEIGHING);
        assert!(meter.is_weighing_due());
        meter.weigh(0);
        assert!(!meter.is_weighing_due());
    }

    #[test]
    fn calls_of_one_device_in_a_millisecond_share_its_processor_time() {
        let (meter, mut slow) = (Meter::default(), Budget::default());
        slow.begin(&meter, 1000, 0);
        let mut steps = 0_u64;
        while meter.step() != Some(Exceeded::Time) {
            steps += 1;
            std::hint::black_box((0..100_000).map(std::hint::black_box).sum::<u64>());
        }
        assert!(steps > STEPS_PER_LOOK, "the first read finds little time");
        slow.end(&meter);
        let (used, saved) = (slow.used, postcard::to_allocvec(&slow).unwrap());
        assert!(used > CALL + steps);
        let first_look = |budget: &mut Budget, now| {
            budget.begin(&meter, now, 0);
            let exceeded = (0..STEPS_PER_LOOK).find_map(|_| meter.step());
            budget.end(&meter);
            exceeded
        };
        assert_eq!(first_look(&mut slow, 1999), Some(Exceeded::Time));
        // Another device of the same folder has the same meter.
        assert_eq!(first_look(&mut Budget::default(), 1999), None);
        let mut returned = postcard::from_bytes::<Budget>(&saved).unwrap();
        assert_eq!((returned.used, first_look(&mut returned, 1999)), (used, None));
        assert_eq!(first_look(&mut slow, 2000), None);
    }
}
