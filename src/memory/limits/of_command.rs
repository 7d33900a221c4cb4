//! The memory that a command needs.

use super::space::MemoryLimit;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Stack that the main thread needs, in bytes.
const STACK: u64 = 1 << 20;

/// Data and address space that a command needs after its start, in bytes: stacks of threads, the heap, and the report
/// of a panic. If there is no memory, that report never ends.
pub(crate) const OF_A_COMMAND: u64 = 16 << 20;

/// Makes sure that the main thread can have the stack that it needs; raises its soft limit if necessary.
///
/// # Errors
/// The limit that is too low.
pub(crate) fn allow_stack() -> Result<(), MemoryLimit> {
    let Rlimit { current, maximum } = getrlimit(Resource::Stack);
    let Some(most) = current.filter(|current| *current < STACK) else { return Ok(()) };
    let can_be_raised = maximum.is_none_or(|maximum| maximum >= STACK);
    if can_be_raised && setrlimit(Resource::Stack, Rlimit { current: Some(STACK), maximum }).is_ok() {
        return Ok(());
    }
    Err(MemoryLimit { what: "stack", option: "-s", needed: STACK, most })
}
