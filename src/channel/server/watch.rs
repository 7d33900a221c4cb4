//! Detects shortened memory of the channel.

use crate::channel::shm;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Checks whether a program has shortened a part of the channel: an access to the missing part kills the
/// process (SIGBUS).
#[derive(Clone, Debug)]
pub struct ChannelWatch {
    /// The server's shared memory objects, and the length in bytes that each object had at the start of the
    /// watch.
    pub(super) objects: Arc<[(PathBuf, u64)]>,
    pub(super) damaged: Arc<AtomicBool>,
}

impl ChannelWatch {
    /// Checks the lengths of all objects. Returns true if any check has found a shortened object.
    pub fn look(&self) -> bool {
        let is_short = |(path, length): &(PathBuf, u64)| shm::length(path).is_some_and(|now| now < *length);
        if self.objects.iter().any(is_short) {
            self.damaged.store(true, Ordering::Release);
        }
        self.is_damaged()
    }

    /// True if any check has found a shortened object.
    #[inline]
    pub fn is_damaged(&self) -> bool {
        self.damaged.load(Ordering::Acquire)
    }
}
