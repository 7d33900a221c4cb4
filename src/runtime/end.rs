//! The request to end an emulator, with its reason.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set when the emulator must end.
#[derive(Debug, Default)]
pub(super) struct EndRequest {
    is_made: AtomicBool,
    reason: OnceLock<Option<String>>,
}

impl EndRequest {
    /// Asks the emulator to end. The first request decides the reason.
    pub(super) fn make(&self, reason: Option<String>) {
        let _ = self.reason.set(reason);
        self.is_made.store(true, Ordering::Release);
    }

    pub(super) fn is_made(&self) -> bool {
        self.is_made.load(Ordering::Acquire)
    }

    /// Returns the reason, if the request is made and its reason is known.
    pub(super) fn reason(&self) -> Option<&str> {
        self.reason.get()?.as_deref()
    }
}
