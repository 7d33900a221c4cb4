//! Features that the units do not offer: model exchange, scheduled execution, clocks, binaries, texts, derivatives, and variables
//! of types that no register has. The standard still requires these functions; they return an error.

use super::border::{
    ClockUpdate, DependencyKind, Instance, IntervalQualifier, LockPreemption, LogMessage, Refused, Status,
    exported, with,
};
use super::instance::Log;
use core::ffi::{c_char, c_void};

fn refuse(instance: Instance, what: &str) -> Status {
    with(instance, |_| {
        Err(Refused(format!("this unit has no {what}; it is one for co-simulation, see docs/guide/fmi.md")))
    })
}

/// Refuses to make an instance of another kind than co-simulation.
fn refuse_kind(environment: *mut c_void, log: LogMessage, kind: &str) -> Instance {
    let text = format!(
        "this unit offers co-simulation, not {kind}; call fmi3InstantiateCoSimulation, see docs/guide/fmi.md"
    );
    Log::new(environment, log).error(Status::Error, &text);
    core::ptr::null_mut()
}

exported! {
    fn fmi3InstantiateModelExchange(_name: *const c_char, _token: *const c_char, _resources: *const c_char, _visible: bool, _logging_on: bool, environment: *mut c_void, log: LogMessage) -> Instance {
        refuse_kind(environment, log, "model exchange")
    }

    fn fmi3InstantiateScheduledExecution(_name: *const c_char, _token: *const c_char, _resources: *const c_char, _visible: bool, _logging_on: bool, environment: *mut c_void, log: LogMessage, _clock_update: ClockUpdate, _lock_preemption: LockPreemption, _unlock_preemption: LockPreemption) -> Instance {
        refuse_kind(environment, log, "scheduled execution")
    }

    fn fmi3EnterEventMode(instance: Instance) -> Status {
        refuse(instance, "events")
    }

    fn fmi3GetFloat32(instance: Instance, _references: *const u32, _count: usize, _values: *mut f32, _value_count: usize) -> Status {
        refuse(instance, "variables of this type")
    }

    fn fmi3GetInt64(instance: Instance, _references: *const u32, _count: usize, _values: *mut i64, _value_count: usize) -> Status {
        refuse(instance, "variables of 64 bits")
    }

    fn fmi3GetUInt64(instance: Instance, _references: *const u32, _count: usize, _values: *mut u64, _value_count: usize) -> Status {
        refuse(instance, "variables of 64 bits")
    }

    fn fmi3GetString(instance: Instance, _references: *const u32, _count: usize, _values: *mut *const c_char, _value_count: usize) -> Status {
        refuse(instance, "texts")
    }

    fn fmi3GetBinary(instance: Instance, _references: *const u32, _count: usize, _value_sizes: *mut usize, _values: *mut *const u8, _value_count: usize) -> Status {
        refuse(instance, "binary variables")
    }

    fn fmi3GetClock(instance: Instance, _references: *const u32, _count: usize, _values: *mut bool) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3SetFloat32(instance: Instance, _references: *const u32, _count: usize, _values: *const f32, _value_count: usize) -> Status {
        refuse(instance, "variables of this type")
    }

    fn fmi3SetInt64(instance: Instance, _references: *const u32, _count: usize, _values: *const i64, _value_count: usize) -> Status {
        refuse(instance, "variables of 64 bits")
    }

    fn fmi3SetUInt64(instance: Instance, _references: *const u32, _count: usize, _values: *const u64, _value_count: usize) -> Status {
        refuse(instance, "variables of 64 bits")
    }

    fn fmi3SetString(instance: Instance, _references: *const u32, _count: usize, _values: *const *const c_char, _value_count: usize) -> Status {
        refuse(instance, "texts")
    }

    fn fmi3SetBinary(instance: Instance, _references: *const u32, _count: usize, _value_sizes: *const usize, _values: *const *const u8, _value_count: usize) -> Status {
        refuse(instance, "binary variables")
    }

    fn fmi3SetClock(instance: Instance, _references: *const u32, _count: usize, _values: *const bool) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3GetNumberOfVariableDependencies(instance: Instance, _value_reference: u32, _n_dependencies: *mut usize) -> Status {
        refuse(instance, "known dependencies")
    }

    fn fmi3GetVariableDependencies(instance: Instance, _dependent: u32, _element_indices_of_dependent: *mut usize, _independents: *mut u32, _element_indices_of_independents: *mut usize, _dependency_kinds: *mut DependencyKind, _n_dependencies: usize) -> Status {
        refuse(instance, "known dependencies")
    }

    fn fmi3GetDirectionalDerivative(instance: Instance, _unknowns: *const u32, _n_unknowns: usize, _knowns: *const u32, _n_knowns: usize, _seed: *const f64, _n_seed: usize, _sensitivity: *mut f64, _n_sensitivity: usize) -> Status {
        refuse(instance, "derivatives")
    }

    fn fmi3GetAdjointDerivative(instance: Instance, _unknowns: *const u32, _n_unknowns: usize, _knowns: *const u32, _n_knowns: usize, _seed: *const f64, _n_seed: usize, _sensitivity: *mut f64, _n_sensitivity: usize) -> Status {
        refuse(instance, "derivatives")
    }

    fn fmi3EnterConfigurationMode(instance: Instance) -> Status {
        refuse(instance, "structural parameters")
    }

    fn fmi3ExitConfigurationMode(instance: Instance) -> Status {
        refuse(instance, "structural parameters")
    }

    fn fmi3GetIntervalDecimal(instance: Instance, _references: *const u32, _count: usize, _intervals: *mut f64, _qualifiers: *mut IntervalQualifier) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3GetIntervalFraction(instance: Instance, _references: *const u32, _count: usize, _counters: *mut u64, _resolutions: *mut u64, _qualifiers: *mut IntervalQualifier) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3GetShiftDecimal(instance: Instance, _references: *const u32, _count: usize, _shifts: *mut f64) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3GetShiftFraction(instance: Instance, _references: *const u32, _count: usize, _counters: *mut u64, _resolutions: *mut u64) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3SetIntervalDecimal(instance: Instance, _references: *const u32, _count: usize, _intervals: *const f64) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3SetIntervalFraction(instance: Instance, _references: *const u32, _count: usize, _counters: *const u64, _resolutions: *const u64) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3SetShiftDecimal(instance: Instance, _references: *const u32, _count: usize, _shifts: *const f64) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3SetShiftFraction(instance: Instance, _references: *const u32, _count: usize, _counters: *const u64, _resolutions: *const u64) -> Status {
        refuse(instance, "clocks")
    }

    fn fmi3EvaluateDiscreteStates(instance: Instance) -> Status {
        refuse(instance, "events")
    }

    fn fmi3UpdateDiscreteStates(instance: Instance, _discrete_states_need_update: *mut bool, _terminate_simulation: *mut bool, _nominals_of_continuous_states_changed: *mut bool, _values_of_continuous_states_changed: *mut bool, _next_event_time_defined: *mut bool, _next_event_time: *mut f64) -> Status {
        refuse(instance, "events")
    }

    fn fmi3EnterContinuousTimeMode(instance: Instance) -> Status {
        refuse(instance, "continuous states")
    }

    fn fmi3CompletedIntegratorStep(instance: Instance, _no_set_f_m_u_state_prior_to_current_point: bool, _enter_event_mode: *mut bool, _terminate_simulation: *mut bool) -> Status {
        refuse(instance, "continuous states")
    }

    fn fmi3SetTime(instance: Instance, _time: f64) -> Status {
        refuse(instance, "continuous states")
    }

    fn fmi3SetContinuousStates(instance: Instance, _continuous_states: *const f64, _n_continuous_states: usize) -> Status {
        refuse(instance, "continuous states")
    }

    fn fmi3GetContinuousStateDerivatives(instance: Instance, _derivatives: *mut f64, _n_continuous_states: usize) -> Status {
        refuse(instance, "derivatives")
    }

    fn fmi3GetEventIndicators(instance: Instance, _event_indicators: *mut f64, _n_event_indicators: usize) -> Status {
        refuse(instance, "event indicators")
    }

    fn fmi3GetContinuousStates(instance: Instance, _continuous_states: *mut f64, _n_continuous_states: usize) -> Status {
        refuse(instance, "continuous states")
    }

    fn fmi3GetNominalsOfContinuousStates(instance: Instance, _nominals: *mut f64, _n_continuous_states: usize) -> Status {
        refuse(instance, "continuous states")
    }

    fn fmi3GetNumberOfEventIndicators(instance: Instance, _n_event_indicators: *mut usize) -> Status {
        refuse(instance, "event indicators")
    }

    fn fmi3GetNumberOfContinuousStates(instance: Instance, _n_continuous_states: *mut usize) -> Status {
        refuse(instance, "continuous states")
    }

    fn fmi3GetOutputDerivatives(instance: Instance, _references: *const u32, _count: usize, _orders: *const i32, _values: *mut f64, _value_count: usize) -> Status {
        refuse(instance, "derivatives")
    }

    fn fmi3ActivateModelPartition(instance: Instance, _clock_reference: u32, _activation_time: f64) -> Status {
        refuse(instance, "scheduled execution")
    }
}
