//! Limits of open files and memory: an emulator needs some for each PLC, door and client, often more than the soft limit
//! of the process.

use super::RuntimeError;
use crate::door::RESERVED_DESCRIPTORS;
use crate::memory::limits::{FileLimit, MemoryLimit, allow_files, allow_memory};

/// For each PLC: its image, its NOVRAM, and three files of its event service.
const PER_PLC: u64 = 5;
/// For each door that the plant file opens: a listening socket, or both ends of a terminal.
const PER_DOOR: u64 = 2;
/// For each client of the channel.
const PER_CLIENT: u64 = 3;
/// Files for the lock of the instance and its directory, the channel itself, the thread of the doors, the watch of the
/// images, and short use.
const BESIDES: u64 = 26;
/// Smallest number of clients: an emulator with files for fewer is not started.
const FEW_CLIENTS: u64 = 4;
/// Number of clients with reserved files; up to this number none is refused for lack of files.
const ALL_CLIENTS: u64 = 32;

/// Memory of an emulator with full journals and the first PLC, in bytes (promise 14).
pub(crate) const MEMORY: u64 = 32 << 20;
/// Memory of each PLC, in bytes.
const MEMORY_PER_PLC: u64 = 1 << 20;

/// Raises the limit for the files that these PLCs and doors need, and the clients of the channel, in addition to the
/// open files.
///
/// # Errors
/// The process may not open this number of files.
pub(super) fn allow_files_of(plcs: usize, doors: usize) -> Result<(), RuntimeError> {
    let needed = PER_PLC * plcs as u64 + PER_DOOR * doors as u64 + BESIDES;
    // A door opens only if it leaves the reserved files to the channel.
    let reserved = if doors == 0 { 0 } else { RESERVED_DESCRIPTORS };
    let few = reserved.max(FEW_CLIENTS * PER_CLIENT);
    allow_files(needed + few, needed + few.max(ALL_CLIENTS * PER_CLIENT))
        .map_err(|FileLimit { needed, most }| RuntimeError::OpenFiles { plcs, needed, most })
}

/// Raises the limits for the memory that an emulator with these PLCs can have in the course of time.
///
/// # Errors
/// The process may not have this memory.
pub(super) fn allow_memory_of(plcs: usize) -> Result<(), RuntimeError> {
    let needed = MEMORY + MEMORY_PER_PLC * plcs as u64;
    allow_memory(needed).map_err(|MemoryLimit { what, option, needed, most }| RuntimeError::MemoryLimit {
        plcs,
        what,
        option,
        needed,
        most,
    })
}
