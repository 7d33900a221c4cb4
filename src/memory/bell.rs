//! Bells: futex words in the header page that processes wait on and ring.

use super::Cell32;
use core::sync::atomic::Ordering;
use rustix::thread::futex;
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// A word to wait on and the number of those who wait.
///
/// Ringing makes a system call only if somebody waits. The handshake that makes this safe needs
/// sequential consistency on both words: the ringer counts the word up and then reads `waiters`, the
/// waiter enters itself in `waiters` and then reads the word; one of the two sees the other.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Bell {
    /// Counts the rings, wrapping. The futex word.
    word: Cell32,
    /// Waiters that may be asleep. Too high a number (a waiter was killed) costs a system call per ring.
    waiters: Cell32,
}

// SAFETY: both fields are cells and there is no padding (IntoBytes).
unsafe impl super::SharedRegs for Bell {}

impl Bell {
    /// The number of rings so far, wrapping. Read it *before* looking at what the bell announces; a
    /// wait for a ring after this number then misses nothing.
    pub fn rings(&self) -> u32 {
        u32::from_le(self.word.as_atomic().load(Ordering::SeqCst))
    }

    /// Rings: everything stored before is visible to whoever sees the new number. Wakes all waiters.
    pub fn ring(&self) {
        add(&self.word, 1);
        if self.waiters.as_atomic().load(Ordering::SeqCst) != 0 {
            // The word is mapped and aligned, so the call cannot fail.
            let _ = futex::wake(self.word.as_atomic(), futex::Flags::empty(), i32::MAX as u32);
        }
    }
}

/// Adds to a cell of a bell, sequentially consistent.
fn add(cell: &Cell32, amount: u32) {
    let atomic = cell.as_atomic();
    if cfg!(target_endian = "little") {
        atomic.fetch_add(amount, Ordering::SeqCst);
    } else {
        let sum = |raw| Some(u32::from_le(raw).wrapping_add(amount).to_le());
        let _ = atomic.fetch_update(Ordering::SeqCst, Ordering::SeqCst, sum);
    }
}
