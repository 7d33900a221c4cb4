//! Service data: parameter jobs, one after the other. Two semaphores coordinate them (manual 5.00005.03a p.
//! 93-98, 118-120).
//!
//! | master | slave | |
//! |---|---|---|
//! | 0 | 0 | idle; the PLC may enter a job |
//! | 1 | 0 | the drive executes the job |
//! | 1 | 1 | the PLC may read the result |
//! | 0 | 1 | the PLC has read it; the drive goes back to idle |

use super::findings::find_wrong_pwm;
use crate::devices::Context;
use crate::devices::cansync::drive::{BuiltInDrive, ParamFormat, number};
use crate::devices::emulation::recorded_register::RecordedRegister;
use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::{
    baps_format, baps_job, baps_result, baps_semaphore,
};
use crate::snapshot_fields;
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// A job that the PLC has entered.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Job {
    code: u8,
    number: u16,
    element: u8,
    count: u8,
    format: ParamFormat,
    value: u32,
}

impl Job {
    fn of(regs: &BAPS_CTRL_BMSTRUCT) -> Self {
        Job {
            code: regs.b_JOB.load(),
            number: regs.u_PAR_NR.load(),
            element: regs.us_PAR_ELEMENT.load(),
            count: regs.us_NUMBER.load(),
            // Any value except that of a word means a doubleword, because every value except 0 of a BOOL is
            // TRUE.
            format: match regs.b_PAR_FORMAT.load() {
                baps_format::WORD => ParamFormat::Word,
                _ => ParamFormat::Doubleword,
            },
            value: regs.ud_PAR_VALUE.load(),
        }
    }
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
enum Phase {
    #[default]
    Idle,
    /// The drive works on the job until this time.
    Working(Job, u64),
    /// The result is in the registers.
    Answered,
}

/// The service data of a BAPS.
pub(super) struct Service {
    phase: Phase,
    time_us: u64,
}

snapshot_fields!(Service { values: phase; built: time_us });

impl Service {
    /// Creates the service data. A job takes `time_us` of emulated time.
    pub(crate) fn new(time_us: u64) -> Self {
        Service { phase: Phase::default(), time_us }
    }

    /// Called when the board restarts. A job in progress is dropped.
    pub(crate) fn reset(&mut self) {
        self.phase = Phase::Idle;
    }

    pub(crate) fn is_idle(&self) -> bool {
        matches!(self.phase, Phase::Idle)
    }

    /// True if there is a step to take at `now`.
    pub(crate) fn has_work(&self, now: u64, regs: &BAPS_CTRL_BMSTRUCT) -> bool {
        match (self.phase, regs.b_MA_SEMAPHORE.load()) {
            (Phase::Idle, baps_semaphore::JOB)
            | (Phase::Working(..) | Phase::Answered, baps_semaphore::IDLE) => true,
            (Phase::Working(_, due), _) => now >= due,
            (Phase::Idle | Phase::Answered, _) => false,
        }
    }

    /// Polls the semaphores once, as the drive does.
    pub(crate) fn slice(&mut self, ctx: &mut Context, regs: &BAPS_CTRL_BMSTRUCT, drive: &mut BuiltInDrive) {
        let master = regs.b_MA_SEMAPHORE.load();
        match self.phase {
            Phase::Idle if master == baps_semaphore::JOB => {
                self.phase = Phase::Working(Job::of(regs), ctx.now + self.time_us);
                self.work(ctx, regs, drive);
            }
            // The PLC has withdrawn the job, so the job is not executed (decision D-159).
            Phase::Working(..) if master == baps_semaphore::IDLE => self.phase = Phase::Idle,
            Phase::Working(..) => self.work(ctx, regs, drive),
            Phase::Answered if master == baps_semaphore::IDLE => {
                show_semaphore(ctx, regs, baps_semaphore::IDLE);
                self.phase = Phase::Idle;
            }
            Phase::Idle | Phase::Answered => {}
        }
    }

    fn work(&mut self, ctx: &mut Context, regs: &BAPS_CTRL_BMSTRUCT, drive: &mut BuiltInDrive) {
        let Phase::Working(job, due) = self.phase else { return };
        if ctx.now < due {
            return;
        }
        let result = carry_out(&job, regs, drive);
        let detail = result.err().unwrap_or(baps_result::NO_ERROR);
        if job.code == baps_job::WRITE && job.number == number::PWM_FREQUENCY {
            find_wrong_pwm(ctx, drive);
        }
        regs.i_ERR_DETAIL.show(ctx, offset_of!(BAPS_CTRL_BMSTRUCT, i_ERR_DETAIL), detail);
        show_semaphore(ctx, regs, baps_semaphore::JOB);
        self.phase = Phase::Answered;
    }
}

fn show_semaphore(ctx: &mut Context, regs: &BAPS_CTRL_BMSTRUCT, value: u8) {
    regs.b_SL_SEMAPHORE.show(ctx, offset_of!(BAPS_CTRL_BMSTRUCT, b_SL_SEMAPHORE), value);
}

/// Executes the job. The error is the value of `i_ERR_DETAIL`.
fn carry_out(job: &Job, regs: &BAPS_CTRL_BMSTRUCT, drive: &mut BuiltInDrive) -> Result<(), u16> {
    match job.code {
        baps_job::READ => {
            let (format, value) = drive.regler().read_element(job.number, job.element)?;
            regs.ud_PAR_VALUE.store(value);
            regs.b_PAR_FORMAT.store(match format {
                ParamFormat::Word => baps_format::WORD,
                ParamFormat::Doubleword => baps_format::DOUBLEWORD,
            });
            Ok(())
        }
        baps_job::WRITE if job.count != 1 => Err(baps_result::WRONG_COUNT),
        baps_job::WRITE => {
            let regler = drive.regler_mut();
            regler.write_element(job.number, job.element, job.format, job.value & job.format.mask())
        }
        _ => Err(baps_result::GENERAL),
    }
}
