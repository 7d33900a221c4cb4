//! `CANsync_CONTROLWORD_MA`, `CANsync_CONTROLWORD_SL`: control words (p. 207-210).

use super::registers::{ControlWordReader, slave_index};
use crate::devices::cansync::registers::values::send;
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT};
use crate::plc::{Base, Like, function_block};

function_block! {
    /// Sends a control word to one slave (manual p. 207-208). A program must call
    /// [`CANsync_COMM_CONTROL_MA`](super::CANsync_COMM_CONTROL_MA) before this block.
    ///
    /// Every call with `x_EN` enters the control word again. To send it once, set `x_EN` for one interval
    /// only.
    pub struct CANsync_CONTROLWORD_MA(_BASE: Base<CANsync_MA_CTRL_BMSTRUCT>) {
        in {
            /// Number of the slave, 0 to 31.
            si_SL_NR_CTRL: i8;
            /// Control word for the slave.
            w_CONTROLWORD: u16;
            /// Enters the control word.
            x_EN: bool;
        }
        out {
            /// The last control word entered for this slave has been sent.
            x_OK: bool;
        }
    }
}

impl CANsync_CONTROLWORD_MA {
    /// Runs one PLC cycle. A slave number that does not exist has no effect.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_MA_CTRL_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        self.x_OK = false;
        let Some(slave) = slave_index(self.si_SL_NR_CTRL) else { return };
        let (Some(control), Some(word)) =
            (_BASE.a_STEUREG_CONTROLWORD.get(slave), _BASE.a_CONTROLWORD_SL.get(slave))
        else {
            return;
        };
        self.x_OK = control.load() == send::SENT;
        if self.x_EN {
            word.store(self.w_CONTROLWORD);
            control.store(send::RELEASED);
        }
    }
}

function_block! {
    /// Receives the master's control word (manual p. 209-210).
    pub struct CANsync_CONTROLWORD_SL(_BASE: Base<CANsync_SL_CTRL_BMSTRUCT>) {
        out {
            /// Control word. The value stays until a new control word is received.
            w_CONTROLWORD: u16;
            /// 2: a control word was received since the last call; otherwise 0.
            si_RECEIVED: i8;
        }
    }
}

impl CANsync_CONTROLWORD_SL {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_SL_CTRL_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        self.si_RECEIVED = ControlWordReader::ControlWord.take(&_BASE.b_STATREG_CONTROLWORD);
        if self.si_RECEIVED != 0 {
            self.w_CONTROLWORD = _BASE.w_CONTROLWORD.load();
        }
    }
}
