//! Why an emulator cannot run.

use super::clock::Clock;
use super::novram::NovramError;
use crate::door::DoorError;
use crate::memory::{MemoryError, limits};
use crate::plant::{PlantError, SnapshotError};
use std::path::PathBuf;
use thiserror::Error;

/// Why an emulator cannot run.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// Image file trouble.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The plant is refused.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A NOVRAM file cannot be used.
    #[error(transparent)]
    Novram(#[from] NovramError),
    /// The snapshot to start from is refused.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// It cannot share its plant with others, or no longer.
    #[cfg(feature = "channel")]
    #[error(transparent)]
    Federation(#[from] crate::federation::FederationError),
    /// A door does not open.
    #[error(transparent)]
    Door(#[from] DoorError),
    /// Somebody has shortened an image while it was in use.
    #[error("{}: another program has shortened it while it was in use, so the registers are lost; nothing of them was \
             written to NOVRAM, start again", .path.display())]
    Shortened {
        /// The image.
        path: PathBuf,
    },
    /// No thread can be started.
    #[error("cannot start a thread: {reason}{}", limits::named(.reason))]
    Thread {
        /// Why not.
        reason: std::io::Error,
    },
    /// More PLCs than this process may have files for.
    #[error(
        "an emulator with {plcs} PLC{} has {needed} open files, and this process may have {most}: raise that limit \
         (`ulimit -Hn {needed}` as root)", if *.plcs == 1 { "" } else { "s" }
    )]
    OpenFiles {
        /// How many PLCs.
        plcs: usize,
        /// Files that they need.
        needed: u64,
        /// Files that there may be.
        most: u64,
    },
    /// A speed factor out of range.
    #[error("speed {speed}: must be {} to {}", Clock::SLOWEST, Clock::FASTEST)]
    Speed {
        /// The factor.
        speed: f64,
    },
}
