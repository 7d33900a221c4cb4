//! A time limit for calls of iceoryx2 that may never return.
//!
//! Any program of the same user can damage parts of the channel, and iceoryx2 waits for some of them without a limit:
//! a pipe in the place of a file, an object without a length. Such a call cannot be cancelled, so its thread is
//! abandoned if it takes too long.

use std::io;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Limit for calls that do not wait for another process.
pub(super) const SHORT: Duration = Duration::from_secs(1);

/// The reason why there is no result.
#[derive(Debug)]
pub(super) enum LimitError {
    /// The call takes too long.
    Late,
    /// The thread has panicked.
    Ended,
    /// The operating system cannot start a thread.
    NoThread(io::Error),
}

/// Runs `work` in a separate thread and waits for it, for at most `limit`.
pub(super) fn on_a_thread<R: Send + 'static>(
    limit: Duration,
    work: impl FnOnce() -> R + Send + 'static,
) -> Result<R, LimitError> {
    let (done, result) = mpsc::sync_channel(1);
    let thread = std::thread::Builder::new().name("channel".to_owned());
    // If the result arrives after the limit, the thread drops it.
    let thread = thread.spawn(move || drop(done.send(work()))).map_err(LimitError::NoThread)?;
    let result = result.recv_timeout(limit).map_err(|error| match error {
        RecvTimeoutError::Timeout => LimitError::Late,
        RecvTimeoutError::Disconnected => LimitError::Ended,
    })?;
    // The thread ends immediately. After the join it no longer exists in the process.
    let _ = thread.join();
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_that_never_returns_is_abandoned() {
        let (never, ends) = mpsc::channel::<()>();
        let waits = move || ends.recv().is_ok();
        assert!(matches!(on_a_thread(Duration::from_millis(1), waits), Err(LimitError::Late)));
        assert!(on_a_thread(Duration::from_secs(60), || 7).is_ok_and(|seven| seven == 7));
        drop(never);
    }
}
