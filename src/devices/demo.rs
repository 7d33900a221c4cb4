//! What `commram demo` needs to know of a device: a plant, and a soft-PLC that runs on it.

use crate::layout::LayoutError;
use crate::memory::{Attached, MemoryError};
use std::io;

/// A demonstration of a device.
#[derive(Debug)]
pub struct Demo {
    /// The plant file; `None`: the built-in plant.
    pub plant: Option<&'static str>,
    /// Name of the registers that are shown at the end.
    pub area: &'static str,
    /// The same for a headline.
    pub title: &'static str,
    /// The soft-PLC, a process of its own that has nothing but the image of its PLC.
    pub program: DemoProgram,
}

/// A soft-PLC that tells what it does.
pub type DemoProgram = fn(Attached, Show<'_>) -> Result<(), DemoError>;

/// Shows a text at once.
pub type Show<'a> = &'a dyn Fn(&str) -> io::Result<()>;

/// Why a demonstration fails.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// The emulator has gone, or its memory cannot be used.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A register that is none.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Nothing can be shown.
    #[error("cannot write: {0}")]
    Output(#[from] io::Error),
    /// The soft-PLC waits in vain.
    #[error("{what}: {place} did not become {wanted} within {seconds} s, it holds {found}")]
    Stuck {
        /// What the wait was for.
        what: String,
        /// Name and address of the register.
        place: String,
        /// What was awaited.
        wanted: String,
        /// What it holds, with the meaning.
        found: String,
        /// How long, in real time.
        seconds: u64,
    },
    /// A reference value did not come back.
    #[error("{0}")]
    NotFollowed(String),
}
