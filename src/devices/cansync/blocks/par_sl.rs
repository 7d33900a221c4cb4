//! `CANsync_PAR_SL`: parameter jobs at a slave (p. 225-229).

use super::registers::Job;
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::par_job_slave::{
    ACTIVE, BUSY, CHANGED, DOUBLEWORD, ERROR, READ, RESET, WRITE,
};
use crate::plc::{Base, Like, function_block};

function_block! {
    /// Shows the master's parameter jobs to a slave's application and sends its answers (manual p. 225-229).
    ///
    /// The block shows a job in one call, and reads the application's results from the next call on. So in
    /// the call that shows the job, `x_OK_IN` may still have its value from the end of the last job (decision
    /// D-210).
    pub struct CANsync_PAR_SL(_BASE: Base<CANsync_SL_CTRL_BMSTRUCT>) {
        in {
            /// Value of the parameter, for a read job.
            ud_PAR_VALUE_READ: u32;
            /// Format of `ud_PAR_VALUE_READ`: FALSE word, TRUE doubleword.
            x_PAR_FORMAT_READ: bool;
            /// Error number sent to the master with `x_ERR_IN`.
            i_ERR: i16;
            /// TRUE if the application could not do the job.
            x_ERR_IN: bool;
            /// The application has done the job.
            x_OK_IN: bool;
            /// Shows jobs and sends answers. If the input becomes FALSE while `x_BUSY` is TRUE, the job is
            /// cancelled, and the block needs `x_RESET`.
            x_EN: bool;
            /// TRUE resets the block.
            x_RESET: bool;
        }
        out {
            /// The master has withdrawn the job that the block shows. The output stays TRUE until the block
            /// shows the next job.
            x_RESET_JOB: bool;
            /// A read job is to be done.
            x_READ: bool;
            /// A write job is to be done.
            x_WRITE: bool;
            /// Parameter number of the job.
            u_PAR_NR: u16;
            /// Format of a write job: FALSE word, TRUE doubleword.
            x_PAR_FORMAT_WRITE: bool;
            /// Value of a write job.
            ud_PAR_VALUE_WRITE: u32;
            /// Waits for the application.
            x_ACTIV: bool;
            /// Waits for the application, or for the master to fetch the answer.
            x_BUSY: bool;
            /// The master has fetched the answer to the last job. The job may have ended with or without an
            /// error.
            x_OK: bool;
        }
        internal: JobPhase;
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub enum JobPhase {
    #[default]
    Idle,
    /// The application is at work.
    Shown,
    /// The answer is ready for the master.
    Answered,
    /// Cancelled; waits for `x_RESET`.
    Locked,
}

impl CANsync_PAR_SL {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_SL_CTRL_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        if self.x_RESET {
            self.show(JobPhase::Idle);
            (self.x_RESET_JOB, self.x_OK) = (false, false);
            return;
        }
        if !self.x_EN {
            if matches!(self.internal, JobPhase::Shown | JobPhase::Answered) {
                self.show(JobPhase::Locked);
            }
            return;
        }
        let job = Job { control: &_BASE.b_STEUREG_PAR_CMD, status: &_BASE.b_STATREG_PAR_CMD };
        let control = job.control();
        match self.internal {
            JobPhase::Locked => {}
            JobPhase::Shown | JobPhase::Answered if control & CHANGED != 0 => {
                job.change(|value| value | RESET);
                self.drop_job();
            }
            // The firmware keeps READ or WRITE until it drops the job (decision D-63).
            JobPhase::Shown | JobPhase::Answered if control & (READ | WRITE) == 0 => self.drop_job(),
            JobPhase::Shown => self.take_results(_BASE, &job),
            // A new job means that the answer to the previous job was sent.
            JobPhase::Answered if control & BUSY == 0 || control & ACTIVE != 0 => {
                self.x_OK = true;
                self.show(JobPhase::Idle);
            }
            JobPhase::Answered => {}
            // Bit 7 is set: the master has changed to another job, which the firmware has not entered yet.
            JobPhase::Idle if control & RESET != 0 => {}
            // Either the job was never shown, or `x_RESET` has withdrawn it, before or after its answer (p.
            // 190).
            JobPhase::Idle if control & CHANGED != 0 => job.change(|value| value | RESET),
            JobPhase::Idle if control & ACTIVE != 0 => self.enter(_BASE, control),
            JobPhase::Idle => {}
        }
    }

    /// Changes to `phase` and updates the outputs.
    fn show(&mut self, phase: JobPhase) {
        self.internal = phase;
        self.x_ACTIV = matches!(phase, JobPhase::Shown);
        self.x_BUSY = matches!(phase, JobPhase::Shown | JobPhase::Answered);
        if !self.x_ACTIV {
            (self.x_READ, self.x_WRITE) = (false, false);
        }
    }

    /// Drops the job that the block shows, because the job is no longer valid.
    fn drop_job(&mut self) {
        self.x_RESET_JOB = true;
        self.show(JobPhase::Idle);
    }

    /// Shows the job in the registers.
    fn enter(&mut self, base: &CANsync_SL_CTRL_BMSTRUCT, control: u8) {
        self.u_PAR_NR = base.w_PAR_NR.load();
        self.x_READ = control & READ != 0;
        self.x_WRITE = control & WRITE != 0;
        if self.x_WRITE {
            self.ud_PAR_VALUE_WRITE = base.d_DATA_PAR_CMD.load();
            self.x_PAR_FORMAT_WRITE = control & DOUBLEWORD != 0;
        }
        (self.x_RESET_JOB, self.x_OK) = (false, false);
        self.show(JobPhase::Shown);
    }

    /// Passes the application's results to the firmware.
    fn take_results(&mut self, base: &CANsync_SL_CTRL_BMSTRUCT, job: &Job) {
        if self.x_ERR_IN {
            base.w_ERR_NR_PAR_CMD.store(self.i_ERR as u16);
            job.change(|value| value & !ACTIVE | ERROR);
        } else if self.x_OK_IN {
            let format = match (self.x_READ, self.x_PAR_FORMAT_READ) {
                (true, true) => DOUBLEWORD,
                _ => 0,
            };
            if self.x_READ {
                base.d_DATA_PAR_CMD.store(self.ud_PAR_VALUE_READ);
            }
            job.change(|value| value & !ACTIVE | format);
        } else {
            return;
        }
        self.show(JobPhase::Answered);
    }
}
