//! Parameter jobs of the master's PLC (manual 5.00005.03a p. 164-166).
//!
//! A job is stored only in the registers. The firmware reads it again each time the master polls the slave of
//! the job. The firmware accepts an answer only if the registers still contain the job that was sent. So the
//! PLC can change or withdraw a job at any time. A job without an answer is sent again when the master polls
//! the slave again (decision D-11).

use super::job_registers::JobRegisters;
use crate::can::Payload;
use crate::devices::Context;
use crate::devices::cansync::frames::codec::parameter::{
    Access, ParameterJob, ParameterResponse, ParameterResult,
};
use crate::devices::cansync::registers::values::{par_error, par_job_master};
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CTRLREG_PAR_CMD_SL, DATA_PARAMETER};
use crate::devices::emulation::recorded_register::RecordedRegister;
use core::mem::offset_of;

/// The registers of the job for one slave.
struct Area<'a> {
    job: JobRegisters<'a>,
    data: &'a DATA_PARAMETER,
    /// `%MB3` offset of `data`, for the journal.
    data_offset: usize,
}

impl<'a> Area<'a> {
    fn of(regs: &'a CANsync_MA_CTRL_BMSTRUCT, slave: u8) -> Option<Self> {
        let index = usize::from(slave);
        let job = regs.a_CTRLREG_PAR_CMD_SL.get(index)?;
        Some(Area {
            job: JobRegisters {
                control: &job.b_STEUREG_PAR_CMD,
                status: &job.b_STATREG_PAR_CMD,
                offset: offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_CTRLREG_PAR_CMD_SL)
                    + index * size_of::<CTRLREG_PAR_CMD_SL>()
                    + offset_of!(CTRLREG_PAR_CMD_SL, b_STEUREG_PAR_CMD),
                is_masters: true,
            },
            data: regs.a_DATA_PARAMETER.get(index)?,
            data_offset: offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_DATA_PARAMETER)
                + index * size_of::<DATA_PARAMETER>(),
        })
    }

    /// Returns the job in `control` and the data registers, or the error number of the reason to refuse it
    /// (decision D-41). `w_SUBSL_ADR` is reserved: jobs address the slave itself.
    fn entered(&self, control: u8) -> Result<ParameterJob, u16> {
        let access = match (control & par_job_master::READ != 0, control & par_job_master::WRITE != 0) {
            (true, false) => Access::Read,
            (false, true) if control & par_job_master::DOUBLEWORD != 0 => {
                Access::WriteDoubleword(self.data.d_PAR_VALUE.load())
            }
            (false, true) => Access::WriteWord(self.data.d_PAR_VALUE.load() as u16),
            (true, true) | (false, false) => return Err(par_error::GENERAL),
        };
        ParameterJob::new(self.data.w_PAR_NR.load(), access).map_err(|_| par_error::NOT_PRESENT)
    }

    /// Shows the job's result.
    fn show_value(&self, ctx: &mut Context, value: u32) {
        let offset = self.data_offset + offset_of!(DATA_PARAMETER, d_PAR_VALUE);
        self.data.d_PAR_VALUE.show(ctx, offset, value);
    }

    /// Ends the job in `control` with an error number. Bit 3 is cleared, as at the end of a successful job
    /// (D-42).
    fn fail(&self, ctx: &mut Context, control: u8, number: u16) {
        self.show_value(ctx, u32::from(number));
        self.job.replace(ctx, control, ended(control) | par_job_master::ERROR);
    }
}

/// Returns the bits that remain in a control register at the end of its job: the requested access.
const fn ended(control: u8) -> u8 {
    control & !(par_job_master::ACTIVE | par_job_master::SENT | par_job_master::BUSY | par_job_master::ERROR)
}

/// Returns the job to send to `slave` now, if the PLC has entered one. A job that cannot be sent ends at
/// once.
#[inline]
pub(super) fn next(ctx: &mut Context, regs: &CANsync_MA_CTRL_BMSTRUCT, slave: u8) -> Option<ParameterJob> {
    let area = Area::of(regs, slave)?;
    let control = area.job.control.load();
    if control & par_job_master::ACTIVE == 0 {
        return None;
    }
    match area.entered(control) {
        // The busy bit stays set between repetitions.
        Ok(job) => area
            .job
            .replace(ctx, control, control & !par_job_master::ERROR | par_job_master::SENT)
            .then_some(job),
        Err(number) => {
            area.fail(ctx, control, number);
            None
        }
    }
}

/// Handles the answer of `slave` to `job`. An answer that does not fit the job is ignored, as if no answer
/// had come.
pub(super) fn answered(
    ctx: &mut Context,
    regs: &CANsync_MA_CTRL_BMSTRUCT,
    slave: u8,
    job: &ParameterJob,
    payload: &Payload,
) {
    const UNDER_WAY: u8 = par_job_master::ACTIVE | par_job_master::SENT;
    let Some(area) = Area::of(regs, slave) else { return };
    let control = area.job.control.load();
    // If bit 3 is clear, the PLC has entered a new job. This is possible even if the new job equals the old
    // job.
    if control & UNDER_WAY != UNDER_WAY || area.entered(control) != Ok(*job) {
        return;
    }
    let Ok(response) = ParameterResponse::decode(job, payload) else { return };
    let end = ended(control);
    let end = match response.result() {
        ParameterResult::Busy => control | par_job_master::BUSY,
        ParameterResult::Error(number) => return area.fail(ctx, control, number),
        ParameterResult::Done => end,
        // The answer determines the format, independent of the requested format (p. 165).
        ParameterResult::Word(value) => {
            area.show_value(ctx, u32::from(value));
            end & !par_job_master::DOUBLEWORD
        }
        ParameterResult::Doubleword(value) => {
            area.show_value(ctx, value);
            end | par_job_master::DOUBLEWORD
        }
    };
    area.job.replace(ctx, control, end);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES;
    use crate::memory::Segment;

    /// The register offsets for the journal are equal to those in the register table.
    #[test]
    fn register_offsets_of_every_slave_match_the_table() {
        let base = NODES.area("node2").unwrap().first;
        let segment = Segment::of(&NODES);
        let regs = segment.view::<CANsync_MA_CTRL_BMSTRUCT>(base).unwrap();
        for slave in 0..32 {
            let area = Area::of(&regs, slave).unwrap();
            let of = |name: &str| NODES.register(name).unwrap().offset() - base;
            let job = of(&format!("node2.a_CTRLREG_PAR_CMD_SL[{slave}].b_STEUREG_PAR_CMD"));
            let data = of(&format!("node2.a_DATA_PARAMETER[{slave}].d_PAR_VALUE"));
            assert_eq!((area.job.offset as u32, area.data_offset as u32), (job, data), "slave {slave}");
        }
        assert!(Area::of(&regs, 32).is_none());
    }
}
