//! Whether the channel's memory is still as long as it was.

use crate::channel::shm;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Looks whether a program shortens a part of the channel: whoever touches what is missing is killed (SIGBUS).
#[derive(Clone, Debug)]
pub struct ChannelWatch {
    /// The server's shared memory objects and their lengths in bytes.
    pub(super) objects: Arc<[(PathBuf, u64)]>,
    pub(super) damaged: Arc<AtomicBool>,
}

impl ChannelWatch {
    /// Looks at them all.
    pub fn look(&self) -> bool {
        let is_short = |(path, length): &(PathBuf, u64)| shm::length(path).is_some_and(|now| now < *length);
        if self.objects.iter().any(is_short) {
            self.damaged.store(true, Ordering::Release);
        }
        self.is_damaged()
    }

    /// Whether anybody has found one shorter than it was.
    #[inline]
    pub fn is_damaged(&self) -> bool {
        self.damaged.load(Ordering::Acquire)
    }
}
