//! `CANsync_PD_COMM_MA`: process data of a master (p. 247-251).

use super::CANsync_RD_BMARRAY;
use super::comm_control::set_highest_slave;
use super::process_data::{receive_from_all, send, take_last_slave};
use super::registers::{AUTOMATIC, slave_index};
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::request;
use crate::memory::Cell8;
use crate::plc::{Base, Like, function_block};

/// Input of the slave numbers: no request.
const NO_REQUEST: i8 = -1;

function_block! {
    /// Writes reference values and requests actual values of slaves (manual p. 247-251). Call this block
    /// first in the CANsync event task.
    pub struct CANsync_PD_COMM_MA(_BASE: Base<CANsync_MA_CTRL_BMSTRUCT>) {
        in {
            /// Reference values 0 to 7.
            a_WR_VALUES_SEND: [i32; 8];
            /// 5: reference values 0 to 3 are valid, send frame 1.
            si_WRC1_SEND: i8;
            /// 5: reference values 4 to 7 are valid, send frame 2.
            si_WRC2_SEND: i8;
            /// Slave that is requested for frame 1; -128 (default): all slaves in turn; -1: none (decision
            /// D-208).
            si_RD_SL_NR1_RECEIVE: i8 = AUTOMATIC;
            /// Slave that is requested for frame 2; -128 (default): all slaves in turn; -1: none.
            si_RD_SL_NR2_RECEIVE: i8 = AUTOMATIC;
            /// Highest slave number of the automatic polling; -1 (default): unchanged.
            si_MAX_SL_NR: i8 = -1;
            /// Copies received actual values to `a_RD_ARRAY`; default: FALSE.
            x_COPY_TO_RD_ARRAY: bool;
        }
        out {
            /// Slave that has sent the most recent frame 1 since the previous call; -128: no slave.
            si_RD_SL_NR1_RECEIVED: i8 = AUTOMATIC;
            /// Slave that has sent the most recent frame 2 since the previous call; -128: no slave.
            si_RD_SL_NR2_RECEIVED: i8 = AUTOMATIC;
        }
        in_out {
            a_RD_ARRAY: CANsync_RD_BMARRAY;
        }
    }
}

impl CANsync_PD_COMM_MA {
    /// Runs one PLC cycle. Writes `a_RD_ARRAY` only if `x_COPY_TO_RD_ARRAY` is TRUE.
    pub fn call(
        &mut self,
        _BASE: &Base<impl Like<CANsync_MA_CTRL_BMSTRUCT>>,
        a_RD_ARRAY: &mut CANsync_RD_BMARRAY,
    ) {
        let _BASE = &_BASE.viewed();
        set_highest_slave(&_BASE.b_MAX_SL_NR, self.si_MAX_SL_NR);
        ask(&_BASE.b_CTRLREG_RD_ORDER_RDC1, self.si_RD_SL_NR1_RECEIVE);
        ask(&_BASE.b_CTRLREG_RD_ORDER_RDC2, self.si_RD_SL_NR2_RECEIVE);
        let inputs = [self.si_WRC1_SEND, self.si_WRC2_SEND];
        let controls = [&_BASE.b_CTRLREG_WRC1, &_BASE.b_CTRLREG_WRC2];
        send(&self.a_WR_VALUES_SEND, inputs, &_BASE.a_WR_VALUE, controls);
        self.si_RD_SL_NR1_RECEIVED = take_last_slave(&_BASE.b_STATREG_RDC1);
        self.si_RD_SL_NR2_RECEIVED = take_last_slave(&_BASE.b_STATREG_RDC2);
        if self.x_COPY_TO_RD_ARRAY {
            receive_from_all(&_BASE.a_STATREG_RDC, &_BASE.a_RD_BMARRAY, a_RD_ARRAY);
        }
    }
}

/// Writes the input to the register if it is a documented slave number. Otherwise the register does not
/// change.
fn ask(register: &Cell8, slave: i8) {
    match slave {
        NO_REQUEST => register.store(request::NO_SLAVE),
        AUTOMATIC => register.store(request::AUTOMATIC),
        number if slave_index(number).is_some() => register.store(number as u8),
        _ => {}
    }
}
