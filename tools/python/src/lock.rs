//! A lock that notices when the thread that holds it asks for it again.
//!
//! During a verb, Python runs signal handlers in the thread of the verb, and may run finalizers there. If one of these
//! waited for the lock of the verb, the thread would wait for itself.

use crate::errors;
use core::ptr;
use core::sync::atomic::{AtomicUsize, Ordering};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, MutexGuard, PoisonError};

thread_local! {
    /// A variable of each thread; its address identifies the thread.
    static HERE: u8 = const { 0 };
}

fn here() -> usize {
    HERE.with(|of_thread| ptr::from_ref(of_thread).addr())
}

/// A value for one thread at a time.
pub(crate) struct Lock<T> {
    value: Mutex<T>,
    /// The thread that holds the lock; 0 if no thread holds it.
    holder: AtomicUsize,
}

/// A locked value.
pub(crate) struct Guard<'a, T> {
    value: MutexGuard<'a, T>,
    holder: &'a AtomicUsize,
}

impl<T> Lock<T> {
    pub(crate) fn new(value: T) -> Self {
        Self { value: Mutex::new(value), holder: AtomicUsize::new(0) }
    }

    /// Returns the value, which no other code can lock now.
    pub(crate) fn get_mut(&mut self) -> &mut T {
        self.value.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// True if this thread holds the lock.
    pub(crate) fn is_held_here(&self) -> bool {
        // Only this thread stores the number of this thread.
        self.holder.load(Ordering::Relaxed) == here()
    }

    /// Locks the value. Other Python threads can run while this thread waits.
    ///
    /// # Errors
    /// This thread already holds the lock, or a verb has panicked.
    pub(crate) fn lock(&self, py: Python<'_>) -> PyResult<Guard<'_, T>> {
        if self.is_held_here() {
            let busy = "this is busy: a signal handler or finalizer cannot use it during a verb of its thread; it \
                        can close it, or raise an exception, which ends the verb";
            return Err(errors::of_class("Error", busy));
        }
        let lost = "a verb has panicked; this cannot be used any more";
        let value = self.value.lock_py_attached(py).map_err(|_| PyRuntimeError::new_err(lost))?;
        self.holder.store(here(), Ordering::Relaxed);
        Ok(Guard { value, holder: &self.holder })
    }
}

impl<T> Drop for Guard<'_, T> {
    fn drop(&mut self) {
        // The field `value` unlocks after this, so the store precedes that of the next holder.
        self.holder.store(0, Ordering::Relaxed);
    }
}

impl<T> Deref for Guard<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Guard<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}
