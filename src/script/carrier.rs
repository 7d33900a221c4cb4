//! How the verbs' operations come to a plant and its replies back.

use super::ScenarioError;
use crate::memory::Segment;
use crate::request::{Op, Reply};

/// A way to a plant that scenarios run on. It goes with its bench from thread to thread.
pub(super) trait Carrier: Send {
    /// Brings an operation there and its reply back.
    ///
    /// # Errors
    /// It was refused, or the plant has gone.
    fn ask(&mut self, op: Op) -> Result<Reply, ScenarioError>;

    /// The RAM of a PLC, as a program on that PLC has it.
    ///
    /// # Errors
    /// There is no such PLC, or its RAM cannot be mapped.
    fn segment(&mut self, plc: u16) -> Result<Segment, ScenarioError>;

    /// Hash over all journal records since power-on; `None` if the plant belongs to another process.
    fn journal_hash(&self) -> Option<u64> {
        None
    }
}
