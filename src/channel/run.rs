//! A request of the channel: operations as they came, one after the other, and the replies to be sent.

use super::wire::{ReplyBuffer, WireOp};
use crate::request::{Code, Execution, Host, MAX_OPS, Op, Refused};

/// Whether a request is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Progress {
    /// All operations are answered, or one of them by an error.
    Done,
    /// A wait goes on, or an operation pauses; try again after the next firmware step.
    Waiting,
}

/// A request under way.
#[derive(Debug, Default)]
pub(crate) struct Run {
    /// Position of the next operation.
    next: usize,
    /// That operation.
    execution: Execution,
    /// The replies so far.
    pub replies: ReplyBuffer,
}

impl Run {
    /// Makes it ready for another request; the reply buffer's memory stays.
    pub(crate) fn reset(&mut self) {
        self.next = 0;
        self.execution = Execution::default();
        self.replies.clear();
    }

    /// Executes `ops` from where the last call stopped. They are read once each, so it does no harm if a
    /// hostile client changes them meanwhile.
    pub(crate) fn go(&mut self, host: &mut dyn Host, ops: &[WireOp]) -> Progress {
        if ops.len() > MAX_OPS {
            let count = ops.len();
            let text = format_args!("{count} operations in one request are too many, at most {MAX_OPS}");
            self.replies.error(&Refused::new(Code::TOO_MANY_OPERATIONS, text));
            return Progress::Done;
        }
        if self.next == 0 && !self.execution.is_under_way() {
            host.begin_request();
        }
        self.go_on(host, ops)
    }

    /// Executes operations that only look, while another request is under way. The host need not know.
    pub(crate) fn look(&mut self, host: &mut dyn Host, ops: &[WireOp]) -> Progress {
        self.go_on(host, ops)
    }

    fn go_on(&mut self, host: &mut dyn Host, ops: &[WireOp]) -> Progress {
        while let Some(wire) = ops.get(self.next) {
            match self.execute(host, *wire) {
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

    /// Ends a request that waits, because the emulator ends.
    pub(crate) fn abort(&mut self) {
        self.replies.error(&Refused::shutting_down());
    }

    /// Whether all operations only look at the plant.
    pub(crate) fn only_looks(ops: &[WireOp]) -> bool {
        ops.len() <= MAX_OPS && ops.iter().all(|op| Op::try_from(*op).is_ok_and(|op| op.only_looks()))
    }

    fn execute(&mut self, host: &mut dyn Host, wire: WireOp) -> Result<Progress, Refused> {
        let op = Op::try_from(wire).map_err(|bad| {
            let index = self.next;
            let text = format_args!(
                "operation {index} of the request is malformed ({bad}); do client and emulator have the same version?"
            );
            Refused::new(Code::MALFORMED, text)
        })?;
        let Some(reply) = self.execution.run(host, &op)? else { return Ok(Progress::Waiting) };
        self.replies.push(&reply)?;
        Ok(Progress::Done)
    }
}

#[cfg(test)]
mod tests;
