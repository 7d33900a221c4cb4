//! Open files: an emulator has some for each PLC, which may be more than a process may have unless it asks.

use super::RuntimeError;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// For each PLC: its image, and three of its event service.
const PER_PLC: u64 = 4;
/// Whatever the number of PLCs is.
const BESIDES: u64 = 24;

/// Asks the system for as many as so many PLCs need.
///
/// # Errors
/// They are more than this process may have.
pub(super) fn allow(plcs: usize) -> Result<(), RuntimeError> {
    let needed = PER_PLC * plcs as u64 + BESIDES;
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    if current.is_none_or(|current| current >= needed) {
        return Ok(());
    }
    let raised = Rlimit { current: Some(needed), maximum };
    let refused = maximum.is_some_and(|most| most < needed) || setrlimit(Resource::Nofile, raised).is_err();
    if refused {
        return Err(RuntimeError::OpenFiles { plcs, needed, most: maximum.or(current).unwrap_or(needed) });
    }
    Ok(())
}
