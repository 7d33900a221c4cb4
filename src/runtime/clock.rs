//! Sources of emulated time.

use super::RuntimeError;
use crate::memory::ClockMode;
use rustix::time::{ClockId, clock_gettime};
use std::time::{Duration, Instant};

/// The clock of an emulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// The clock advances only on request of a client.
    Stepped,
    /// The clock follows the wall clock: `speed` emulated microseconds for each real one.
    RealTime {
        /// 1.0 is real time; at most [`Clock::FASTEST`], at least [`Clock::SLOWEST`].
        speed: f64,
    },
}

impl Clock {
    /// Largest speed factor.
    pub const FASTEST: f64 = 1000.0;
    /// Smallest speed factor.
    pub const SLOWEST: f64 = 0.001;

    /// Checks the speed of this clock.
    ///
    /// # Errors
    /// [`RuntimeError::Speed`]: it is less than [`Clock::SLOWEST`] or more than [`Clock::FASTEST`].
    pub fn check(self) -> Result<(), RuntimeError> {
        match self {
            Clock::RealTime { speed } if !(Self::SLOWEST..=Self::FASTEST).contains(&speed) => {
                Err(RuntimeError::Speed { speed })
            }
            _ => Ok(()),
        }
    }

    /// Mode of this clock in the header page.
    pub fn mode(self) -> ClockMode {
        if self.is_stepped() { ClockMode::Stepped } else { ClockMode::RealTime }
    }

    /// Emulated time per real time x 1000 as the header page shows it; 0 when stepped.
    pub fn speed_permille(self) -> u32 {
        match self {
            Clock::Stepped => 0,
            Clock::RealTime { speed } => (speed * 1000.0) as u32,
        }
    }

    /// True if the clock advances only on request.
    pub fn is_stepped(self) -> bool {
        self == Clock::Stepped
    }
}

/// A running wall clock, read in emulated microseconds.
#[derive(Debug)]
pub(super) struct WallClock {
    started: Instant,
    /// `CLOCK_MONOTONIC` at emulated time 0, in ns.
    epoch_ns: u64,
    speed: f64,
}

impl WallClock {
    /// Starts at emulated time 0 now.
    pub(super) fn start(speed: f64) -> Self {
        let epoch = clock_gettime(ClockId::Monotonic);
        let epoch_ns = epoch.tv_sec as u64 * 1_000_000_000 + epoch.tv_nsec as u64;
        WallClock { started: Instant::now(), epoch_ns, speed }
    }

    /// `CLOCK_MONOTONIC` at emulated time 0, in ns.
    pub(super) fn epoch_ns(&self) -> u64 {
        self.epoch_ns
    }

    /// The present emulated time.
    pub(super) fn now(&self) -> u64 {
        let real = self.started.elapsed();
        if self.speed == 1.0 {
            real.as_micros() as u64
        } else {
            (real.as_secs_f64() * 1e6 * self.speed) as u64
        }
    }

    /// Real time until the emulated time reaches `time`; zero if it is past.
    pub(super) fn until(&self, time: u64) -> Duration {
        let real = if self.speed == 1.0 {
            Duration::from_micros(time)
        } else {
            Duration::try_from_secs_f64(time as f64 / 1e6 / self.speed).unwrap_or(Duration::MAX)
        };
        real.saturating_sub(self.started.elapsed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_clock_is_ahead_of_a_slow_one() {
        let started = Instant::now();
        let fast = WallClock { started, epoch_ns: 0, speed: 10.0 };
        let slow = WallClock { started, epoch_ns: 0, speed: 0.1 };
        let slow_now = slow.now();
        assert!(fast.now() >= slow_now);
        assert!(slow.until(slow_now + 1_000_000) > fast.until(slow_now + 1_000_000));
    }

    #[test]
    fn past_times_are_due_immediately() {
        assert_eq!(WallClock::start(1.0).until(0), Duration::ZERO);
    }
}
