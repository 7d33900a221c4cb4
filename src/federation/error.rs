//! Reasons why a federate ends.

use core::time::Duration;

/// Error that ends a federate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FederationError {
    /// The connection to the other federates failed or was never made.
    #[error("{0}")]
    Exchange(String),
    /// The emulator was not started as a federate.
    #[error(
        "the emulator does not share its plant: set Options::is_federate, so that all hosts handle requests to \
            boards identically"
    )]
    Unprepared,
    /// No messages arrive from another federate.
    #[error(
        "federate {federate} has sent nothing for {} s: it has not been started or has died, its host is down, or \
            there is no connection to it (does a broker run?)",
        .limit.as_secs_f64()
    )]
    Silent {
        /// Number of the silent federate, or the numbers of all missing federates.
        federate: String,
        /// Real time for which the reporting federate waited.
        limit: Duration,
    },
    /// Another federate reported that it failed.
    #[error("federate {federate} has failed: {reason}")]
    Failed {
        /// Number of the federate that has failed.
        federate: u8,
        /// Reason that the failed federate reported.
        reason: String,
    },
    /// Another federate has another version of commram.
    #[error("federate {federate} is commram {theirs}, this is commram {}; use the same program on all \
        hosts", env!("CARGO_PKG_VERSION"))]
    OtherVersion {
        /// Number of the federate that has another version.
        federate: u8,
        /// Version of commram that the other federate uses.
        theirs: String,
    },
    /// Another federate was started with another number of federates.
    #[error(
        "federate {federate} was started for {theirs} federates, this one for {ours}; use the same number everywhere"
    )]
    OtherCount {
        /// Number of the federate that was started for another number of federates.
        federate: u8,
        /// Number of federates according to that federate.
        theirs: u8,
        /// Number of federates according to this federate.
        ours: u8,
    },
    /// Another federate has another plant.
    #[error("federate {federate} has another plant: {why}; start all of them with the same plant file")]
    OtherPlant {
        /// Number of the federate that has another plant.
        federate: u8,
        /// Difference between the two plants.
        why: String,
    },
    /// All federates only follow, so no federate advances the clock.
    #[error("all federates follow (--follow), so none advances the clock; start one of them without it")]
    NobodyLeads,
    /// Input has entered the plant on this host but not on another host.
    #[error(
        "at {at_us} us federate {federate} has another journal than this one: a program has stored into an image \
            while the clock advanced or in the turn of another federate, or has set a switch without the \
            channel; let it take part in lockstep"
    )]
    Apart {
        /// Number of the federate that has another journal.
        federate: u8,
        /// Emulated time at which the difference was found.
        at_us: u64,
    },
    /// The coupling with other simulators failed.
    #[error(transparent)]
    Coupling(#[from] crate::coupling::CouplingError),
    /// A message is malformed, or is not the message that had to come next.
    #[error("federate {federate} has sent an unexpected message; does another program use this federation?")]
    Nonsense {
        /// Number of the federate that has sent the message.
        federate: u8,
    },
}
