//! `BAPS_PAR_READ`, `BAPS_PAR_WRITE`: parameter jobs to the PLC's own drive (p. 93-98).

use super::service_data::{BAPS_BMSTRUCT, Client, Job, JobKind};
use crate::devices::cansync::registers::values::par_element;
use crate::devices::omega_drive_line_2::registers::values::baps_result;
use crate::plc::{Shared, function_block};

function_block! {
    /// Reads a parameter of the drive through [`BAPS_SD_CONTROL`](super::BAPS_SD_CONTROL) (manual p. 93-95).
    pub struct BAPS_PAR_READ(_BAPS_SD_DATA: Shared<BAPS_BMSTRUCT>) {
        in {
            /// Number of the parameter in the drive.
            u_PAR_NR: u16;
            /// Element of the parameter; preset 7, its value.
            us_PAR_ELEMENT: u8 = par_element::VALUE;
            /// Starts the job. The input must stay TRUE until `x_BUSY` becomes FALSE. If it becomes FALSE
            /// earlier, the job is cancelled, and this block and `BAPS_SD_CONTROL` need `x_RESET`.
            x_EN: bool;
            /// TRUE resets the block.
            x_RESET: bool;
        }
        out {
            /// Value of the parameter that was read.
            ud_PAR_VALUE: u32;
            /// Format of the value read: FALSE word, TRUE doubleword.
            x_PAR_FORMAT: bool;
            /// The job is in progress.
            x_BUSY: bool;
            /// Error of the drive, 0 to -8.
            i_ERR_DETAIL: i16;
            /// 0, or -1: communication error.
            i_ERR_COMM: i16;
            /// The last job has failed.
            x_ERR: bool;
            /// The last job has been done.
            x_OK: bool;
        }
        internal: Client;
    }
}

impl BAPS_PAR_READ {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BAPS_SD_DATA: &mut BAPS_BMSTRUCT) {
        let (number, element) = (self.u_PAR_NR, self.us_PAR_ELEMENT);
        let job = |ticket| Job { ticket, kind: JobKind::Read, number, element, doubleword: false, value: 0 };
        let outcome = self.internal.step(_BAPS_SD_DATA, [self.x_EN, self.x_RESET], job);
        let Some((busy, answered)) = outcome.shown() else { return };
        let answer = answered.unwrap_or_default();
        (self.i_ERR_DETAIL, self.i_ERR_COMM) = (answer.detail.cast_signed(), answer.communication);
        self.x_BUSY = busy;
        self.x_OK = answered.is_some() && answer.detail == baps_result::NO_ERROR && answer.communication == 0;
        self.x_ERR = answered.is_some() && !self.x_OK;
        if self.x_OK {
            (self.ud_PAR_VALUE, self.x_PAR_FORMAT) = (answer.value, answer.doubleword);
        }
    }
}

function_block! {
    /// Writes a parameter of the drive through [`BAPS_SD_CONTROL`](super::BAPS_SD_CONTROL) (manual p. 96-98).
    pub struct BAPS_PAR_WRITE(_BAPS_SD_DATA: Shared<BAPS_BMSTRUCT>) {
        in {
            /// Number of the parameter in the drive.
            u_PAR_NR: u16;
            /// Format of the parameter: FALSE word, TRUE doubleword.
            x_PAR_FORMAT: bool;
            /// The value to write.
            ud_PAR_VALUE: u32;
            /// TRUE (default): a wrong format is an error. FALSE: only `i_ERR_DETAIL` shows a wrong format,
            /// and `x_OK` is TRUE.
            x_EN_ERR_FORMAT: bool = true;
            /// Starts the job. The input must stay TRUE until `x_BUSY` becomes FALSE. If it becomes FALSE
            /// earlier, the job is cancelled, and this block and `BAPS_SD_CONTROL` need `x_RESET`.
            x_EN: bool;
            /// TRUE resets the block.
            x_RESET: bool;
        }
        out {
            /// The job is in progress.
            x_BUSY: bool;
            /// Error of the drive, 0 to -8.
            i_ERR_DETAIL: i16;
            /// 0, or -1: communication error.
            i_ERR_COMM: i16;
            /// The last job has failed.
            x_ERR: bool;
            /// The last job has been done.
            x_OK: bool;
        }
        internal: Client;
    }
}

impl BAPS_PAR_WRITE {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BAPS_SD_DATA: &mut BAPS_BMSTRUCT) {
        let (number, doubleword, value) = (self.u_PAR_NR, self.x_PAR_FORMAT, self.ud_PAR_VALUE);
        let job = |ticket| Job {
            ticket,
            kind: JobKind::Write,
            number,
            element: par_element::VALUE,
            doubleword,
            value,
        };
        let outcome = self.internal.step(_BAPS_SD_DATA, [self.x_EN, self.x_RESET], job);
        let Some((busy, answered)) = outcome.shown() else { return };
        let answer = answered.unwrap_or_default();
        (self.i_ERR_DETAIL, self.i_ERR_COMM) = (answer.detail.cast_signed(), answer.communication);
        self.x_BUSY = busy;
        let passed = match answer.detail {
            baps_result::WRONG_FORMAT => !self.x_EN_ERR_FORMAT,
            detail => detail == baps_result::NO_ERROR,
        };
        self.x_OK = answered.is_some() && passed && answer.communication == 0;
        self.x_ERR = answered.is_some() && !self.x_OK;
    }
}
