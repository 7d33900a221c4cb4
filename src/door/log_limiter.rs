//! Limits log messages about foreign programs. A program that connects again and again must not fill the emulator's
//! log.

use crate::plural::plural;
use std::time::{Duration, Instant};

/// Minimum time between two complaints (decision D-582).
const PAUSE: Duration = Duration::from_secs(60);

/// Limits complaints, and counts the suppressed complaints since the last logged one.
#[derive(Debug, Default)]
pub(super) struct LogLimiter {
    last: Option<Instant>,
    unsaid: u64,
}

impl LogLimiter {
    /// Returns a text if the message must be logged. The text contains the number of messages that were suppressed
    /// before; it is empty if there were none.
    pub(super) fn complains(&mut self, now: Instant) -> Option<String> {
        if self.last.is_some_and(|last| now.saturating_duration_since(last) < PAUSE) {
            self.unsaid += 1;
            return None;
        }
        self.last = Some(now);
        Some(match std::mem::take(&mut self.unsaid) {
            0 => String::new(),
            unsaid => format!(" ({} more since the last message)", plural(unsaid, "time")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_has_one_complaint_and_the_next_one_counts_the_others() {
        let (mut log_limiter, begin) = (LogLimiter::default(), Instant::now());
        assert_eq!(log_limiter.complains(begin).as_deref(), Some(""));
        for second in 0..60 {
            assert_eq!(log_limiter.complains(begin + Duration::from_secs(second)), None);
        }
        let suffix = log_limiter.complains(begin + PAUSE);
        assert_eq!(suffix.as_deref(), Some(" (60 times more since the last message)"));
        assert_eq!(log_limiter.complains(begin + 2 * PAUSE).as_deref(), Some(""));
    }
}
