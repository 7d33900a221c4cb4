//! Types that `BAPS_PAR_READ`, `BAPS_PAR_WRITE` and `BAPS_SD_CONTROL` share. There is at most one job at a
//! time.

/// Variable through which the blocks of the service data exchange jobs and answers (manual p. 94, 97, 119).
/// Only these blocks use its content (decision D-215).
#[derive(Clone, Debug, Default)]
pub struct BAPS_BMSTRUCT {
    pub(super) stage: Stage,
    /// Number of the last ticket. A ticket identifies the block that has entered a job.
    pub(super) tickets: u32,
}

/// Progress of the job.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Stage {
    #[default]
    Free,
    /// A block has entered a job.
    Entered(Job),
    /// `BAPS_SD_CONTROL` has answered the job.
    Answered(Job, Answer),
    /// The block that entered the job has dropped it.
    Dropped(JobKind),
}

/// A job that reads or writes a parameter of the drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Job {
    pub(super) ticket: u32,
    pub(super) kind: JobKind,
    pub(super) number: u16,
    pub(super) element: u8,
    pub(super) doubleword: bool,
    pub(super) value: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum JobKind {
    Read,
    Write,
}

/// Result of a job.
#[derive(Clone, Copy, Debug, Default)]
pub struct Answer {
    /// `i_ERR_DETAIL`, as the register holds it.
    pub(super) detail: u16,
    /// `i_ERR_COMM`: 0 or -1.
    pub(super) communication: i16,
    pub(super) doubleword: bool,
    pub(super) value: u32,
}

/// A block's side of the shared variable.
#[derive(Clone, Copy, Debug, Default)]
pub struct Client {
    phase: Phase,
}

#[derive(Clone, Copy, Debug, Default)]
enum Phase {
    #[default]
    Idle,
    /// The block waits because the job of another block is in progress.
    Waiting,
    /// The job with this ticket is in progress.
    Running(u32),
    /// The job has ended. The block waits until `x_EN` is FALSE.
    Done,
    /// Cancelled or disturbed: only `x_RESET` helps.
    Locked,
}

/// Result of a call. It determines the outputs.
pub(super) enum Outcome {
    Unchanged,
    Cleared,
    Busy,
    Answered(Answer),
}

impl Outcome {
    /// Returns `x_BUSY` and, if there is one, the answer. Returns `None` if the outputs must not change.
    pub(super) fn shown(self) -> Option<(bool, Option<Answer>)> {
        match self {
            Outcome::Unchanged => None,
            Outcome::Cleared => Some((false, None)),
            Outcome::Busy => Some((true, None)),
            Outcome::Answered(answer) => Some((false, Some(answer))),
        }
    }
}

impl Client {
    /// Runs one call. If `enable` is true, enters `job` and waits for its answer.
    pub(super) fn step(
        &mut self,
        shared: &mut BAPS_BMSTRUCT,
        [enable, reset]: [bool; 2],
        job: impl FnOnce(u32) -> Job,
    ) -> Outcome {
        if reset {
            self.drop_job(shared);
            self.phase = Phase::Idle;
            return Outcome::Cleared;
        }
        match (self.phase, enable) {
            (Phase::Waiting | Phase::Running(_), false) => {
                self.drop_job(shared);
                self.phase = Phase::Locked;
                return Outcome::Cleared;
            }
            (Phase::Done, false) => self.phase = Phase::Idle,
            (Phase::Idle, true) => self.phase = Phase::Waiting,
            _ => {}
        }
        match (self.phase, shared.stage) {
            (Phase::Waiting, Stage::Free) => {
                shared.tickets = shared.tickets.wrapping_add(1);
                shared.stage = Stage::Entered(job(shared.tickets));
                self.phase = Phase::Running(shared.tickets);
                Outcome::Busy
            }
            (Phase::Running(ticket), Stage::Answered(of, answer)) if of.ticket == ticket => {
                shared.stage = Stage::Free;
                self.phase = if answer.communication == 0 { Phase::Done } else { Phase::Locked };
                Outcome::Answered(answer)
            }
            (Phase::Running(ticket), Stage::Entered(of)) if of.ticket == ticket => Outcome::Busy,
            // Another block has reset the shared variable while the job was in progress, so no answer will
            // come.
            (Phase::Running(_), _) => {
                self.phase = Phase::Locked;
                Outcome::Answered(Answer { communication: -1, ..Answer::default() })
            }
            (Phase::Waiting, _) => Outcome::Busy,
            _ => Outcome::Unchanged,
        }
    }

    fn drop_job(&self, shared: &mut BAPS_BMSTRUCT) {
        match (self.phase, shared.stage) {
            (Phase::Running(ticket), Stage::Entered(job)) if job.ticket == ticket => {
                shared.stage = Stage::Dropped(job.kind);
            }
            (Phase::Running(ticket), Stage::Answered(job, _)) if job.ticket == ticket => {
                shared.stage = Stage::Free;
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(ticket: u32) -> Job {
        Job { ticket, kind: JobKind::Write, number: 1, element: 1, doubleword: false, value: 0 }
    }

    const CALL: [bool; 2] = [true, false];
    const RESET: [bool; 2] = [false, true];

    #[test]
    fn a_reset_drops_the_own_job_and_no_other() {
        let (mut shared, mut one, mut other) =
            (BAPS_BMSTRUCT::default(), Client::default(), Client::default());
        one.step(&mut shared, CALL, job);
        other.step(&mut shared, CALL, job);
        other.step(&mut shared, RESET, job);
        assert!(matches!(shared.stage, Stage::Entered(Job { ticket: 1, .. })), "{:?}", shared.stage);
        let mut running = one;
        // The shared variable was reset, and another block has used it since then.
        shared.stage = Stage::Free;
        other.step(&mut shared, CALL, job);
        let outcome = one.step(&mut shared, CALL, job);
        assert!(
            matches!(outcome, Outcome::Answered(Answer { communication: -1, .. })),
            "no answer will come"
        );
        assert!(matches!(other.step(&mut shared, CALL, job), Outcome::Busy));
        running.step(&mut shared, RESET, job);
        assert!(matches!(shared.stage, Stage::Entered(Job { ticket: 2, .. })), "{:?}", shared.stage);
        other.step(&mut shared, RESET, job);
        assert!(matches!(shared.stage, Stage::Dropped(JobKind::Write)), "{:?}", shared.stage);
    }

    #[test]
    fn an_unwanted_answer_makes_room() {
        let (mut shared, mut one, mut other) =
            (BAPS_BMSTRUCT::default(), Client::default(), Client::default());
        one.step(&mut shared, CALL, job);
        shared.stage = Stage::Answered(job(2), Answer::default());
        one.step(&mut shared, RESET, job);
        assert!(matches!(shared.stage, Stage::Answered(..)), "the answer belongs to another job");
        other.step(&mut shared, RESET, job);
        shared.stage = Stage::Free;
        one.step(&mut shared, CALL, job);
        shared.stage = Stage::Answered(job(shared.tickets), Answer::default());
        one.step(&mut shared, RESET, job);
        assert!(matches!(shared.stage, Stage::Free), "{:?}", shared.stage);
    }
}
