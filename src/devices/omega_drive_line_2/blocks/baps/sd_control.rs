//! `BAPS_SD_CONTROL`: executes the jobs of `BAPS_PAR_READ` and `BAPS_PAR_WRITE` (p. 118-120).

use super::service_data::{Answer, BAPS_BMSTRUCT, Job, JobKind, Stage};
use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::{
    baps_job, baps_result,
    baps_semaphore::{IDLE, JOB},
};
use crate::plc::{Base, Shared, Watch, function_block};
use core::time::Duration;

/// Bits of the output `b_ERR`.
mod error {
    /// A read job was dropped (decision D-218).
    pub(crate) const READ_DISTURBED: u8 = 1 << 0;
    /// A write job was dropped.
    pub(crate) const WRITE_DISTURBED: u8 = 1 << 1;
    pub(crate) const NO_START: u8 = 1 << 2;
    pub(crate) const INTERRUPTED: u8 = 1 << 3;
    pub(crate) const NO_END: u8 = 1 << 4;
    pub(crate) const JOB: u8 = 1 << 5;
    pub(crate) const FORMAT: u8 = 1 << 6;
}

function_block! {
    /// Executes parameter jobs through the semaphores of the BAPS, sequentially (manual p. 118-120). A single instance
    /// serves all [`BAPS_PAR_READ`](super::BAPS_PAR_READ) and [`BAPS_PAR_WRITE`](super::BAPS_PAR_WRITE).
    pub struct BAPS_SD_CONTROL(_BASE: Base<BAPS_CTRL_BMSTRUCT>, _BAPS_SD_DATA: Shared<BAPS_BMSTRUCT>) {
        in {
            /// Resets the block; needed after the errors of bits 0 to 4.
            x_RESET: bool;
            /// Monitoring time of each step, in emulated time; preset 3 s.
            t_TIME: Duration = Duration::from_secs(3);
        }
        out {
            /// Bit 0: a read job was dropped; bit 1: a write job was dropped. Timeouts: bit 2 at the start of
            /// a job, bit 3 during it, bit 4 at its end. The last job: bit 5 it failed, bit 6 it had a wrong
            /// format.
            b_ERR: u8;
            /// `b_ERR` is not 0.
            x_ERR: bool;
        }
        internal: Phase;
    }
}

/// Event for which the block waits.
#[derive(Clone, Copy, Debug, Default)]
pub enum Phase {
    /// A parameter block enters a job.
    #[default]
    Idle,
    /// Master and slave semaphore are 0.
    Starting(Watch),
    /// The drive sets its semaphore to 1.
    Running(Watch),
    /// The drive sets its semaphore back to 0.
    Ending(Watch, Answer),
    /// The program sets `x_RESET`.
    Locked,
}

impl BAPS_SD_CONTROL {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<BAPS_CTRL_BMSTRUCT>, _BAPS_SD_DATA: &mut BAPS_BMSTRUCT) {
        if self.x_RESET {
            _BASE.b_MA_SEMAPHORE.store(IDLE);
            _BAPS_SD_DATA.stage = Stage::Free;
            self.internal = Phase::Idle;
            return self.show(0);
        }
        if let Stage::Dropped(kind) = _BAPS_SD_DATA.stage {
            _BASE.b_MA_SEMAPHORE.store(IDLE);
            self.internal = Phase::Locked;
            return self.show(match kind {
                JobKind::Read => error::READ_DISTURBED,
                JobKind::Write => error::WRITE_DISTURBED,
            });
        }
        if let (Phase::Idle, Stage::Entered(_)) = (self.internal, _BAPS_SD_DATA.stage) {
            self.show(0);
            self.internal = Phase::Starting(_BASE.ram().watch(self.t_TIME));
        }
        if let Stage::Entered(job) = _BAPS_SD_DATA.stage
            && let Some(answer) = self.proceed(_BASE, &job)
        {
            _BAPS_SD_DATA.stage = Stage::Answered(job, answer);
        }
    }

    /// Continues the job. If it has ended, returns its answer.
    fn proceed(&mut self, base: &Base<BAPS_CTRL_BMSTRUCT>, job: &Job) -> Option<Answer> {
        let semaphores = (base.b_MA_SEMAPHORE.load(), base.b_SL_SEMAPHORE.load());
        match (self.internal, semaphores) {
            (Phase::Starting(_), (IDLE, IDLE)) => {
                write_job(base, job);
                base.b_MA_SEMAPHORE.store(JOB);
                self.internal = Phase::Running(base.ram().watch(self.t_TIME));
                None
            }
            (Phase::Running(_), (JOB, JOB)) => {
                let answer = read_answer(base);
                base.b_MA_SEMAPHORE.store(IDLE);
                self.internal = Phase::Ending(base.ram().watch(self.t_TIME), answer);
                None
            }
            (Phase::Ending(_, answer), (IDLE, IDLE)) => {
                self.internal = Phase::Idle;
                self.show(match answer.detail {
                    baps_result::NO_ERROR => 0,
                    baps_result::WRONG_FORMAT => error::FORMAT,
                    _ => error::JOB,
                });
                Some(answer)
            }
            (Phase::Starting(watch), _) if watch.is_over(base.ram()) => {
                Some(self.give_up(base, error::NO_START))
            }
            (Phase::Running(watch), _) if watch.is_over(base.ram()) => {
                Some(self.give_up(base, error::INTERRUPTED))
            }
            (Phase::Ending(watch, _), _) if watch.is_over(base.ram()) => {
                Some(self.give_up(base, error::NO_END))
            }
            (Phase::Locked, _) => Some(Answer { communication: -1, ..Answer::default() }),
            _ => None,
        }
    }

    fn give_up(&mut self, base: &BAPS_CTRL_BMSTRUCT, error: u8) -> Answer {
        base.b_MA_SEMAPHORE.store(IDLE);
        self.internal = Phase::Locked;
        self.show(error);
        Answer { communication: -1, ..Answer::default() }
    }

    fn show(&mut self, error: u8) {
        (self.b_ERR, self.x_ERR) = (error, error != 0);
    }
}

fn write_job(base: &BAPS_CTRL_BMSTRUCT, job: &Job) {
    base.u_PAR_NR.store(job.number);
    base.us_PAR_ELEMENT.store(job.element);
    base.us_NUMBER.store(1);
    let code = match job.kind {
        JobKind::Read => baps_job::READ,
        JobKind::Write => {
            base.b_PAR_FORMAT.store(job.doubleword.into());
            base.ud_PAR_VALUE.store(job.value);
            baps_job::WRITE
        }
    };
    base.b_JOB.store(code);
}

fn read_answer(base: &BAPS_CTRL_BMSTRUCT) -> Answer {
    Answer {
        detail: base.i_ERR_DETAIL.load(),
        communication: 0,
        doubleword: base.b_PAR_FORMAT.load() != 0,
        value: base.ud_PAR_VALUE.load(),
    }
}
