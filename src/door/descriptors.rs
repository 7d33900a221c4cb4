//! File descriptors: doors and guests leave some to the channel, so that any number of guests leaves its clients a
//! connection.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::io;

/// File descriptors that neither doors nor guests take. The channel needs some for each client that connects.
pub(crate) const RESERVED: u64 = 32;
/// Count of further descriptors that a process requests from the system if doors or guests need some.
const MORE: u64 = 128;

/// Checks that enough descriptors are left after one was opened.
///
/// # Errors
/// Only reserved descriptors are left, and this process may not have more.
pub(super) fn check_room() -> io::Result<()> {
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let Some(limit) = current else { return Ok(()) };
    let missing = RESERVED.saturating_sub(limit.saturating_sub(used_below(limit)?));
    if missing == 0 {
        return Ok(());
    }
    let raised = maximum.map_or(limit + MORE, |most| most.min(limit + MORE));
    let is_enough = raised >= limit + missing;
    if is_enough && setrlimit(Resource::Nofile, Rlimit { current: Some(raised), maximum }).is_ok() {
        return Ok(());
    }
    let text = format!(
        "the last {RESERVED} of {limit} file descriptors are reserved for the channel; raise the limit of the emulator (ulimit -n)"
    );
    Err(io::Error::other(text))
}

/// Count of descriptors with a number below `limit` in this process; the system gives none with a higher number. The
/// descriptor for this count itself is not included.
fn used_below(limit: u64) -> io::Result<u64> {
    let mut used = 0;
    for entry in std::fs::read_dir("/proc/self/fd")? {
        let number = entry?.file_name().to_str().and_then(|name| name.parse::<u64>().ok());
        used += u64::from(number.is_some_and(|number| number < limit));
    }
    Ok(used.saturating_sub(1))
}
