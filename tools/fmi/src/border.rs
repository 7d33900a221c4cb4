//! Common parts of all functions: their types, and the handling of invalid pointers and panics.

use super::instance::Inner;
use core::ffi::{c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Result of a function.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// The function was successful.
    Ok,
    /// The function was successful, with a warning.
    Warning,
    /// The function had no effect, and the caller may continue without it (`fmi3Discard`).
    Discard,
    /// The function failed with an error.
    Error,
    /// The instance can no longer be used.
    Fatal,
}

/// An instance, as the caller sees it.
pub type Instance = *mut c_void;
/// Callback that receives messages.
pub type LogMessage = Option<unsafe extern "C" fn(*mut c_void, Status, *const c_char, *const c_char)>;
/// Never called: a unit has no intermediate values within a step.
pub type IntermediateUpdate = Option<unsafe extern "C" fn()>;
/// Never called: there are no clocks.
pub type ClockUpdate = Option<unsafe extern "C" fn()>;
/// Never called: there are no clocks.
pub type LockPreemption = Option<unsafe extern "C" fn()>;
/// FMI type that this unit never writes.
pub type DependencyKind = c_int;
/// FMI type that this unit never writes.
pub type IntervalQualifier = c_int;

/// A function: name, types of the arguments, return type.
pub type Signature = (&'static str, &'static [&'static str], &'static str);

/// Functions that the shared object exports, and a table of their signatures.
macro_rules! exported {
    ($(fn $name:ident($($argument:ident: $ty:ty),* $(,)?) -> $returned:ty $body:block)*) => {
        $(
            #[doc = concat!("`", stringify!($name), "` of FMI 3.0.")]
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $name($($argument: $ty),*) -> $returned $body
        )*

        /// Signatures of these functions.
        pub const SIGNATURES: &[$crate::border::Signature] =
            &[$((stringify!($name), &[$(stringify!($ty)),*], stringify!($returned))),*];
    };
}
pub(crate) use exported;

/// Reason for a refusal: the error, and the correct form.
pub(crate) struct Refused(pub String);

impl<E: std::error::Error> From<E> for Refused {
    fn from(error: E) -> Self {
        Refused(error.to_string())
    }
}

/// Calls `what` with an instance; an error is reported to the log callback.
pub(crate) fn with(instance: Instance, what: impl FnOnce(&mut Inner) -> Result<(), Refused>) -> Status {
    // SAFETY: the caller has the pointer from `fmi3InstantiateCoSimulation`, has not freed it, and uses it in one
    // thread at a time, as the standard demands.
    let Some(instance) = (unsafe { instance.cast::<Inner>().as_mut() }) else { return Status::Error };
    if instance.is_broken() {
        return Status::Fatal;
    }
    match catch_unwind(AssertUnwindSafe(|| what(&mut *instance))) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(Refused(text))) => {
            instance.log(Status::Error, &text);
            Status::Error
        }
        Err(_) => {
            instance.mark_broken();
            instance.log(Status::Fatal, "internal error of commram; this instance can no longer be used");
            Status::Fatal
        }
    }
}

/// Returns `count` values that the function reads.
///
/// # Safety
/// `first` points to `count` values, or is null.
pub(crate) unsafe fn read<'a, T>(first: *const T, count: usize) -> Result<&'a [T], Refused> {
    if count == 0 {
        return Ok(&[]);
    }
    if first.is_null() {
        return Err(Refused(format!("{count} values at a null pointer")));
    }
    // SAFETY: by the contract of this function.
    Ok(unsafe { core::slice::from_raw_parts(first, count) })
}

/// Returns `count` values that the function writes.
///
/// # Safety
/// The conditions of [`read`] hold, and no other code uses the values in the meantime.
pub(crate) unsafe fn write<'a, T>(first: *mut T, count: usize) -> Result<&'a mut [T], Refused> {
    if count == 0 {
        return Ok(&mut []);
    }
    if first.is_null() {
        return Err(Refused(format!("{count} values at a null pointer")));
    }
    // SAFETY: by the contract of this function.
    Ok(unsafe { core::slice::from_raw_parts_mut(first, count) })
}

/// Writes one value unless `to` is null.
///
/// # Safety
/// The conditions of [`write()`] hold.
pub(crate) unsafe fn give<T>(to: *mut T, value: T) {
    // SAFETY: by the contract of this function.
    if let Some(to) = unsafe { to.as_mut() } {
        *to = value;
    }
}
