//! Bells: futex words in the header page that processes wait on and ring.
//!
//! Ringing makes a system call only if a process waits. A handshake of ringer and waiter makes this safe. It is
//! implemented below, and a model in the tests checks all of its interleavings. The ringer increments the word and
//! *then* reads the number of waiters. The waiter increments that number and *then* reads the word. A sequentially
//! consistent fence separates the two steps on both sides, so at least one side sees the change of the other side, and
//! no wake-up is lost. C clients may use `atomic_fetch_add` and `atomic_load`, which are sequentially consistent, in
//! place of the fences.

use super::Cell32;
use core::sync::atomic::{self, Ordering};
use rustix::{
    io::Errno,
    thread::futex,
    time::{ClockId, Timespec, clock_gettime},
};
use std::time::{Duration, Instant};
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// The kernel's limit for waiting on several words at once.
const MAX_WAITV: usize = 128;
/// Poll interval for several words where the kernel cannot wait on them together.
const POLL: Duration = Duration::from_millis(1);

/// A word to wait on, and the number of waiters. The futex is shared: it works between processes that
/// map the same file.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Bell {
    /// Number of rings, wrapping. This word is the futex.
    word: Cell32,
    /// Number of waiters that may be asleep. If a waiter was killed, the number stays too high, and each ring makes an
    /// unnecessary system call.
    waiters: Cell32,
}

super::struct_tables::publish! { Bell: 0 => word, 4 => waiters }

// SAFETY: both fields are cells and there is no padding (IntoBytes).
unsafe impl super::SharedRegs for Bell {}

impl Bell {
    /// Returns the number of rings so far, wrapping. Read the number *before* the data that the bell announces. Then
    /// pass it to [`Bell::wait`], which returns immediately if the bell has rung since.
    pub fn rings(&self) -> u32 {
        self.word.load()
    }

    /// Rings: a process that sees the new number also sees all earlier stores. Wakes all waiters.
    pub fn ring(&self) {
        ring(self);
    }

    /// Waits until the bell has rung more than `seen` times, for at most `timeout` (`None`: without a limit). Returns
    /// true if it has rung, and false on a timeout.
    pub fn wait(&self, seen: u32, timeout: Option<Duration>) -> bool {
        wait_any(&[(self, seen)], timeout).is_some()
    }

    /// Sets the number of waiters to 0. Called when all of them are known to be dead.
    pub(super) fn forget_waiters(&self) {
        self.waiters.store(0);
    }
}

/// Waits until one of the bells has rung more often than the number next to it, for at most `timeout`
/// (`None`: without a limit). Returns the position of the first such bell; `None` on a timeout.
///
/// The kernel waits on up to 128 bells together (Linux 5.16 or later). On older kernels the bells are
/// polled once per millisecond.
pub(crate) fn wait_any(bells: &[(&Bell, u32)], timeout: Option<Duration>) -> Option<usize> {
    // A deadline that cannot be represented means no deadline.
    let deadline = timeout.and_then(|timeout| Instant::now().checked_add(timeout));
    loop {
        if let Some(rung) = bells.iter().position(|(bell, seen)| bell.rings() != *seen) {
            return Some(rung);
        }
        let left = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
        if left.is_some_and(|left| left.is_zero()) {
            return None;
        }
        wait_once(bells, || sleep(bells, left));
    }
}

/// Sleeps until a bell rings, the time is over or a signal arrives. An error of a system call means one of these
/// events, or that there is no reason to sleep. In each case the caller checks the bells again.
fn sleep(bells: &[(&Bell, u32)], left: Option<Duration>) {
    let pause = || std::thread::sleep(left.map_or(POLL, |left| left.min(POLL)));
    match bells {
        [(bell, seen)] => {
            let left = left.and_then(|left| Timespec::try_from(left).ok());
            let flags = futex::Flags::empty();
            let _ = futex::wait(bell.word.as_futex(), flags, seen.to_le(), left.as_ref());
        }
        [] => pause(),
        _ if bells.len() > MAX_WAITV => pause(),
        _ => {
            let waits: Vec<futex::Wait> = bells.iter().map(|(bell, seen)| one_of_many(bell, *seen)).collect();
            let clock = ClockId::Monotonic;
            let until =
                left.and_then(|left| clock_gettime(clock).checked_add(Timespec::try_from(left).ok()?));
            let flags = futex::WaitvFlags::empty();
            if futex::waitv(&waits, flags, until.as_ref(), clock) == Err(Errno::NOSYS) {
                pause();
            }
        }
    }
}

fn one_of_many(bell: &Bell, seen: u32) -> futex::Wait {
    let mut wait = futex::Wait::new();
    wait.val = u64::from(seen.to_le());
    wait.uaddr = futex::WaitPtr::new(bell.word.as_ptr().cast());
    wait.flags = futex::WaitFlags::SIZE_U32;
    wait
}

/// The steps of the handshake. A bell implements them, and so does the model of a bell in the tests.
trait Line {
    fn rings(&self) -> u32;
    fn count_ring(&self);
    fn has_waiters(&self) -> bool;
    fn enter(&self);
    fn leave(&self);
    fn wake_all(&self);
    /// A sequentially consistent fence.
    fn fence();
}

fn ring<L: Line>(line: &L) {
    line.count_ring();
    L::fence();
    if line.has_waiters() {
        line.wake_all();
    }
}

/// `sleep` must compare the words again and return if one of them has changed, as the kernel does.
fn wait_once<L: Line>(lines: &[(&L, u32)], sleep: impl FnOnce()) {
    lines.iter().for_each(|(line, _)| line.enter());
    L::fence();
    if lines.iter().all(|(line, seen)| line.rings() == *seen) {
        sleep();
    }
    lines.iter().for_each(|(line, _)| line.leave());
}

impl Line for Bell {
    fn rings(&self) -> u32 {
        self.rings()
    }

    fn count_ring(&self) {
        self.word.add(1);
    }

    fn has_waiters(&self) -> bool {
        self.waiters.load() != 0
    }

    fn enter(&self) {
        self.waiters.add(1);
    }

    fn leave(&self) {
        self.waiters.add(u32::MAX);
    }

    fn wake_all(&self) {
        // The word is mapped and aligned, so the call cannot fail.
        let _ = futex::wake(self.word.as_futex(), futex::Flags::empty(), i32::MAX as u32);
    }

    fn fence() {
        atomic::fence(Ordering::SeqCst);
    }
}

#[cfg(test)]
mod model;
#[cfg(test)]
mod tests;
