//! Raises the limits of open files and memory. An emulator needs files and memory for each PLC, door and client, often
//! more than the soft limit of the process allows.

use super::RuntimeError;
use crate::door::RESERVED_DESCRIPTORS;
use crate::memory::limits::space::{MemoryLimit, allow_memory};
use crate::memory::limits::{FileLimit, allow_files};
use crate::memory::process::read_kernel_file;

/// Open files for each PLC: its image, its NOVRAM, and three files of its event service.
const PER_PLC: u64 = 5;
/// Open files for each door that the plant file opens: a listening socket, or both ends of a terminal.
const PER_DOOR: u64 = 2;
/// Open files for each client of the channel.
const PER_CLIENT: u64 = 3;
/// Number of other open files: the lock of the instance and its directory, the channel, the thread of the doors, the
/// watch of the images, and files for short use.
const BESIDES: u64 = 26;
/// Minimum number of clients. If the limit does not leave files for them, the emulator does not start.
const FEW_CLIENTS: u64 = 4;
/// Number of clients for which files are reserved. Up to this number no client is refused for lack of files.
const ALL_CLIENTS: u64 = 32;

/// The permissions of the owner in a file mode.
const OF_OWNER: u32 = 0o700;

/// Memory of an emulator with full journals and the first PLC, in bytes (promise 14).
pub(crate) const MEMORY: u64 = 32 << 20;
/// Memory of each PLC, in bytes.
const MEMORY_PER_PLC: u64 = 1 << 20;

/// Raises the limit of open files, so that it is enough for the files that are already open, these PLCs and doors, and
/// the clients of the channel.
///
/// # Errors
/// The process may not open this number of files.
pub(super) fn allow_files_of(plcs: usize, doors: usize) -> Result<(), RuntimeError> {
    let needed = PER_PLC * plcs as u64 + PER_DOOR * doors as u64 + BESIDES;
    // A door opens only if the reserved descriptors stay free for the channel. So these count, too, if there are doors.
    let reserved = if doors == 0 { 0 } else { RESERVED_DESCRIPTORS };
    let few = reserved.max(FEW_CLIENTS * PER_CLIENT);
    allow_files(needed + few, needed + few.max(ALL_CLIENTS * PER_CLIENT))
        .map_err(|FileLimit { needed, most }| RuntimeError::OpenFiles { plcs, needed, most })
}

/// Checks that new files and directories of this process get all permissions of their owner. Only root could use files
/// without them, and iceoryx2 refuses such files.
///
/// # Errors
/// The file mode creation mask takes such a permission.
pub(super) fn check_umask() -> Result<(), RuntimeError> {
    // The system call that returns the mask also changes it, for all threads. Without /proc nothing is checked.
    let status = read_kernel_file("/proc/self/status").unwrap_or_default();
    let mask =
        status.lines().find_map(|line| u32::from_str_radix(line.strip_prefix("Umask:")?.trim(), 8).ok());
    match mask.filter(|mask| mask & OF_OWNER != 0) {
        Some(mask) => Err(RuntimeError::Umask { mask }),
        None => Ok(()),
    }
}

/// Raises the limits of memory, so that they are enough for an emulator with these PLCs and full journals.
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
