//! Parameter numbers of the process data, and the check that the drive can exchange these parameters.

use crate::devices::cansync::drive::BuiltInDrive;
use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::baps_quit;
use serde::{Deserialize, Serialize};

/// Parameter numbers of up to eight reference values and eight actual values. A number of 0 means that there
/// is no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Numbers {
    pub writes: [u16; 8],
    pub reads: [u16; 8],
}

impl Numbers {
    pub(crate) fn of(regs: &BAPS_CTRL_BMSTRUCT) -> Self {
        let load = |x: usize| (regs.a_WR_PAR_NR[x].load(), regs.a_RD_PAR_NR[x].load());
        Numbers { writes: core::array::from_fn(|x| load(x).0), reads: core::array::from_fn(|x| load(x).1) }
    }

    /// Returns these numbers, but with reference values 0 and 1 and actual values 0 to 3 of `others`. A
    /// re-initialization replaces only these six (manual 5.00005.03a p. 90).
    pub(crate) fn re_initialized(mut self, others: &Numbers) -> Self {
        self.writes[..2].copy_from_slice(&others.writes[..2]);
        self.reads[..4].copy_from_slice(&others.reads[..4]);
        self
    }

    /// Checks whether the drive can exchange the parameters with these numbers.
    ///
    /// # Errors
    /// Returns the acknowledgement. If both kinds of errors occur, the error of a reference value that cannot
    /// be written has priority over the error of an actual value that cannot be read (manual 5.00005.03a p.
    /// 111 states this rule for the re-initialization).
    pub(crate) fn check(&self, drive: &BuiltInDrive) -> Result<(), u8> {
        let regler = drive.regler();
        if self.writes.iter().any(|&number| number != 0 && !regler.is_writable(number)) {
            return Err(baps_quit::UNWRITABLE);
        }
        if self.reads.iter().any(|&number| number != 0 && !regler.is_readable(number)) {
            return Err(baps_quit::UNREADABLE);
        }
        Ok(())
    }
}
