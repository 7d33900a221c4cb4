//! Why a plant cannot be coupled with other simulators, or no longer is.

use crate::fmi::VariablesError;
use core::time::Duration;

/// See there.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CouplingError {
    /// The file cannot be read, or says what cannot be.
    #[error("{file}: {what}")]
    File {
        /// The file.
        file: String,
        /// What is wrong.
        what: String,
    },
    /// The plant has no such value.
    #[error("the exchange names '{name}': {why}")]
    Unknown {
        /// As given.
        name: String,
        /// Why.
        why: VariablesError,
    },
    /// It cannot be exchanged so.
    #[error("the exchange names '{name}': {why}")]
    Unfit {
        /// As given.
        name: String,
        /// Why, and what would be right.
        why: String,
    },
    /// The way to the others is broken, or never was one.
    #[error("{0}")]
    Broken(String),
    /// They let no time pass.
    #[error(
        "the other simulators have not come to {} in {} s: one of them has not been started, has died or waits for something, \
         the broker is not there, or it waits for more federates", crate::time::short(*.at_us), .limit.as_secs_f64()
    )]
    Silent {
        /// Emulated time of the exchange, in microseconds.
        at_us: u64,
        /// How long they were waited for.
        limit: Duration,
    },
}
