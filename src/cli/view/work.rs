//! Tasks of the user for the emulator.

use super::source::{RequestError, RequestKind, Source};
use crate::identity::DeviceIndex;
use crate::layout::BitAccess;
use crate::request::{Code, Op, Reply};
use crate::time;

/// Emulated time that a task advances between two polls, in microseconds.
const SLICE_US: u64 = 100_000;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Task {
    /// Description of the task in messages.
    pub description: String,
    /// The part of the work that remains.
    pub work: Work,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Work {
    /// Operations in one request.
    Ops(Vec<Op>),
    /// Writes or forces a single bit; the other bits of its register keep their values.
    Bit { plc: DeviceIndex, access: BitAccess, state: u32, is_forced: bool },
    /// Advances the clock by `us` microseconds, of which `left_us` are left.
    Advance { us: u64, left_us: u64 },
    /// Advances the clock until all conditions are true, at most by `us` microseconds, of which `left_us` are left.
    Until { conditions: Vec<Op>, us: u64, left_us: u64 },
}

/// Result of one part of a task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The task is not finished; the value is the remaining work.
    More(Task),
    /// The task is done; the text describes it.
    Done(String),
    /// The task was refused; the text is the reason.
    Refused(String),
}

impl Task {
    /// Executes a part of the task.
    ///
    /// # Errors
    /// The emulator does not reply.
    pub(super) fn go(self, source: &mut dyn Source) -> Result<Outcome, RequestError> {
        if let Work::Bit { plc, access, state, is_forced } = self.work {
            return self.write_bit(plc, access, state, is_forced, source);
        }
        let (ops, slice_us) = match &self.work {
            Work::Bit { .. } => (Vec::new(), 0),
            Work::Ops(ops) => (ops.clone(), 0),
            Work::Advance { left_us, .. } => {
                let us = SLICE_US.min(*left_us);
                (vec![Op::Advance { us }], us)
            }
            Work::Until { conditions, left_us, .. } => {
                let within_us = SLICE_US.min(*left_us);
                let wait = Op::WaitFor { any: false, within_us };
                (conditions.iter().copied().chain([wait]).collect(), within_us)
            }
        };
        let replies = source.request(&ops, RequestKind::Task)?;
        let refusal = replies.into_iter().find_map(|reply| match reply {
            Reply::Error(refused) => Some(refused),
            _ => None,
        });
        let left = |left_us: u64| left_us.saturating_sub(slice_us);
        Ok(match (self.work, refusal) {
            (Work::Advance { us, left_us }, None) if left(left_us) > 0 => {
                Outcome::More(Task { work: Work::Advance { us, left_us: left(left_us) }, ..self })
            }
            (_, None) => Outcome::Done(self.description),
            (Work::Until { conditions, us, left_us }, Some(refused)) if refused.code == Code::NOT_IN_TIME => {
                match left(left_us) {
                    0 => Outcome::Refused(format!("not yet: {}", self.description)),
                    left_us => {
                        let work = Work::Until { conditions, us, left_us };
                        Outcome::More(Task { work, description: self.description })
                    }
                }
            }
            (_, Some(refused)) => Outcome::Refused(refused.to_string()),
        })
    }

    /// Reads the register of a bit, then writes or forces it with the new state of the bit. Repeats both if another
    /// program has written the register in between.
    fn write_bit(
        self,
        plc: DeviceIndex,
        access: BitAccess,
        state: u32,
        is_forced: bool,
        source: &mut dyn Source,
    ) -> Result<Outcome, RequestError> {
        let BitAccess { offset, width, .. } = access;
        let current = match source.request(&[Op::Peek { plc, offset, width }], RequestKind::Task)?.pop() {
            Some(Reply::Value(current)) => current,
            Some(Reply::Error(refused)) => return Ok(Outcome::Refused(refused.to_string())),
            _ => return Ok(Outcome::More(self)),
        };
        let new = access.set(current, state);
        let op = match is_forced {
            true => Op::Force { plc, offset, width, value: new },
            false => Op::CompareExchange { plc, offset, width, current, new },
        };
        Ok(match source.request(&[op], RequestKind::Task)?.pop() {
            Some(Reply::Error(refused)) => Outcome::Refused(refused.to_string()),
            Some(Reply::Exchanged { ok: false, found }) if found == current => {
                Outcome::Refused(format!("{}: the register is forced and keeps its value", self.description))
            }
            Some(Reply::Exchanged { ok: false, .. }) => Outcome::More(self),
            _ => Outcome::Done(self.description),
        })
    }

    /// True if the task can take long.
    pub(super) fn is_long(&self) -> bool {
        match &self.work {
            Work::Ops(ops) => ops.iter().any(|op| matches!(op, Op::Back { .. } | Op::BackUntil { .. })),
            Work::Bit { .. } => false,
            Work::Advance { .. } | Work::Until { .. } => true,
        }
    }

    /// Message that the task was cancelled, with its progress.
    pub(super) fn cancelled(&self) -> String {
        match &self.work {
            Work::Ops(_) | Work::Bit { .. } => format!("cancelled: {}", self.description),
            Work::Advance { us, left_us } => format!("cancelled: {} passed", of(*us, *left_us)),
            Work::Until { us, left_us, .. } => {
                format!("cancelled: {} passed, not yet {}", of(*us, *left_us), self.description)
            }
        }
    }

    /// Message about the progress of the task.
    pub(super) fn progress(&self) -> String {
        match &self.work {
            Work::Ops(_) | Work::Bit { .. } => format!("running: {}", self.description),
            Work::Advance { us, left_us } => format!("{} passed; Esc ends", of(*us, *left_us)),
            Work::Until { us, left_us, .. } => {
                format!("waits for {}: {} passed; Esc ends", self.description, of(*us, *left_us))
            }
        }
    }
}

/// Progress of a time, for example `12.3 s of 60 s`.
fn of(us: u64, left_us: u64) -> String {
    let done_us = us.saturating_sub(left_us);
    let done = match us {
        1_000_000.. => format!("{}.{} s", done_us / 1_000_000, done_us % 1_000_000 / 100_000),
        _ => time::short(done_us),
    };
    format!("{done} of {}", time::short(us))
}
