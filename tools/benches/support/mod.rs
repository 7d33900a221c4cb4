//! Common parts of the benchmarks between processes.

pub(crate) mod active;
pub(crate) mod child;
pub(crate) mod cpu;
pub(crate) mod emulator;
pub(crate) mod page;
pub(crate) mod report;

use std::time::{Duration, Instant};

/// Time limit for any action of another process. If it is exceeded, the benchmark fails instead of hanging.
pub(crate) const PATIENCE: Duration = Duration::from_secs(10);

/// Polls a condition without a pause until it is true.
pub(crate) fn spin_until(mut is_there: impl FnMut() -> bool) {
    /// Number of polls between two readings of the clock.
    const LOOKS: u32 = 1 << 16;
    let start = Instant::now();
    loop {
        for _ in 0..LOOKS {
            if is_there() {
                return;
            }
        }
        assert!(start.elapsed() < PATIENCE, "the other process does not answer");
    }
}
