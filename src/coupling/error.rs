//! Reasons why a plant cannot be coupled with other simulators, or why a coupling ends.

use crate::fmi::VariablesError;
use core::time::Duration;

/// An error of the coupling with other simulators.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CouplingError {
    /// The file cannot be read or has an invalid value.
    #[error("{file}: {what}")]
    File {
        /// Path of the file with the exchanges.
        file: String,
        /// The error in the file.
        what: String,
    },
    /// The plant has no value with the name in the file.
    #[error("the exchange names '{name}': {why}")]
    Unknown {
        /// Name of a value, as the file with the exchanges gives it.
        name: String,
        /// Reason why the name has no value in the plant.
        why: VariablesError,
    },
    /// The value cannot be exchanged in this way.
    #[error("the exchange names '{name}': {why}")]
    Unfit {
        /// Name of a value, as the file with the exchanges gives it.
        name: String,
        /// Reason of the refusal, and a correct use.
        why: String,
    },
    /// The connection to the other simulators failed or was never made.
    #[error("{0}")]
    Broken(String),
    /// The other simulators did not reach the exchange in time.
    #[error(
        "the other simulators have not reached {} in {} s: one of them has not been started, has died or waits, \
            has longer steps without TIME_PERIOD, the broker does not run, or it waits for more federates", crate::time::short(*.at_us), .limit.as_secs_f64()
    )]
    Silent {
        /// Emulated time of the exchange, in microseconds.
        at_us: u64,
        /// Real time that the emulator waited.
        limit: Duration,
    },
}
