//! Functions that save, restore and serialize states of an instance.

use super::border::{Instance, Refused, Status, exported, read, with, write};
use super::instance::Mode;
use commram::fmi::UnitState;
use core::ffi::c_void;

/// A state to which the caller has a pointer.
struct SavedState {
    state: UnitState,
    mode: Mode,
}

/// Returns the state at a pointer from the caller.
fn saved_state<'a>(state: *mut c_void) -> Result<&'a SavedState, Refused> {
    // SAFETY: the pointer is null, or is from `fmi3GetFMUState` or `fmi3DeserializeFMUState` and was not freed.
    unsafe { state.cast::<SavedState>().as_ref() }
        .ok_or_else(|| Refused("the state is a null pointer".to_owned()))
}

/// Returns the place where a state is to be stored.
fn place<'a>(to: *mut *mut c_void) -> Result<&'a mut *mut c_void, Refused> {
    // SAFETY: the caller passes a place for a pointer, or null.
    unsafe { to.as_mut() }.ok_or_else(|| Refused("no place for the state".to_owned()))
}

/// Stores a state. Replaces an earlier state at the same place.
fn store_state(to: &mut *mut c_void, state: SavedState) {
    // SAFETY: a pointer that is not null is a state from this library that was not freed.
    match unsafe { to.cast::<SavedState>().as_mut() } {
        Some(old) => *old = state,
        None => *to = Box::into_raw(Box::new(state)).cast(),
    }
}

exported! {
    fn fmi3GetFMUState(instance: Instance, to: *mut *mut c_void) -> Status {
        with(instance, |it| {
            store_state(place(to)?, SavedState { state: it.unit.state(), mode: it.mode });
            Ok(())
        })
    }

    fn fmi3SetFMUState(instance: Instance, state: *mut c_void) -> Status {
        with(instance, |it| {
            let kept = saved_state(state)?;
            it.unit.restore(&kept.state)?;
            it.mode = kept.mode;
            Ok(())
        })
    }

    fn fmi3FreeFMUState(instance: Instance, state: *mut *mut c_void) -> Status {
        with(instance, |_| {
            let state = core::mem::replace(place(state)?, core::ptr::null_mut());
            if !state.is_null() {
                // SAFETY: this library has created the state, and the caller does not use it any more.
                drop(unsafe { Box::from_raw(state.cast::<SavedState>()) });
            }
            Ok(())
        })
    }

    fn fmi3SerializedFMUStateSize(instance: Instance, state: *mut c_void, size: *mut usize) -> Status {
        with(instance, |it| {
            // SAFETY: the caller passes a place for the size.
            let [size] = unsafe { write(size, 1) }? else { return Ok(()) };
            *size = bytes(it, saved_state(state)?).len();
            Ok(())
        })
    }

    fn fmi3SerializeFMUState(instance: Instance, state: *mut c_void, to: *mut u8, size: usize) -> Status {
        with(instance, |it| {
            let bytes = bytes(it, saved_state(state)?);
            if size < bytes.len() {
                return Err(Refused(format!("the state has {} bytes, there is room for {size}", bytes.len())));
            }
            // SAFETY: the caller guarantees the lengths of the arrays.
            unsafe { write(to, bytes.len()) }?.copy_from_slice(&bytes);
            Ok(())
        })
    }

    fn fmi3DeserializeFMUState(
        instance: Instance,
        from: *const u8,
        size: usize,
        to: *mut *mut c_void,
    ) -> Status {
        with(instance, |it| {
            // SAFETY: the caller guarantees the lengths of the arrays.
            let (state, phase) = it.unit.of_bytes(unsafe { read(from, size) }?)?;
            let mode = match phase {
                0 => Mode::Instantiated,
                1 => Mode::Initializing,
                2 => Mode::Stepping,
                3 => Mode::Ended,
                _ => return Err(Refused(format!("these bytes are no state of this unit: it has no phase {phase}"))),
            };
            store_state(place(to)?, SavedState { state, mode });
            Ok(())
        })
    }
}

/// Returns a state as bytes, with the phase of its life cycle that the instance was in.
fn bytes(it: &super::instance::Inner, kept: &SavedState) -> Vec<u8> {
    let mode = match kept.mode {
        Mode::Instantiated => 0,
        Mode::Initializing => 1,
        Mode::Stepping => 2,
        Mode::Ended | Mode::Broken => 3,
    };
    it.unit.to_bytes(&kept.state, mode)
}
