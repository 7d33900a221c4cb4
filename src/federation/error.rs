//! Why a federate ends.

use core::time::Duration;

/// Why a federate cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FederationError {
    /// The way to the others is broken, or never was one.
    #[error("{0}")]
    Exchange(String),
    /// It was not started as an emulator that shares its plant.
    #[error(
        "the emulator was started with a plant of its own: set Options::is_federate, so that boards are asked on all hosts alike"
    )]
    Unprepared,
    /// Another one is not heard any more.
    #[error(
        "federate {who} has not been heard of for {} s: it has not been started or has died, its host is gone, or nobody \
         brings messages there (does a broker run?)",
        .limit.as_secs_f64()
    )]
    Silent {
        /// Who was to be heard.
        who: String,
        /// How long it was waited for.
        limit: Duration,
    },
    /// Another one has failed, and said so.
    #[error("federate {who} has failed: {reason}")]
    Failed {
        /// Which one.
        who: u8,
        /// Why.
        reason: String,
    },
    /// Another one is of another version.
    #[error("federate {who} is commram {theirs}, this is commram {}; take the same program everywhere", env!("CARGO_PKG_VERSION"))]
    OtherVersion {
        /// Which one.
        who: u8,
        /// Its version.
        theirs: String,
    },
    /// Another one counts otherwise.
    #[error(
        "federate {who} says that there are {theirs} federates, here there are {ours}; say the same everywhere"
    )]
    OtherCount {
        /// Which one.
        who: u8,
        /// How many it says there are.
        theirs: u8,
        /// How many there are here.
        ours: u8,
    },
    /// Another one has another plant.
    #[error("federate {who} has another plant: {why}; start all of them with the same plant file")]
    OtherPlant {
        /// Which one.
        who: u8,
        /// What is otherwise.
        why: String,
    },
    /// All of them only follow.
    #[error("all federates follow (--follow), so nobody lets time pass; leave it out at one of them")]
    NobodyLeads,
    /// Something has happened here that has not happened there.
    #[error(
        "at {at_us} us federate {who} has another journal than this one: a program has stored into an image while time \
         passed or somebody else had his turn, or has set a switch without the channel; let it take part in lockstep"
    )]
    Apart {
        /// Which one.
        who: u8,
        /// Emulated time at which it was noticed.
        at_us: u64,
    },
    /// Other simulators take part, and that has gone wrong.
    #[error(transparent)]
    Coupling(#[from] crate::coupling::CouplingError),
    /// A message that is none, or comes when another was due.
    #[error("federate {who} has sent what no federate sends now; is something else on the way there?")]
    Nonsense {
        /// Whose turn it was.
        who: u8,
    },
}
