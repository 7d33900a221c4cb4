//! Parameter jobs as a slave node's application sees them (manual 5.00005.03a p. 189-191).
//!
//! The job is entered in the registers and stays there until the application has cleared bit 0; until
//! then every repetition by the master is answered BUSY. The answer goes out in the response slot, then
//! bit 6 is cleared. Two-register rule: status register first, then the control register.

use crate::bus::codec::parameter::{Access, ParameterJob, ParameterResponse, ParameterResult};
use crate::layout::omega_drive_line_2::CANsync_SL_CTRL_BMSTRUCT;

/// Bits of `b_STEUREG_PAR_CMD` and `b_STATREG_PAR_CMD`. The manual's texts for bits 1 and 2 are swapped;
/// its values 16#43, 16#45 and 16#55 show which is which.
mod bits {
    pub const ACTIVE: u8 = 1 << 0;
    pub const READ: u8 = 1 << 1;
    pub const WRITE: u8 = 1 << 2;
    pub const CHANGE: u8 = 1 << 3;
    pub const DOUBLE_WORD: u8 = 1 << 4;
    pub const ERROR: u8 = 1 << 5;
    pub const BUSY: u8 = 1 << 6;
    pub const RESET: u8 = 1 << 7;
}

/// The answer that is due in the next response slot.
#[derive(Clone, Copy, Debug)]
enum Due {
    /// The firmware's own answer.
    Firmware(ParameterResponse),
    /// Whatever the application has come to by then.
    Application,
}

/// A slave node's side of parameter jobs.
#[derive(Debug, Default)]
pub(super) struct ParameterServer {
    /// Job in the registers.
    entered: Option<ParameterJob>,
    /// Job that the master has changed to; entered once the application confirms with bit 7.
    changed: Option<ParameterJob>,
    due: Option<Due>,
    /// The answer now on the wire ends the job in the registers.
    final_answer: bool,
}

impl ParameterServer {
    /// Drops everything, as at restart.
    pub(super) fn forget(&mut self) {
        *self = ParameterServer::default();
    }

    /// An answer of the firmware itself.
    pub(super) fn answer_with(&mut self, response: ParameterResponse) {
        self.due = Some(Due::Firmware(response));
    }

    /// A job of the master for the application.
    pub(super) fn job(&mut self, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &ParameterJob) {
        self.due = Some(Due::Application);
        match self.entered {
            Some(entered) if entered == *job => self.changed = None,
            // The application is at work on another job: it must see the change and confirm it.
            Some(_) if regs.b_STEUREG_PAR_CMD.load() & bits::ACTIVE != 0 => {
                self.changed = Some(*job);
                write_both(regs, |value| value | bits::CHANGE);
            }
            _ => self.enter(regs, *job),
        }
    }

    fn enter(&mut self, regs: &CANsync_SL_CTRL_BMSTRUCT, job: ParameterJob) {
        let command = match job.access() {
            Access::Read => bits::READ,
            Access::WriteWord(value) => {
                regs.d_DATA_PAR_CMD.store(u32::from(value));
                bits::WRITE
            }
            Access::WriteDoubleword(value) => {
                regs.d_DATA_PAR_CMD.store(value);
                bits::WRITE | bits::DOUBLE_WORD
            }
        };
        regs.w_PAR_NR.store(job.number());
        regs.w_ERR_NR_PAR_CMD.store(0);
        let command = command | bits::ACTIVE | bits::BUSY;
        regs.b_STATREG_PAR_CMD.store(command);
        regs.b_STEUREG_PAR_CMD.store(command);
        self.entered = Some(job);
        self.changed = None;
    }

    /// Start of the response slot: the answer as things stand now.
    pub(super) fn response(&mut self, regs: &CANsync_SL_CTRL_BMSTRUCT) -> Option<ParameterResponse> {
        self.final_answer = false;
        if let Due::Firmware(response) = self.due.take()? {
            return Some(response);
        }
        let control = regs.b_STEUREG_PAR_CMD.load();
        if let Some(job) = self.changed {
            if control & bits::RESET != 0 {
                self.enter(regs, job);
            }
            return Some(job.answer(ParameterResult::Busy));
        }
        let job = self.entered?;
        if control & bits::ACTIVE != 0 {
            return Some(job.answer(ParameterResult::Busy));
        }
        self.final_answer = true;
        let result = if control & bits::ERROR != 0 {
            ParameterResult::Error(regs.w_ERR_NR_PAR_CMD.load())
        } else {
            match job.access() {
                Access::Read if control & bits::DOUBLE_WORD != 0 => {
                    ParameterResult::Doubleword(regs.d_DATA_PAR_CMD.load())
                }
                Access::Read => ParameterResult::Word(regs.d_DATA_PAR_CMD.load() as u16),
                Access::WriteWord(_) | Access::WriteDoubleword(_) => ParameterResult::Done,
            }
        };
        Some(job.answer(result))
    }

    /// The answer has left the bus: the job is over if it was the final one.
    pub(super) fn response_sent(&mut self, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        if self.final_answer {
            self.final_answer = false;
            self.entered = None;
            write_both(regs, |value| value & !bits::BUSY);
        }
    }
}

/// Changes status and control register, in this order, without losing a concurrent write.
fn write_both(regs: &CANsync_SL_CTRL_BMSTRUCT, change: impl Fn(u8) -> u8) {
    regs.b_STATREG_PAR_CMD.update(&change);
    regs.b_STEUREG_PAR_CMD.update(&change);
}
