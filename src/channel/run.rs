//! A request of the channel: executes its operations in order, and collects the replies.

use super::wire::{ReplyBuffer, WireOp};
use crate::identity::DeviceIndex;
use crate::journal::Keep;
use crate::request::{Code, Execution, Host, MAX_OPS, Op, Refused};

/// State of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Progress {
    /// The emulator has replied to all operations, or one of them failed.
    Done,
    /// A wait is not over, or an operation pauses; call again after the next firmware step.
    Waiting,
}

/// A request in progress.
#[derive(Debug, Default)]
pub(crate) struct Run {
    /// Index of the next operation.
    next: usize,
    /// State of the operation in progress.
    execution: Execution,
    /// Replies of the operations that have already ended.
    pub replies: ReplyBuffer,
}

impl Run {
    /// Prepares for a request of the client with this number; keeps the memory of the reply buffer.
    pub(crate) fn reset(&mut self, client: u128) {
        self.next = 0;
        self.execution = Execution::of_client(client);
        self.replies.clear();
    }

    /// Sets the process id of the client. If the request ends the emulator, the reason for the end names this
    /// process.
    pub(crate) fn set_process(&mut self, process: Option<u32>) {
        self.execution.set_process(process);
    }

    /// Executes `ops`, beginning with the operation at which the last call stopped. Each operation is read
    /// only once, so changes by a hostile client have no effect. An operation that would take long without a pause ends
    /// if `is_awaited` returns false: the client no longer waits for the reply.
    pub(crate) fn go(
        &mut self,
        host: &mut dyn Host,
        ops: &[WireOp],
        is_awaited: &mut dyn FnMut() -> bool,
    ) -> Progress {
        if ops.len() > MAX_OPS {
            let count = ops.len();
            let text = format_args!("{count} operations in one request are too many, at most {MAX_OPS}");
            self.replies.error(&Refused::new(Code::TOO_MANY_OPERATIONS, text));
            return Progress::Done;
        }
        if self.next == 0 && !self.execution.is_under_way() {
            host.begin_request();
        }
        self.resume(host, ops, is_awaited)
    }

    /// Executes operations that only read, while another request is in progress. Does not call [`Host::begin_request`].
    pub(crate) fn look(&mut self, host: &mut dyn Host, ops: &[WireOp]) -> Progress {
        self.resume(host, ops, &mut || true)
    }

    fn resume(
        &mut self,
        host: &mut dyn Host,
        ops: &[WireOp],
        is_awaited: &mut dyn FnMut() -> bool,
    ) -> Progress {
        while let Some(wire) = ops.get(self.next) {
            match self.execute(host, *wire, is_awaited) {
                Ok(Progress::Done) => self.next += 1,
                Ok(Progress::Waiting) => return Progress::Waiting,
                Err(refused) => {
                    self.replies.error(&refused);
                    return Progress::Done;
                }
            }
        }
        Progress::Done
    }

    /// Ends a waiting request with an error, because the emulator ends.
    pub(crate) fn abort(&mut self, ending: &Refused) {
        self.replies.error(ending);
    }

    /// True if an operation requests the emulator to end.
    pub(crate) fn asks_to_end(ops: &[WireOp]) -> bool {
        Self::contains(ops, Op::Stop)
    }

    /// True if an operation keeps a snapshot.
    pub(crate) fn asks_to_save(ops: &[WireOp]) -> bool {
        Self::contains(ops, Op::Save)
    }

    /// True if an operation follows registers.
    pub(crate) fn asks_to_follow(ops: &[WireOp]) -> bool {
        let plc = DeviceIndex::at(0);
        Self::contains(ops, Op::Follow { plc, offset: 0, len: 0, keep: Keep::ForOnlookers })
    }

    /// True if an operation reads the journal or changes of registers.
    pub(crate) fn asks_to_read(ops: &[WireOp]) -> bool {
        Self::contains(ops, Op::Journal { from: 0, max: 0 })
            || Self::contains(ops, Op::Changes { from: 0, max: 0 })
    }

    fn contains(ops: &[WireOp], op: Op) -> bool {
        let kind = WireOp::from(&op).kind;
        ops.iter().any(|op| op.kind == kind)
    }

    /// True if all operations only read the plant.
    pub(crate) fn only_looks(ops: &[WireOp]) -> bool {
        ops.len() <= MAX_OPS && ops.iter().all(|op| Op::try_from(*op).is_ok_and(|op| op.only_looks()))
    }

    fn execute(
        &mut self,
        host: &mut dyn Host,
        wire: WireOp,
        is_awaited: &mut dyn FnMut() -> bool,
    ) -> Result<Progress, Refused> {
        let op = Op::try_from(wire).map_err(|bad| {
            let index = self.next;
            let text = format_args!(
                "operation {index} of the request is malformed ({bad}); do client and emulator have the same version?"
            );
            Refused::new(Code::MALFORMED, text)
        })?;
        let reply = self.execution.run_while(host, &op, is_awaited)?;
        let Some(reply) = reply else { return Ok(Progress::Waiting) };
        self.replies.push(&reply)?;
        Ok(Progress::Done)
    }
}

#[cfg(test)]
mod tests;
