//! Parameter jobs for the application of a slave node (manual 5.00005.03a p. 188-190).
//!
//! A job is entered in the registers and stays there until its answer has been sent. The application clears
//! bit 0 when it has done the job. Until then, each repetition of the job by the master is answered with BUSY
//! (p. 139-140).

use crate::devices::Context;
use crate::devices::cansync::firmware::job_registers::JobRegisters;
use crate::devices::cansync::frames::codec::parameter::VALUE_ELEMENT;
use crate::devices::cansync::frames::codec::{Access, ParameterJob, ParameterResponse, ParameterResult};
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{
    par_error,
    par_job_slave::{ACTIVE, BUSY, CHANGED, DOUBLEWORD, ERROR, READ, RESET, WRITE},
};
use crate::devices::emulation::recorded_register::RecordedRegister;
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// A slave node's side of parameter jobs.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct ParameterServer {
    /// Job in the registers. It is kept until its answer has been sent.
    entered: Option<ParameterJob>,
    /// Job that has replaced the job in the registers. The firmware enters it when the application confirms
    /// the change with bit 7.
    changed: Option<ParameterJob>,
    /// True if the job ends when the answer that is now on the wire has been sent.
    ends: bool,
}

impl ParameterServer {
    /// Returns an error number if the firmware must refuse the job, because the application has no register
    /// for it. Such jobs are for sub-slaves, or write to other elements than the parameter's value (p. 140;
    /// decision D-60).
    pub(super) fn refusal(job: &ParameterJob) -> Option<u16> {
        let write = !matches!(job.access(), Access::Read);
        if job.sub_slave() != 0 {
            Some(par_error::NOT_PRESENT)
        } else if write && job.element() != VALUE_ELEMENT {
            Some(par_error::NOT_CHANGEABLE)
        } else {
            None
        }
    }

    /// Handles a job of the master for the application. A job that differs in any way from the job in
    /// progress counts as a change. The registers show the change until the application confirms it (p. 190;
    /// decision D-61).
    pub(super) fn job(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &ParameterJob) {
        match self.entered {
            Some(entered) if entered == *job && self.changed.is_none() => {}
            Some(_) => {
                self.changed = Some(*job);
                registers(regs).change(ctx, |value| value | CHANGED);
            }
            None => self.enter(ctx, regs, *job),
        }
    }

    fn enter(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: ParameterJob) {
        let (kind, value) = match job.access() {
            Access::Read => (READ, None),
            Access::WriteWord(value) => (WRITE, Some(u32::from(value))),
            Access::WriteDoubleword(value) => (WRITE | DOUBLEWORD, Some(value)),
        };
        if let Some(value) = value {
            let offset = offset_of!(CANsync_SL_CTRL_BMSTRUCT, d_DATA_PAR_CMD);
            regs.d_DATA_PAR_CMD.show(ctx, offset, value);
        }
        regs.w_PAR_NR.show(ctx, offset_of!(CANsync_SL_CTRL_BMSTRUCT, w_PAR_NR), job.number());
        registers(regs).show(ctx, BUSY | ACTIVE | kind);
        self.entered = Some(job);
        self.changed = None;
    }

    /// Returns true if the master has changed the job and the application must still confirm the change.
    #[inline]
    pub(super) fn waits_for_reset(&self) -> bool {
        self.changed.is_some()
    }

    /// Enters the changed job when the application has confirmed the change with bit 7 (decision D-62).
    pub(super) fn poll(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        if let Some(job) = self.changed
            && registers(regs).control() & RESET != 0
        {
            self.enter(ctx, regs, job);
        }
    }

    /// Returns the present answer, at the start of the response slot.
    pub(super) fn response(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
    ) -> Option<ParameterResponse> {
        self.poll(ctx, regs);
        self.ends = false;
        if let Some(job) = self.changed {
            return Some(job.answer(ParameterResult::Busy));
        }
        let job = self.entered?;
        let control = registers(regs).control();
        if control & ACTIVE != 0 {
            return Some(job.answer(ParameterResult::Busy));
        }
        self.ends = true;
        Some(job.answer(if control & ERROR != 0 {
            ParameterResult::Error(regs.w_ERR_NR_PAR_CMD.load())
        } else {
            match job.access() {
                Access::Read if control & DOUBLEWORD != 0 => {
                    ParameterResult::Doubleword(regs.d_DATA_PAR_CMD.load())
                }
                Access::Read => ParameterResult::Word(regs.d_DATA_PAR_CMD.load() as u16),
                Access::WriteWord(_) | Access::WriteDoubleword(_) => ParameterResult::Done,
            }
        }))
    }

    /// Ends an answer that was sent. If it was the final answer of the job, bit 6 is cleared and the job
    /// ends.
    pub(super) fn response_sent(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        if self.ends {
            self.ends = false;
            self.entered = None;
            registers(regs).change(ctx, |value| value & !BUSY);
        }
    }

    /// Drops the job in progress. The registers then show no job (decision D-63).
    pub(super) fn drop_job(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        *self = ParameterServer::default();
        registers(regs).show(ctx, 0);
    }
}

fn registers(regs: &CANsync_SL_CTRL_BMSTRUCT) -> JobRegisters<'_> {
    JobRegisters {
        control: &regs.b_STEUREG_PAR_CMD,
        status: &regs.b_STATREG_PAR_CMD,
        offset: offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_STEUREG_PAR_CMD),
        is_masters: false,
    }
}
