//! `BAPS_PAR_READ`, `BAPS_PAR_WRITE`: parameter jobs to the own drive (p. 93-98).

use super::service_data::{BAPS_BMSTRUCT, Client, Job, Kind};

/// Element "value of the parameter".
const VALUE: u8 = 7;
/// `i_ERR_DETAIL`: wrong data format.
const WRONG_FORMAT: i16 = -7;

/// Reads a parameter of the drive through [`BAPS_SD_CONTROL`](super::BAPS_SD_CONTROL) (manual p. 93-95).
#[derive(Clone, Debug)]
pub struct BAPS_PAR_READ {
    /// Parameter number.
    pub u_PAR_NR: u16,
    /// Element of the parameter; preset 7, its value.
    pub us_PAR_ELEMENT: u8,
    /// Starts the job; TRUE until `x_BUSY` falls. FALSE before: cancels, then this block and
    /// `BAPS_SD_CONTROL` need `x_RESET`.
    pub x_EN: bool,
    /// Resets the block.
    pub x_RESET: bool,
    /// The value read.
    pub ud_PAR_VALUE: u32,
    /// Its format: FALSE word, TRUE doubleword.
    pub x_PAR_FORMAT: bool,
    /// The job is under way.
    pub x_BUSY: bool,
    /// Error of the drive, 0 to -8.
    pub i_ERR_DETAIL: i16,
    /// 0, or -1: communication error.
    pub i_ERR_COMM: i16,
    /// The last job has failed.
    pub x_ERR: bool,
    /// The last job has been done.
    pub x_OK: bool,
    #[doc(hidden)]
    pub internal: Client,
}

impl Default for BAPS_PAR_READ {
    fn default() -> Self {
        BAPS_PAR_READ {
            u_PAR_NR: 0,
            us_PAR_ELEMENT: VALUE,
            x_EN: false,
            x_RESET: false,
            ud_PAR_VALUE: 0,
            x_PAR_FORMAT: false,
            x_BUSY: false,
            i_ERR_DETAIL: 0,
            i_ERR_COMM: 0,
            x_ERR: false,
            x_OK: false,
            internal: Client::default(),
        }
    }
}

impl BAPS_PAR_READ {
    /// One PLC cycle.
    pub fn call(&mut self, _BAPS_SD_DATA: &mut BAPS_BMSTRUCT) {
        let (number, element) = (self.u_PAR_NR, self.us_PAR_ELEMENT);
        let job = |ticket| Job { ticket, kind: Kind::Read, number, element, doubleword: false, value: 0 };
        let outcome = self.internal.step(_BAPS_SD_DATA, [self.x_EN, self.x_RESET], job);
        let Some((busy, answered)) = outcome.shown() else { return };
        let answer = answered.unwrap_or_default();
        (self.i_ERR_DETAIL, self.i_ERR_COMM) = (answer.detail, answer.communication);
        self.x_BUSY = busy;
        self.x_OK = answered.is_some() && answer.detail == 0 && answer.communication == 0;
        self.x_ERR = answered.is_some() && !self.x_OK;
        if self.x_OK {
            (self.ud_PAR_VALUE, self.x_PAR_FORMAT) = (answer.value, answer.doubleword);
        }
    }
}

/// Writes a parameter of the drive through [`BAPS_SD_CONTROL`](super::BAPS_SD_CONTROL) (manual p. 96-98).
#[derive(Clone, Debug)]
pub struct BAPS_PAR_WRITE {
    /// Parameter number.
    pub u_PAR_NR: u16,
    /// Format of the parameter: FALSE word, TRUE doubleword.
    pub x_PAR_FORMAT: bool,
    /// The value to write.
    pub ud_PAR_VALUE: u32,
    /// TRUE (default): a wrong format is an error; FALSE: it is shown in `i_ERR_DETAIL` only, with `x_OK`.
    pub x_EN_ERR_FORMAT: bool,
    /// Starts the job; TRUE until `x_BUSY` falls. FALSE before: cancels, then this block and
    /// `BAPS_SD_CONTROL` need `x_RESET`.
    pub x_EN: bool,
    /// Resets the block.
    pub x_RESET: bool,
    /// The job is under way.
    pub x_BUSY: bool,
    /// Error of the drive, 0 to -8.
    pub i_ERR_DETAIL: i16,
    /// 0, or -1: communication error.
    pub i_ERR_COMM: i16,
    /// The last job has failed.
    pub x_ERR: bool,
    /// The last job has been done.
    pub x_OK: bool,
    #[doc(hidden)]
    pub internal: Client,
}

impl Default for BAPS_PAR_WRITE {
    fn default() -> Self {
        BAPS_PAR_WRITE {
            u_PAR_NR: 0,
            x_PAR_FORMAT: false,
            ud_PAR_VALUE: 0,
            x_EN_ERR_FORMAT: true,
            x_EN: false,
            x_RESET: false,
            x_BUSY: false,
            i_ERR_DETAIL: 0,
            i_ERR_COMM: 0,
            x_ERR: false,
            x_OK: false,
            internal: Client::default(),
        }
    }
}

impl BAPS_PAR_WRITE {
    /// One PLC cycle.
    pub fn call(&mut self, _BAPS_SD_DATA: &mut BAPS_BMSTRUCT) {
        let (number, doubleword, value) = (self.u_PAR_NR, self.x_PAR_FORMAT, self.ud_PAR_VALUE);
        let job = |ticket| Job { ticket, kind: Kind::Write, number, element: VALUE, doubleword, value };
        let outcome = self.internal.step(_BAPS_SD_DATA, [self.x_EN, self.x_RESET], job);
        let Some((busy, answered)) = outcome.shown() else { return };
        let answer = answered.unwrap_or_default();
        (self.i_ERR_DETAIL, self.i_ERR_COMM) = (answer.detail, answer.communication);
        self.x_BUSY = busy;
        let passed = match answer.detail {
            WRONG_FORMAT => !self.x_EN_ERR_FORMAT,
            detail => detail == 0,
        };
        self.x_OK = answered.is_some() && passed && answer.communication == 0;
        self.x_ERR = answered.is_some() && !self.x_OK;
    }
}
