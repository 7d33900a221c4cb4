//! Keeps the files of the channel from programs that this process starts.
//!
//! iceoryx2 opens its files without `O_CLOEXEC`. A started program that runs as another user could read and damage the
//! channel through them.

use super::shm::SHM;
use rustix::io::{FdFlags, fcntl_getfd, fcntl_setfd};
use std::os::fd::{BorrowedFd, RawFd};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

/// Sets `FD_CLOEXEC` for all open files of this process that are in the directory `root`, or that are shared memory
/// objects with names that begin with `prefix`. Does nothing if `/proc` is missing.
pub(super) fn keep_from_programs(root: &Path, prefix: &str) {
    for (descriptor, path) in open_files() {
        if is_of_channel(&path, root, prefix) {
            // SAFETY: the descriptor was open a moment ago and is used for two system calls only. If another thread has
            // closed it, the calls fail, or concern the next file of this number, which stays open in this process.
            let descriptor = unsafe { BorrowedFd::borrow_raw(descriptor) };
            let flags = fcntl_getfd(descriptor);
            let _ = flags.and_then(|flags| fcntl_setfd(descriptor, flags | FdFlags::CLOEXEC));
        }
    }
}

fn is_of_channel(path: &Path, root: &Path, prefix: &str) -> bool {
    let is_object = |name: &Path| name.as_os_str().as_bytes().starts_with(prefix.as_bytes());
    path.starts_with(root) || path.strip_prefix(SHM).is_ok_and(is_object)
}

/// Returns the open files of this process with their paths.
fn open_files() -> impl Iterator<Item = (RawFd, std::path::PathBuf)> {
    let entries = std::fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
    entries.filter_map(|entry| {
        let descriptor = entry.file_name().to_str()?.parse().ok()?;
        Some((descriptor, std::fs::read_link(entry.path()).ok()?))
    })
}
