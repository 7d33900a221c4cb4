//! Checks whether a process may have the memory that it needs.

use super::{MEMORIES, Memory};
use rustix::process::{Rlimit, getrlimit, setrlimit};

/// Number of bytes by which the memory of the same program may differ between two starts. The heap and the arenas of
/// threads grow in steps of 132 KiB. Whether one more step is needed depends on random addresses and on the order of
/// threads.
const SPREAD: u64 = 512 << 10;

/// A limit of the memory of this process that is too low.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MemoryLimit {
    /// Name of the limited memory, for example `data`.
    pub(crate) what: &'static str,
    /// Option of `ulimit`, for example `-d`.
    pub(crate) option: &'static str,
    /// Number of bytes that the process needs.
    pub(crate) needed: u64,
    /// Number of bytes that the process may have.
    pub(crate) most: u64,
}

/// Makes sure that this process can have `more` bytes of data and address space in addition to the present ones; raises
/// its soft limits if necessary.
///
/// # Errors
/// The limit that is too low, with a number of bytes that is also enough for the next start.
pub(crate) fn allow_memory(more: u64) -> Result<(), MemoryLimit> {
    for memory in MEMORIES {
        let Memory { resource, what, option, .. } = memory;
        let Rlimit { current, maximum } = getrlimit(resource);
        let Some(most) = current else { continue };
        let needed = memory.used().saturating_add(more);
        if most >= needed {
            continue;
        }
        let can_be_raised = maximum.is_none_or(|maximum| maximum >= needed);
        if !can_be_raised || setrlimit(resource, Rlimit { current: maximum, maximum }).is_err() {
            return Err(MemoryLimit { what, option, needed: needed.saturating_add(SPREAD), most });
        }
    }
    Ok(())
}

/// Checks that this process can have `more` bytes of address space in addition to the present ones.
///
/// # Errors
/// A number of bytes that is also enough for the next start, and the allowed number.
#[cfg(feature = "channel")]
pub(crate) fn check_address_space(more: u64) -> Result<(), (u64, u64)> {
    let Some(most) = super::ADDRESS_SPACE.limit() else { return Ok(()) };
    let needed = super::ADDRESS_SPACE.used().saturating_add(more);
    if most < needed { Err((needed.saturating_add(SPREAD), most)) } else { Ok(()) }
}

/// Returns the memory in bytes that counts for the limit `ulimit -d` of this process.
#[cfg(feature = "cli")]
pub(crate) fn data_in_use() -> u64 {
    super::DATA.used()
}
