//! What the user has the emulator do.

use super::source::{Haste, Source, Trouble};
use crate::request::{Code, Op, Reply};
use crate::time;

/// So much emulated time passes between two looks, in microseconds.
const SLICE_US: u64 = 100_000;

/// Something to be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Task {
    /// What it is, as it is told once it is done.
    pub told: String,
    /// What is left of it.
    pub work: Work,
}

/// The kinds of work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Work {
    /// All at once.
    Ops(Vec<Op>),
    /// Time passes, in microseconds: so much, of which this is left.
    Advance { us: u64, left_us: u64 },
    /// Time passes until all conditions hold, in microseconds: so much at most, of which this is left.
    Until { conditions: Vec<Op>, us: u64, left_us: u64 },
}

/// What came of a part of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// There is more to do.
    More(Task),
    /// It is done: what to tell.
    Done(String),
    /// It cannot be done: why.
    Refused(String),
}

impl Task {
    /// Does a part of it.
    ///
    /// # Errors
    /// There is no answer.
    pub(super) fn go(self, source: &mut dyn Source) -> Result<Outcome, Trouble> {
        let (ops, slice_us) = match &self.work {
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
        let replies = source.request(&ops, Haste::Work)?;
        let refusal = replies.into_iter().find_map(|reply| match reply {
            Reply::Error(refused) => Some(refused),
            _ => None,
        });
        let left = |left_us: u64| left_us.saturating_sub(slice_us);
        Ok(match (self.work, refusal) {
            (Work::Advance { us, left_us }, None) if left(left_us) > 0 => {
                Outcome::More(Task { work: Work::Advance { us, left_us: left(left_us) }, ..self })
            }
            (_, None) => Outcome::Done(self.told),
            (Work::Until { conditions, us, left_us }, Some(refused)) if refused.code == Code::NOT_IN_TIME => {
                match left(left_us) {
                    0 => Outcome::Refused(format!("not yet: {}", self.told)),
                    left_us => {
                        let work = Work::Until { conditions, us, left_us };
                        Outcome::More(Task { work, told: self.told })
                    }
                }
            }
            (_, Some(refused)) => Outcome::Refused(refused.to_string()),
        })
    }

    /// Whether it takes its time.
    pub(super) fn is_long(&self) -> bool {
        match &self.work {
            Work::Ops(ops) => ops.iter().any(|op| matches!(op, Op::Back { .. } | Op::BackUntil { .. })),
            Work::Advance { .. } | Work::Until { .. } => true,
        }
    }

    /// That it was ended, and how far it was.
    pub(super) fn given_up(&self) -> String {
        match &self.work {
            Work::Ops(_) => format!("not done: {}", self.told),
            Work::Advance { us, left_us } => format!("ended: {} passed", of(*us, *left_us)),
            Work::Until { us, left_us, .. } => {
                format!("ended: {} passed, not yet {}", of(*us, *left_us), self.told)
            }
        }
    }

    /// What is going on.
    pub(super) fn going_on(&self) -> String {
        match &self.work {
            Work::Ops(_) => format!("under way: {}", self.told),
            Work::Advance { us, left_us } => format!("{} passed; Esc ends", of(*us, *left_us)),
            Work::Until { us, left_us, .. } => {
                format!("waits for {}: {} passed; Esc ends", self.told, of(*us, *left_us))
            }
        }
    }
}

/// How much of a time is over: `12.3 s of 60 s`.
fn of(us: u64, left_us: u64) -> String {
    let done_us = us.saturating_sub(left_us);
    let done = match us {
        1_000_000.. => format!("{}.{} s", done_us / 1_000_000, done_us % 1_000_000 / 100_000),
        _ => time::short(done_us),
    };
    format!("{done} of {}", time::short(us))
}
