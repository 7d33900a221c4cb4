//! A limit for what iceoryx2 may do for ever.
//!
//! Parts of the channel can be damaged by any program of the same user, and iceoryx2 waits on some of them without a
//! limit: a pipe in the place of a file, an object without a length. Nothing can call a thread back from there, so it
//! is left behind if it takes too long.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// For what waits for nobody.
pub(super) const SHORT: Duration = Duration::from_secs(1);

/// Why there is no result.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Lost {
    /// It takes too long.
    Late,
    /// The thread could not be started or has panicked.
    Ended,
}

/// Does `work` on a thread of its own and waits for it, for at most `limit`.
pub(super) fn on_a_thread<R: Send + 'static>(
    limit: Duration,
    work: impl FnOnce() -> R + Send + 'static,
) -> Result<R, Lost> {
    let (done, result) = mpsc::sync_channel(1);
    let thread = std::thread::Builder::new().name("channel".to_owned());
    // If nobody waits any more, what comes too late is dropped there.
    let thread = thread.spawn(move || drop(done.send(work()))).map_err(|_| Lost::Ended)?;
    let result = result.recv_timeout(limit).map_err(|error| match error {
        RecvTimeoutError::Timeout => Lost::Late,
        RecvTimeoutError::Disconnected => Lost::Ended,
    })?;
    // It is about to end; whoever looks at the process behind this finds no thread of it.
    let _ = thread.join();
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_for_ever_is_left_behind() {
        let (never, ends) = mpsc::channel::<()>();
        let waits = move || ends.recv().is_ok();
        assert_eq!(on_a_thread(Duration::from_millis(1), waits), Err(Lost::Late));
        assert!(on_a_thread(Duration::from_secs(60), || 7).is_ok_and(|seven| seven == 7));
        drop(never);
    }
}
