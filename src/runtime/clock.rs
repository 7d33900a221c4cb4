//! Sources of emulated time.

use super::RuntimeError;
use crate::memory::ClockMode;
use crate::memory::header::monotonic_ns;
use std::time::{Duration, Instant};

/// The clock of an emulator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// The clock advances only on request of a client.
    Stepped,
    /// The clock follows the wall clock: `speed` emulated microseconds for each real one.
    RealTime {
        /// Speed of the clock; 1.0 is real time. At least [`Clock::SLOWEST`], at most [`Clock::FASTEST`].
        speed: f64,
    },
}

impl Clock {
    /// Largest speed factor of a clock in real time.
    pub const FASTEST: f64 = 1000.0;
    /// Smallest speed factor of a clock in real time.
    pub const SLOWEST: f64 = 0.001;

    /// Checks the speed of this clock.
    ///
    /// # Errors
    /// [`RuntimeError::Speed`]: the speed is less than [`Clock::SLOWEST`] or more than [`Clock::FASTEST`].
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

/// A wall clock, read in emulated microseconds.
#[derive(Debug)]
pub(super) struct WallClock {
    /// The moment since which the clock has this speed.
    since: Instant,
    /// `CLOCK_MONOTONIC` at that moment, in ns.
    since_ns: u64,
    /// Emulated time at that moment, in microseconds.
    from_us: u64,
    /// Speed factor; 0.0 while the clock is paused.
    speed: f64,
}

impl WallClock {
    /// Returns a clock paused at emulated time 0.
    pub(super) fn paused() -> Self {
        Self::at(0, 0.0)
    }

    /// Returns a clock that has emulated time `from_us` now, and continues with speed `speed`.
    pub(super) fn at(from_us: u64, speed: f64) -> Self {
        WallClock { since: Instant::now(), since_ns: monotonic_ns(), from_us, speed }
    }

    /// Returns the value of `CLOCK_MONOTONIC` at emulated time 0, in ns, extrapolated. The value is modulo 2^64: for a
    /// slow clock, emulated time 0 may be before the start of the machine. 0 while the clock is paused.
    pub(super) fn epoch_ns(&self) -> u64 {
        if self.speed == 0.0 {
            return 0;
        }
        let real_ns = if self.speed == 1.0 {
            self.from_us.saturating_mul(1_000)
        } else {
            (self.from_us as f64 * 1_000.0 / self.speed) as u64
        };
        self.since_ns.wrapping_sub(real_ns).max(1)
    }

    /// Returns the present emulated time.
    pub(super) fn now(&self) -> u64 {
        let real = self.since.elapsed();
        let passed = if self.speed == 1.0 {
            real.as_micros() as u64
        } else {
            (real.as_secs_f64() * 1e6 * self.speed) as u64
        };
        self.from_us + passed
    }

    /// Real time since the clock had the emulated time `time`; zero if it has not reached this time or is paused.
    pub(super) fn since(&self, time: u64) -> Duration {
        match self.speed {
            0.0 => Duration::ZERO,
            speed => Duration::from_secs_f64(self.now().saturating_sub(time) as f64 / 1e6 / speed),
        }
    }

    /// Real time until the emulated time reaches `time`; zero if `time` is past, [`Duration::MAX`] while the clock is
    /// paused.
    pub(super) fn until(&self, time: u64) -> Duration {
        let Some(left) = time.checked_sub(self.from_us) else { return Duration::ZERO };
        let real = if self.speed == 1.0 {
            Duration::from_micros(left)
        } else if left == 0 {
            Duration::ZERO
        } else {
            Duration::try_from_secs_f64(left as f64 / 1e6 / self.speed).unwrap_or(Duration::MAX)
        };
        real.saturating_sub(self.since.elapsed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(from_us: u64, speed: f64) -> WallClock {
        WallClock { since: Instant::now(), since_ns: 50_000_000, from_us, speed }
    }

    #[test]
    fn a_fast_clock_is_ahead_of_a_slow_one() {
        let since = Instant::now();
        let fast = WallClock { since, ..clock(0, 10.0) };
        let slow = WallClock { since, ..clock(0, 0.1) };
        let slow_now = slow.now();
        assert!(fast.now() >= slow_now);
        assert!(slow.until(slow_now + 1_000_000) > fast.until(slow_now + 1_000_000));
    }

    #[test]
    fn past_times_are_due_immediately() {
        assert_eq!(WallClock::at(0, 1.0).until(0), Duration::ZERO);
        assert_eq!(WallClock::at(5_000, 2.0).until(4_999), Duration::ZERO);
    }

    #[test]
    fn a_paused_clock_keeps_its_time() {
        let paused = WallClock::at(7_000, 0.0);
        assert_eq!((paused.now(), paused.epoch_ns()), (7_000, 0));
        assert_eq!(paused.until(7_000), Duration::ZERO);
        assert!(paused.until(7_001) > Duration::MAX / 2);
        assert_eq!(WallClock::paused().now(), 0);
        assert_eq!((paused.since(7_000), paused.since(1_000)), (Duration::ZERO, Duration::ZERO));
    }

    #[test]
    fn the_real_time_since_an_emulated_time_depends_on_the_speed() {
        let since = Instant::now() - Duration::from_secs(3);
        let fast = WallClock { since, ..clock(0, 10.0) };
        assert!(fast.since(10_000_000) >= Duration::from_secs(2));
        assert!(fast.since(10_000_000) < fast.since(9_000_000));
        assert_eq!(fast.since(u64::MAX), Duration::ZERO);
    }

    /// Programs that map the image compute the time from the epoch and the speed.
    #[test]
    fn the_epoch_extrapolates_to_time_0() {
        assert_eq!(clock(0, 1.0).epoch_ns(), 50_000_000);
        assert_eq!(clock(20_000, 1.0).epoch_ns(), 30_000_000);
        assert_eq!(clock(20_000, 10.0).epoch_ns(), 48_000_000);
        let before_boot = clock(20_000, 0.1).epoch_ns();
        assert_eq!(50_000_000_u64.wrapping_sub(before_boot), 200_000_000);
    }
}
