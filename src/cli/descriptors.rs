//! File descriptors that this process has inherited, and the programs that it starts.

use std::os::fd::RawFd;

/// Numbers of descriptors that are tried if `/proc` is missing.
const UNLISTED: RawFd = 1024;

/// Returns the open descriptors from 3 on that a started program would inherit.
pub(super) fn inheritable() -> Vec<RawFd> {
    // Without /proc, the first numbers are tried.
    let listed = std::fs::read_dir("/proc/self/fd").map(|files| {
        let names = files.flatten().map(|file| file.file_name());
        names.filter_map(|name| name.to_str()?.parse().ok()).collect::<Vec<RawFd>>()
    });
    let numbers = listed.unwrap_or_else(|_| (3..UNLISTED).collect());
    numbers.into_iter().filter(|number| *number > 2 && is_inheritable(*number)).collect()
}

fn is_inheritable(descriptor: RawFd) -> bool {
    // SAFETY: a plain system call on a number; it does not change the memory of this process.
    let flags = unsafe { libc::fcntl(descriptor, libc::F_GETFD) };
    flags >= 0 && flags & libc::FD_CLOEXEC == 0
}

/// Keeps these descriptors from programs that this process starts from now on.
pub(super) fn keep_from_programs(descriptors: &[RawFd]) {
    for descriptor in descriptors {
        // SAFETY: as above. A descriptor that has been closed in the meantime is an error, which is ignored.
        let _ = unsafe { libc::fcntl(*descriptor, libc::F_SETFD, libc::FD_CLOEXEC) };
    }
}
