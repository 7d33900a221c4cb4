//! The shared object in commram's units for co-simulation: the functions of FMI 3.0, on top of [`commram::fmi::Unit`].
//!
//! It serves any plant; the files in the archive's `resources` define it. Nothing is shared between instances, so there can be several in a
//! process, each used by one thread at a time. No panic crosses the border: the caller gets `fmi3Fatal`.

#![allow(non_snake_case, reason = "FMI defines the names")]
#![allow(clippy::missing_safety_doc, reason = "what callers owe is in the standard")]

pub mod absent;
mod border;
mod instance;
pub mod life;
pub mod state;
pub mod values;

pub use border::{
    ClockUpdate, DependencyKind, Instance, IntermediateUpdate, IntervalQualifier, LockPreemption, LogMessage,
    Signature, Status,
};

/// Returns all functions: name, types of the arguments, return type.
#[must_use]
pub fn signatures() -> Vec<Signature> {
    [life::SIGNATURES, values::SIGNATURES, state::SIGNATURES, absent::SIGNATURES].concat()
}
