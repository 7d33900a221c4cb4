//! Writes to the outputs of this process. After a termination signal, a write returns even if the output is not read.

use std::io::{self, ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

/// Longest wait, after a termination signal, for an output that accepts no bytes.
const PATIENCE: Duration = Duration::from_millis(400);
/// Real time between two checks for a termination signal.
const INTERVAL: Duration = Duration::from_millis(20);
/// Number of bytes of one write. If a terminal or pipe accepts such a part, a reader is reading it.
const PART: usize = 4096;

/// Flag that a termination signal sets. Empty if signals end this process at once, or do not concern its outputs.
static HAS_TO_END: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Makes writes return early: when `has_to_end` is set, this process no longer waits for outputs that are not read.
/// Only the first call in a process has an effect.
pub(crate) fn give_up_after(has_to_end: Arc<AtomicBool>) {
    let _ = HAS_TO_END.set(has_to_end);
}

/// Writes and flushes all bytes.
///
/// # Errors
/// The output cannot be written. [`ErrorKind::Interrupted`]: a termination signal has arrived and the output is not read.
pub(super) fn write<W: Write + 'static>(output: fn() -> W, bytes: &[u8]) -> io::Result<()> {
    let Some(has_to_end) = HAS_TO_END.get() else { return write_parts(output, bytes, |()| {}) };
    let (send, written) = mpsc::channel();
    let copy = bytes.to_vec();
    // A blocked write cannot be cancelled, so it runs in a separate thread.
    let work = move || {
        let result = write_parts(output, &copy, |()| drop(send.send(Ok(()))));
        let _ = result.map_err(|reason| send.send(Err(reason)));
    };
    if thread::Builder::new().name("output".to_owned()).spawn(work).is_err() {
        return write_parts(output, bytes, |()| {});
    }
    let mut waited = Duration::ZERO;
    loop {
        match written.recv_timeout(INTERVAL) {
            Ok(Ok(())) => waited = Duration::ZERO,
            Ok(Err(reason)) => return Err(reason),
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
            Err(RecvTimeoutError::Timeout) if !has_to_end.load(Ordering::Relaxed) => {}
            Err(RecvTimeoutError::Timeout) if waited >= PATIENCE => return Err(ErrorKind::Interrupted.into()),
            Err(RecvTimeoutError::Timeout) => waited += INTERVAL,
        }
    }
}

/// Writes all bytes, and calls `took` after each part that was written.
fn write_parts<W: Write>(output: fn() -> W, bytes: &[u8], mut took: impl FnMut(())) -> io::Result<()> {
    let mut output = output();
    bytes
        .chunks(PART)
        .try_for_each(|part| output.write_all(part).and_then(|()| output.flush()).map(&mut took))
}
