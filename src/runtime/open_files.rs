//! Open files: an emulator has some for each PLC, door and client, which may be more than a process may have unless it asks.

use super::RuntimeError;
use crate::door::RESERVED_DESCRIPTORS;
use crate::memory::limits::{FileLimit, allow_files};

/// For each PLC: its image, its NOVRAM, and three of its event service.
const PER_PLC: u64 = 5;
/// For each door that the plant file opens: a listening socket, or both ends of a terminal.
const PER_DOOR: u64 = 2;
/// For each client of the channel.
const PER_CLIENT: u64 = 3;
/// The channel itself, the thread of the doors, what watches the images, and files that are only open for a moment.
const BESIDES: u64 = 24;
/// An emulator without room for so many clients at a time is not started.
const FEW_CLIENTS: u64 = 4;
/// With room for so many none is refused because of open files.
const ALL_CLIENTS: u64 = 32;

/// Asks the system for the files that so many PLCs and doors need, and the clients of the channel, beside those that are open
/// already.
///
/// # Errors
/// They are more than this process may have.
pub(super) fn allow(plcs: usize, doors: usize) -> Result<(), RuntimeError> {
    let needed = PER_PLC * plcs as u64 + PER_DOOR * doors as u64 + BESIDES;
    // A door opens only if it leaves to the channel what is reserved for it.
    let reserved = if doors == 0 { 0 } else { RESERVED_DESCRIPTORS };
    let few = reserved.max(FEW_CLIENTS * PER_CLIENT);
    allow_files(needed + few, needed + few.max(ALL_CLIENTS * PER_CLIENT))
        .map_err(|FileLimit { needed, most }| RuntimeError::OpenFiles { plcs, needed, most })
}
