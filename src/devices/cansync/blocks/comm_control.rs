//! `CANsync_COMM_CONTROL_MA`: assignment of the command channel (p. 204-206).

use super::registers::{AUTOMATIC, slave_index};
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::memory::Cell8;
use crate::plc::{Base, Like, function_block};

function_block! {
    /// Selects the slave for control words, parameter jobs and up-/downloads in the command channel (manual p.
    /// 204-206).
    ///
    /// The block takes over a slave number only if the enable input of this number is TRUE. Numbers other
    /// than -128 and 0 to 31 have no effect (decision D-205).
    pub struct CANsync_COMM_CONTROL_MA(_BASE: Base<CANsync_MA_CTRL_BMSTRUCT>) {
        in {
            /// Slave for control words; -128 (default): all slaves in turn.
            si_SL_NR_CTRL: i8 = AUTOMATIC;
            /// Take over `si_SL_NR_CTRL`.
            x_EN_CTRL: bool;
            /// Slave for parameter jobs; -128 (default): all slaves in turn.
            si_SL_NR_PAR: i8 = AUTOMATIC;
            /// Take over `si_SL_NR_PAR`.
            x_EN_PAR: bool;
            /// Slave for up-/downloads; -128 (default): all slaves in turn.
            si_SL_NR_UDL: i8 = AUTOMATIC;
            /// Take over `si_SL_NR_UDL`.
            x_EN_UDL: bool;
            /// Highest slave number that is selected in turn; -1 (default): unchanged. `si_MAX_SL_NR` of
            /// [`CANsync_PD_COMM_MA`](super::CANsync_PD_COMM_MA) sets the same register, so use only one of
            /// these inputs.
            si_MAX_SL_NR: i8 = -1;
        }
    }
}

impl CANsync_COMM_CONTROL_MA {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_MA_CTRL_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        set_highest_slave(&_BASE.b_MAX_SL_NR, self.si_MAX_SL_NR);
        for (enable, number, register) in [
            (self.x_EN_CTRL, self.si_SL_NR_CTRL, &_BASE.b_SL_NR_CONTROLWORD),
            (self.x_EN_PAR, self.si_SL_NR_PAR, &_BASE.b_SL_NR_PARAMETER),
            (self.x_EN_UDL, self.si_SL_NR_UDL, &_BASE.b_SL_NR_UPDOWN),
        ] {
            if enable && (number == AUTOMATIC || slave_index(number).is_some()) {
                register.store(number as u8);
            }
        }
    }
}

/// Handles input `si_MAX_SL_NR`: 0 to 31 are written to the register; any other value leaves the register
/// unchanged.
pub(super) fn set_highest_slave(register: &Cell8, number: i8) {
    if slave_index(number).is_some() {
        register.store(number as u8);
    }
}
