//! The real time for which the emulator does one piece of work before it serves other clients.

use std::cell::Cell;
use std::time::{Duration, Instant};

/// Real time after which an operation pauses, so that other clients are served.
const LONGEST: Duration = Duration::from_millis(5);

/// A slice of real time.
#[derive(Debug, Default)]
pub(super) struct Slice {
    /// Time of the first call of [`Slice::is_over`].
    begin: Cell<Option<Instant>>,
}

impl Slice {
    /// Begins a new slice.
    pub(super) fn renew(&self) {
        self.begin.set(None);
    }

    /// True if the slice is over. The first call after [`Slice::renew`] begins the slice.
    pub(super) fn is_over(&self) -> bool {
        let begin = self.begin.get().unwrap_or_else(Instant::now);
        self.begin.set(Some(begin));
        begin.elapsed() >= LONGEST
    }
}
