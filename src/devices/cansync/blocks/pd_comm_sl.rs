//! `CANsync_PD_COMM_SL`: process data of a slave (p. 256-260).

use super::CANsync_RD_BMARRAY;
use super::process_data::{receive, receive_from_all, send, take_last_slave};
use super::registers::AUTOMATIC;
use crate::devices::omega_drive_line_2::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::plc::{Base, Like, function_block};

function_block! {
    /// Hands over own actual values, reads reference values and overhears other slaves' actual values
    /// (manual p. 256-260). Call it right at the start of the CANsync event task.
    pub struct CANsync_PD_COMM_SL(_BASE: Base<CANsync_SL_CTRL_BMSTRUCT>) {
        in {
            /// Own actual values 0 to 7.
            a_RD_VALUES_SEND: [i32; 8];
            /// 5: own actual values 0 to 3 are valid, send frame 1 when the master asks for it.
            si_RDC1_SEND: i8;
            /// 5: own actual values 4 to 7 are valid, send frame 2 when the master asks for it.
            si_RDC2_SEND: i8;
            /// Copies overheard actual values to `a_RD_ARRAY`; default: FALSE.
            x_COPY_TO_RD_ARRAY: bool;
        }
        out {
            /// Reference values 0 to 7, each half only after its frame was received.
            a_WR_VALUES_RECEIVED: [i32; 8];
            /// 2: reference value frame 1 was received since the last call; otherwise 0.
            si_WRC1_RECEIVED: i8;
            /// 2: reference value frame 2 was received since the last call; otherwise 0.
            si_WRC2_RECEIVED: i8;
            /// Slave whose frame 1 was overheard last since the last call; -128: none.
            si_RD_SL_NR1_RECEIVED: i8 = AUTOMATIC;
            /// Slave whose frame 2 was overheard last since the last call; -128: none.
            si_RD_SL_NR2_RECEIVED: i8 = AUTOMATIC;
        }
        in_out {
            a_RD_ARRAY: CANsync_RD_BMARRAY;
        }
    }
}

impl CANsync_PD_COMM_SL {
    /// One PLC cycle. `a_RD_ARRAY` is written with `x_COPY_TO_RD_ARRAY` only.
    pub fn call(
        &mut self,
        _BASE: &Base<impl Like<CANsync_SL_CTRL_BMSTRUCT>>,
        a_RD_ARRAY: &mut CANsync_RD_BMARRAY,
    ) {
        let _BASE = &_BASE.viewed();
        let inputs = [self.si_RDC1_SEND, self.si_RDC2_SEND];
        let controls = [&_BASE.b_CTRLREG_RD_RDC1, &_BASE.b_CTRLREG_RD_RDC2];
        send(&self.a_RD_VALUES_SEND, inputs, &_BASE.a_RD_VALUE_SEND, controls);
        let states = [&_BASE.b_CTRLREG_WRC1, &_BASE.b_CTRLREG_WRC2];
        [self.si_WRC1_RECEIVED, self.si_WRC2_RECEIVED] =
            receive(states, &_BASE.a_WR_VALUE_RECEIVE, &mut self.a_WR_VALUES_RECEIVED);
        self.si_RD_SL_NR1_RECEIVED = take_last_slave(&_BASE.b_STATREG_RDC1);
        self.si_RD_SL_NR2_RECEIVED = take_last_slave(&_BASE.b_STATREG_RDC2);
        if self.x_COPY_TO_RD_ARRAY {
            receive_from_all(&_BASE.a_STATREG_RDC, &_BASE.a_RD_BMARRAY, a_RD_ARRAY);
        }
    }
}
