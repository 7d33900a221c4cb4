//! Errors that end a scenario early.

use super::Failure;
use super::failure::FailureKind;
use crate::fault::{FaultError, WordError};
use crate::layout::LayoutError;
use crate::layout::place::BadValue;
use crate::memory::MemoryError;
use crate::memory::header::BoardAssignmentError;
use crate::plant::PlantError;
use crate::request::{Refused, WrongReply};
use crate::time::{TimeError, long, seconds};
use core::fmt;
use thiserror::Error;

/// An error that ends a scenario early.
#[derive(Error)]
pub enum ScenarioError {
    /// An expectation is not met.
    #[error("{0}")]
    Failed(Box<Failure>),
    /// The scenario would take more emulated time than it may.
    #[error("{} of emulated time at {} would go beyond the {} that a scenario may take; does it end at all?", long(*.us), seconds(*.now_us), long(*.limit_us))]
    TooLong {
        /// Emulated time that the scenario requests, in microseconds.
        us: u64,
        /// Emulated time at the request, in microseconds.
        now_us: u64,
        /// Longest emulated time of a scenario, in microseconds.
        limit_us: u64,
    },
    /// The caller of the scenario has ended the verb: [`Bench::set_interrupt`](super::Bench::set_interrupt).
    #[error("interrupted")]
    Interrupted,
    /// A register or address that does not exist.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// A value that the register cannot hold.
    #[error(transparent)]
    Value(#[from] BadValue),
    /// The text is not a time.
    #[error("`{text}`: {source}")]
    Time {
        /// Text that should be a time.
        text: String,
        /// The error in the text.
        source: TimeError,
    },
    /// An argument has the wrong notation.
    #[error("`{text}`: {right}")]
    Argument {
        /// Argument of the scenario with the wrong notation.
        text: String,
        /// Description or example of the right notation.
        right: String,
    },
    /// A register is named without its PLC, and several PLCs have such a register.
    #[error("`{text}`: the plant has several PLCs ({plcs}); write for example {example}:{text}")]
    WhichPlc {
        /// Name of the register, as the scenario gives it.
        text: String,
        /// Names of all PLCs of the plant, separated by commas.
        plcs: String,
        /// An example of a PLC.
        example: String,
    },
    /// The plant does not have this PLC, bus, area or drive.
    #[error("there is no {what} '{name}'; there are: {known}")]
    Unknown {
        /// "PLC", "bus", "area" or "drive".
        what: &'static str,
        /// Name that the scenario gives.
        name: String,
        /// Names that exist in the plant, separated by commas.
        known: String,
    },
    /// The text is not a setting of a board.
    #[error(transparent)]
    Board(#[from] BoardAssignmentError),
    /// A field of a fault cannot be read.
    #[error(transparent)]
    FaultWord(#[from] WordError),
    /// The plant cannot have this fault.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// The plant is refused.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The RAM cannot be used.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The plant refused the operation.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The plant sent a reply to another operation.
    #[error(transparent)]
    WrongReply(#[from] WrongReply),
    /// A request to the instance through the channel has failed.
    #[cfg(feature = "channel")]
    #[error(transparent)]
    Client(#[from] crate::channel::ClientError),
}

impl fmt::Debug for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl From<Failure> for ScenarioError {
    fn from(failure: Failure) -> Self {
        Self::Failed(Box::new(failure))
    }
}

impl ScenarioError {
    /// Error about an argument with wrong notation.
    pub(super) fn argument(text: &str, right: &str) -> Self {
        Self::Argument { text: text.to_owned(), right: right.to_owned() }
    }

    /// True if the plant did not behave as the scenario expects. False if the scenario itself is wrong.
    pub fn is_failure(&self) -> bool {
        self.failure_kind().is_some()
    }

    /// Returns the kind of failure; `None` if the scenario itself is wrong.
    pub(super) fn failure_kind(&self) -> Option<FailureKind> {
        match self {
            Self::Failed(failure) => Some(failure.kind),
            Self::TooLong { .. } => Some(FailureKind::Endless),
            Self::Refused(refused) => (!refused.code.is_wrong_use()).then_some(FailureKind::Refused),
            Self::WrongReply(_) => Some(FailureKind::Refused),
            #[cfg(feature = "channel")]
            Self::Client(_) => Some(FailureKind::Refused),
            _ => None,
        }
    }
}
