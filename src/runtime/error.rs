//! Errors that prevent or end an emulator.

use super::clock::Clock;
use super::novram::NovramError;
use crate::door::DoorError;
use crate::memory::{MemoryError, limits};
use crate::plant::{PlantError, SnapshotError};
use std::path::PathBuf;
use thiserror::Error;

/// Error that prevents or ends an emulator.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// An image file cannot be used.
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
    /// The emulator cannot, or can no longer, share its plant with emulators on other hosts.
    #[cfg(feature = "channel")]
    #[error(transparent)]
    Federation(#[from] crate::federation::FederationError),
    /// A door cannot be opened.
    #[error(transparent)]
    Door(#[from] DoorError),
    /// Another process has shortened an image in use.
    #[error("{}: another program has shortened it while it was in use, so the registers are lost; none of them \
        was written to NOVRAM, start again", .path.display())]
    Shortened {
        /// Path of the image that was shortened.
        path: PathBuf,
    },
    /// No thread can be started.
    #[error("cannot start a thread: {reason}{}", limits::named(.reason))]
    Thread {
        /// Error of the operating system.
        reason: std::io::Error,
    },
    /// The file mode creation mask takes permissions of the owner from new files.
    #[error(
        "the file mode creation mask is {mask:03o}, so this user could not use the files of the emulator: set another one, \
         for example `umask 077`"
    )]
    Umask {
        /// The mask of the process.
        mask: u32,
    },
    /// The process may not open enough files for its PLCs.
    #[error(
        "an emulator with {plcs} PLC{} has {needed} open files, and this process may have {most}: raise that limit \
         (`ulimit -Hn {needed}` as root)", if *.plcs == 1 { "" } else { "s" }
    )]
    OpenFiles {
        /// Number of PLCs in the plant.
        plcs: usize,
        /// Number of open files that the emulator needs.
        needed: u64,
        /// Number of open files that the process may have.
        most: u64,
    },
    /// The process may not have enough memory for its PLCs.
    #[error(
        "an emulator with {plcs} PLC{} can have {} KiB of {what}, and this process may have {}: raise that limit \
         (`ulimit {option}`)", if *.plcs == 1 { "" } else { "s" }, .needed.div_ceil(1024), .most / 1024
    )]
    MemoryLimit {
        /// Number of PLCs in the plant.
        plcs: usize,
        /// Name of the limited memory, for example `data`.
        what: &'static str,
        /// Option of `ulimit`, for example `-d`.
        option: &'static str,
        /// Number of bytes that the emulator may need over time.
        needed: u64,
        /// Number of bytes that the process may have.
        most: u64,
    },
    /// A speed factor out of range.
    #[error("speed {speed}: must be {} to {}", Clock::SLOWEST, Clock::FASTEST)]
    Speed {
        /// Speed factor outside the range.
        speed: f64,
    },
}
