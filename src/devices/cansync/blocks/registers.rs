//! Values and bits of control and status registers that several function blocks use, and how a PLC
//! writes the register pair of a job (manual 5.00005.03a chapters 7.2.2, 7.2.3).

use crate::devices::cansync::registers::{
    CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT,
};
use crate::memory::Cell8;

/// A structure is like itself.
macro_rules! like_itself {
    ($($structure:ident)*) => {$(
        impl AsRef<$structure> for $structure {
            fn as_ref(&self) -> &Self {
                self
            }
        }
    )*};
}

like_itself!(CANsync_INIT_BMSTRUCT CANsync_MA_CTRL_BMSTRUCT CANsync_SL_CTRL_BMSTRUCT);

/// Number of slaves on a bus.
pub(super) const SLAVES: usize = 32;
/// In a send register and at a `..._SEND` input: the data are valid, send them (p. 153, 162).
pub(super) const SEND: u8 = 0x05;
/// In a send register: sent.
pub(super) const SENT: u8 = 0x04;
/// In a receive register and at a `..._RECEIVED` output: received (p. 155, 176).
pub(super) const RECEIVED: u8 = 0x02;
/// Written into a register that holds the number of the slave heard last, so that the next one is seen
/// (p. 155).
pub(super) const NOBODY: u8 = 0xFF;
/// Slave number inputs: the number goes up by itself. Outputs: no slave.
pub(super) const AUTOMATIC: i8 = -128;

/// Bit 0 of a job register: the job is under way.
pub(super) const ACTIVE: u8 = 1 << 0;
/// Bit 5: the job has failed.
pub(super) const ERROR: u8 = 1 << 5;
/// Bit 6: the answer is not there yet, or has not been sent yet.
pub(super) const BUSY: u8 = 1 << 6;
/// Bit 7: the master cancels, the slave confirms a change.
pub(super) const RESET: u8 = 1 << 7;

/// A slave number as an index; `None` if it is not 0 to 31.
pub(super) fn slave_index(number: i8) -> Option<usize> {
    usize::try_from(number).ok().filter(|&index| index < SLAVES)
}

/// Empties a receive register; 2 if something was received, otherwise 0. It is emptied before the data
/// are read, so that what arrives meanwhile is seen at the next call.
pub(super) fn take_received(register: &Cell8) -> i8 {
    match register.compare_exchange(RECEIVED, 0) {
        Ok(received) => received as i8,
        Err(_) => 0,
    }
}

/// Control and status register of a job.
pub(super) struct Job<'a> {
    pub(super) control: &'a Cell8,
    pub(super) status: &'a Cell8,
}

impl Job<'_> {
    /// The control register, the one that decides.
    pub(super) fn control(&self) -> u8 {
        self.control.load()
    }

    /// Writes both, the control register last (p. 165).
    pub(super) fn enter(&self, value: u8) {
        self.status.store(value);
        self.control.store(value);
    }

    /// Changes bits of both and leaves alone what the firmware writes at the same time.
    pub(super) fn change(&self, change: impl Fn(u8) -> u8) {
        self.status.update(&change);
        self.control.update(&change);
    }
}
