//! The interval of a bus that repeats, with its slots. Views show it.

use serde::{Deserialize, Serialize};

/// An interval that repeats on a bus.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interval {
    /// Time between two SYNC edges, in us.
    pub us: u32,
    /// Slots of the interval, in the order of their times.
    pub slots: Vec<Slot>,
}

/// The part of an interval for one frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Slot {
    /// Name of the frame.
    pub name: String,
    /// Latest start of the frame, in us after the SYNC edge.
    pub start_us: u32,
}

impl Slot {
    /// Creates a slot that begins `start_us` after the SYNC edge.
    #[must_use]
    pub fn new(name: &str, start_us: u32) -> Self {
        Self { name: name.to_owned(), start_us }
    }
}
