//! Limits the file descriptors of doors and guests. Some descriptors are reserved for the channel, so that clients can
//! always connect.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::io;

/// Number of file descriptors that doors and guests must leave free. The channel needs some for each client that
/// connects.
pub(crate) const RESERVED: u64 = 32;
/// Number by which a process raises its limit of descriptors if doors or guests need more.
const MORE: u64 = 128;

/// Checks, after a descriptor was opened, that enough descriptors are free.
///
/// # Errors
/// Only reserved descriptors are free, and this process cannot raise its limit.
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

/// Returns the number of open descriptors of this process that are below `limit`. The operating system gives no higher
/// numbers. The descriptor that this function opens is not counted.
fn used_below(limit: u64) -> io::Result<u64> {
    let mut used = 0;
    for entry in std::fs::read_dir("/proc/self/fd")? {
        let number = entry?.file_name().to_str().and_then(|name| name.parse::<u64>().ok());
        used += u64::from(number.is_some_and(|number| number < limit));
    }
    Ok(used.saturating_sub(1))
}
