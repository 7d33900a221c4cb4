//! Signals that end a command.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// Returns the signals that end a command in an orderly way. A parent such as `nohup` ignores SIGHUP for its command, so
/// that the command continues after the end of the terminal.
pub(crate) fn termination() -> impl Iterator<Item = i32> {
    let hang_up = Some(SIGHUP).filter(|signal| !is_ignored(*signal));
    [SIGINT, SIGTERM].into_iter().chain(hang_up)
}

fn is_ignored(signal: i32) -> bool {
    // SAFETY: all bytes zero are a valid value, and the call only writes the present action into it.
    let action = unsafe {
        let mut action: libc::sigaction = core::mem::zeroed();
        libc::sigaction(signal, core::ptr::null(), &raw mut action);
        action
    };
    action.sa_sigaction == libc::SIG_IGN
}

/// Unblocks all signals. A parent with blocked signals passes them on to this process, and they would have no effect.
pub(super) fn unblock() {
    // SAFETY: both calls only access the set, and all bytes zero are a valid value of it.
    unsafe {
        let mut none: libc::sigset_t = core::mem::zeroed();
        libc::sigemptyset(&raw mut none);
        libc::pthread_sigmask(libc::SIG_SETMASK, &raw const none, core::ptr::null_mut());
    }
}
