//! Real time in which this process ran, for time limits of other processes.
//!
//! A process that was suspended (SIGSTOP, a debugger, a frozen container) resumes together with the data that others
//! have sent in the meantime. Without this measure its first check of a time limit would come before it has read them.

use std::time::{Duration, Instant};

/// A longer time between two readings counts as a suspension. A process that waits reads several times per second.
const SUSPENSION: Duration = Duration::from_secs(1);

/// Stopwatch that counts only the time in which this process ran.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AwakeTime {
    counted: Duration,
    read: Instant,
}

impl AwakeTime {
    pub(crate) fn start() -> Self {
        Self { counted: Duration::ZERO, read: Instant::now() }
    }

    /// Returns the counted time. The time since the last call is not counted if it was a suspension. So a limit that
    /// is not reached before a suspension is not reached at its end either.
    pub(crate) fn elapsed(&mut self) -> Duration {
        self.elapsed_at(Instant::now())
    }

    fn elapsed_at(&mut self, now: Instant) -> Duration {
        let since = now.saturating_duration_since(core::mem::replace(&mut self.read, now));
        if since < SUSPENSION {
            self.counted += since;
        }
        self.counted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suspension_is_not_counted() {
        let mut time = AwakeTime::start();
        let start = time.read;
        let mut at = |ms| time.elapsed_at(start + Duration::from_millis(ms)).as_millis();
        assert_eq!([at(20), at(900), at(1_700)], [20, 900, 1_700]);
        assert_eq!([at(9_700), at(9_720)], [1_700, 1_720]);
    }
}
