//! Transports the operations that the verbs of a scenario (`poke`, `wait` ...) request to a plant, and the replies of
//! the plant back.

use super::ScenarioError;
use crate::identity::DeviceIndex;
use crate::memory::Segment;
use crate::request::{Op, Reply};

/// The connection to the plant of a scenario. It is `Send`, because its bench may move to another thread.
pub(super) trait Carrier: Send {
    /// Executes an operation and returns its reply.
    ///
    /// # Errors
    /// The operation was refused, or the instance has ended.
    fn ask(&mut self, op: Op) -> Result<Reply, ScenarioError>;

    /// Returns the RAM of a PLC, for accesses like those of a program on this PLC.
    ///
    /// # Errors
    /// There is no such PLC, or its RAM cannot be mapped.
    fn segment(&mut self, plc: DeviceIndex) -> Result<Segment, ScenarioError>;

    /// False if the emulator of a running instance has ended, or another one has replaced it.
    #[cfg(feature = "cli")]
    fn is_there(&self) -> bool {
        true
    }

    /// Hash over all journal records since power-on; `None` if the plant belongs to another process.
    fn journal_hash(&self) -> Option<u64> {
        None
    }
}
