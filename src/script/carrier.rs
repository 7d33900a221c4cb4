//! Transport of the verbs' operations to a plant and of its replies.

use super::ScenarioError;
use crate::identity::DeviceIndex;
use crate::memory::Segment;
use crate::request::{Op, Reply};

/// The connection to the plant of a scenario. It moves with its bench from thread to thread.
pub(super) trait Carrier: Send {
    /// Executes an operation and returns its reply.
    ///
    /// # Errors
    /// The operation was refused, or the plant has gone.
    fn ask(&mut self, op: Op) -> Result<Reply, ScenarioError>;

    /// The RAM of a PLC, as a program on that PLC has it.
    ///
    /// # Errors
    /// There is no such PLC, or its RAM cannot be mapped.
    fn segment(&mut self, plc: DeviceIndex) -> Result<Segment, ScenarioError>;

    /// Hash over all journal records since power-on; `None` if the plant belongs to another process.
    fn journal_hash(&self) -> Option<u64> {
        None
    }
}
