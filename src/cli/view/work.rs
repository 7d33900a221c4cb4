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
    /// So much time passes, in microseconds.
    Advance(u64),
    /// Time passes until all conditions hold, at most for so long, in microseconds.
    Until(Vec<Op>, u64),
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
            Work::Advance(left_us) => {
                let us = SLICE_US.min(*left_us);
                (vec![Op::Advance { us }], us)
            }
            Work::Until(conditions, left_us) => {
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
            (Work::Advance(us), None) if left(us) > 0 => {
                Outcome::More(Task { work: Work::Advance(left(us)), ..self })
            }
            (_, None) => Outcome::Done(self.told),
            (Work::Until(conditions, us), Some(refused)) if refused.code == Code::NOT_IN_TIME => {
                match left(us) {
                    0 => Outcome::Refused(format!("not yet: {}", self.told)),
                    left => Outcome::More(Task { work: Work::Until(conditions, left), told: self.told }),
                }
            }
            (_, Some(refused)) => Outcome::Refused(refused.to_string()),
        })
    }

    /// Whether it takes its time.
    pub(super) fn is_long(&self) -> bool {
        !matches!(self.work, Work::Ops(_))
    }

    /// What is going on.
    pub(super) fn going_on(&self) -> String {
        match &self.work {
            Work::Ops(_) => self.told.clone(),
            Work::Advance(left) | Work::Until(_, left) => {
                format!("{}; {} left, Esc ends", self.told, time::short(*left))
            }
        }
    }
}
