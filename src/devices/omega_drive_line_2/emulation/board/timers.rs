//! The timers of a board: CPU timers in steps of 50 us, board timers with a divided clock of 5 MHz, and the
//! SYNC signal of an option card.

use serde::{Deserialize, Serialize};

/// Number of clock ticks per microsecond. Periods are counted in ticks of the 5 MHz clock, so that rounding
/// errors do not accumulate.
pub(super) const PER_US: u64 = 5;
/// Step of the CPU timers, 50 us (manual 5.00005.03a p. 48).
pub(super) const CPU_STEP: u64 = 50 * PER_US;

/// A timer of the board or of its processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Timer {
    /// SYNC signal of the option card.
    OptionSync,
    /// Timer A of the board.
    A,
    /// Timer B of the board.
    B,
    /// Timer 1 of the processor (CPU).
    Cpu1,
    /// Timer 2 of the processor (CPU).
    Cpu2,
}

const COUNT: usize = 5;
const NEVER: u64 = u64::MAX;

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Clock {
    /// Period of the timer in ticks of 1 / [`PER_US`] us.
    period: u64,
    /// Emulated time at which the timer was started, in microseconds.
    start: u64,
    /// Number of the next pulse, from 1.
    next: u64,
    /// Emulated time of the next pulse, in microseconds.
    due: u64,
}

/// All timers of a board.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Timers {
    clocks: [Clock; COUNT],
    next_time: u64,
}

/// Timers that were due.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Due(u8);

impl Due {
    pub(crate) fn has(self, timer: Timer) -> bool {
        self.0 & 1 << timer as u8 != 0
    }
}

impl Default for Timers {
    fn default() -> Self {
        let clock = Clock { period: 0, start: 0, next: 0, due: NEVER };
        Timers { clocks: [clock; COUNT], next_time: NEVER }
    }
}

impl Timers {
    /// Starts or restarts a timer at `now`. Its first pulse comes after a whole period. `period` is in ticks
    /// of 1 / [`PER_US`] us, at least 1 us.
    pub(crate) fn start(&mut self, timer: Timer, now: u64, period: u64) {
        self.set(timer, Clock { period, start: now, next: 1, due: now + period / PER_US });
    }

    pub(crate) fn stop(&mut self, timer: Timer) {
        self.set(timer, Clock { period: 0, start: 0, next: 0, due: NEVER });
    }

    fn set(&mut self, timer: Timer, clock: Clock) {
        self.clocks[timer as usize] = clock;
        self.next_time = self.earliest();
    }

    fn earliest(&self) -> u64 {
        self.clocks.iter().map(|clock| clock.due).fold(NEVER, u64::min)
    }

    #[inline]
    pub(crate) fn next_time(&self) -> u64 {
        self.next_time
    }

    /// Removes and returns the timers that are due at `now`.
    pub(crate) fn take_due(&mut self, now: u64) -> Due {
        let mut due = Due::default();
        for (index, clock) in self.clocks.iter_mut().enumerate() {
            if clock.due == now {
                due.0 |= 1 << index;
                clock.next += 1;
                clock.due = clock.start + clock.next * clock.period / PER_US;
            }
        }
        self.next_time = self.earliest();
        due
    }
}
