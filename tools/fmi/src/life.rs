//! Functions that make, initialize, step and end an instance.

use super::border::{Instance, IntermediateUpdate, LogMessage, Refused, Status, exported, give, read, with};
use super::instance::{Inner, Mode};
use core::ffi::{c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

exported! {
    fn fmi3GetVersion() -> *const c_char {
        c"3.0".as_ptr()
    }

    fn fmi3SetDebugLogging(
        instance: Instance,
        is_on: bool,
        count: usize,
        categories: *const *const c_char,
    ) -> Status {
        with(instance, |it| {
            // SAFETY: the caller passes `count` categories.
            it.listen(is_on, unsafe { read(categories, count) }?)
        })
    }

    fn fmi3InstantiateCoSimulation(
        _name: *const c_char,
        token: *const c_char,
        resources: *const c_char,
        _is_visible: bool,
        is_logging: bool,
        _event_mode: bool,
        _early_return: bool,
        _intermediate: *const u32,
        intermediate_count: usize,
        environment: *mut c_void,
        log: LogMessage,
        _update: IntermediateUpdate,
    ) -> Instance {
        let made = Inner::make(token, resources, is_logging, environment, log);
        let Some(made) = made else { return core::ptr::null_mut() };
        if intermediate_count > 0 {
            made.log(Status::Error, "nothing can be seen within a step; leave the required intermediate variables out");
            return core::ptr::null_mut();
        }
        Box::into_raw(made).cast()
    }

    fn fmi3FreeInstance(instance: Instance) -> () {
        if !instance.is_null() {
            let free = || {
                // SAFETY: the instance is from `fmi3InstantiateCoSimulation`, and the caller does not use it any more.
                drop(unsafe { Box::from_raw(instance.cast::<Inner>()) });
            };
            // A panic cannot be reported, because the instance no longer exists.
            let _ = catch_unwind(AssertUnwindSafe(free));
        }
    }

    fn fmi3EnterInitializationMode(
        instance: Instance,
        _has_tolerance: bool,
        _tolerance: f64,
        start: f64,
        has_stop: bool,
        stop: f64,
    ) -> Status {
        with(instance, |it| {
            it.is_in(&[Mode::Instantiated], "fmi3EnterInitializationMode")?;
            it.unit.begin(start, has_stop.then_some(stop))?;
            it.mode = Mode::Initializing;
            Ok(())
        })
    }

    fn fmi3ExitInitializationMode(instance: Instance) -> Status {
        with(instance, |it| it.change_mode(&[Mode::Initializing], Mode::Stepping, "fmi3ExitInitializationMode"))
    }

    fn fmi3EnterStepMode(instance: Instance) -> Status {
        with(instance, |it| it.is_in(&[Mode::Stepping], "fmi3EnterStepMode"))
    }

    fn fmi3DoStep(
        instance: Instance,
        point: f64,
        size: f64,
        _is_final: bool,
        needs_events: *mut bool,
        terminates: *mut bool,
        returns_early: *mut bool,
        reached: *mut f64,
    ) -> Status {
        with(instance, |it| {
            it.is_in(&[Mode::Stepping], "fmi3DoStep")?;
            let done = it.unit.step(point, size);
            // SAFETY: for each value the caller passes a place or null.
            unsafe {
                give(needs_events, false);
                give(terminates, false);
                give(returns_early, false);
                give(reached, if done.is_ok() { point + size } else { it.unit.time_s() });
            }
            it.report_findings();
            done.map(drop).map_err(Refused::from)
        })
    }

    fn fmi3Terminate(instance: Instance) -> Status {
        with(instance, |it| it.change_mode(&[Mode::Initializing, Mode::Stepping], Mode::Ended, "fmi3Terminate"))
    }

    fn fmi3Reset(instance: Instance) -> Status {
        with(instance, Inner::reset)
    }
}
