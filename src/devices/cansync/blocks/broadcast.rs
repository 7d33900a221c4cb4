//! `CANsync_BC_MA0`, `_MA1`, `_MA2`, `CANsync_BC_SL`: broadcast commands (p. 196-203).

use super::registers::{ControlWordReader, take_received};
use crate::devices::cansync::registers::values::{action_command, send};
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT};
use crate::plc::{Base, Like, function_block};

macro_rules! sender {
    ($name:ident, $rank:literal, $page:literal,
     $control:ident, $mask:ident, $command:ident, $byte:ident, $word:ident) => {
        function_block! {
            #[doc = concat!("Sends a broadcast command with ", $rank, " priority (manual p. ", $page, ").")]
            ///
            /// Every call with `x_EN` enters the command again. To send the command once, set `x_EN` for one
            /// interval only.
            pub struct $name(_BASE: Base<CANsync_MA_CTRL_BMSTRUCT>) {
                in {
                    /// Command number: 1 control word, 128 to 255 free for the user.
                    us_BC_CMD_NR: u8;
                    /// Data byte of the broadcast command.
                    si_BC_BYTE: i8;
                    /// Data word of the broadcast command.
                    i_BC_WORD: i16;
                    /// Bit n: slave n shall receive the command.
                    d_SL_MASK: u32;
                    /// TRUE enters the broadcast command.
                    x_EN: bool;
                }
                out {
                    /// The last command entered has been sent.
                    x_OK: bool;
                }
            }
        }

        impl $name {
            /// Runs one PLC cycle.
            pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_MA_CTRL_BMSTRUCT>>) {
                let _BASE = &_BASE.viewed();
                self.x_OK = _BASE.$control.load() == send::SENT;
                if self.x_EN {
                    _BASE.$mask.store(self.d_SL_MASK);
                    _BASE.$command.store(self.us_BC_CMD_NR);
                    _BASE.$byte.store(self.si_BC_BYTE as u8);
                    _BASE.$word.store(self.i_BC_WORD as u16);
                    _BASE.$control.store(send::RELEASED);
                }
            }
        }
    };
}

sender!(
    CANsync_BC_MA0,
    "the highest",
    "196-197",
    b_CTRL_REG_BC0,
    d_SL_MASK_BC0,
    b_CMD_BC0,
    b_DATA_BYTE_BC0,
    w_DATA_WORD_BC0
);
sender!(
    CANsync_BC_MA1,
    "middle",
    "198-199",
    b_CTRL_REG_BC1,
    d_SL_MASK_BC1,
    b_CMD_BC1,
    b_DATA_BYTE_BC1,
    w_DATA_WORD_BC1
);
sender!(
    CANsync_BC_MA2,
    "low",
    "200-201",
    b_CTRL_REG_BC2,
    d_SL_MASK_BC2,
    b_CMD_BC2,
    b_DATA_BYTE_BC2,
    w_DATA_WORD_BC2
);

function_block! {
    /// Receives broadcast commands of the master (manual p. 202-203).
    ///
    /// Command 1 is a control word, which [`CANsync_CONTROLWORD_SL`](super::CANsync_CONTROLWORD_SL) shows as
    /// well (decision D-603). If another command has also arrived, the block shows this other command first.
    pub struct CANsync_BC_SL(_BASE: Base<CANsync_SL_CTRL_BMSTRUCT>) {
        out {
            /// Command number; keeps the previous value until a new command is received.
            us_BC_CMD_NR: u8;
            /// Data byte; keeps its value like `us_BC_CMD_NR`. 0 with command 1.
            si_BC_BYTE: i8;
            /// Data word; keeps its value like `us_BC_CMD_NR`. With command 1 it is the control word.
            i_BC_WORD: i16;
            /// 2: a command was received since the last call; otherwise 0.
            si_BC_RECEIVED: i8;
        }
    }
}

impl CANsync_BC_SL {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_SL_CTRL_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        self.si_BC_RECEIVED = take_received(&_BASE.b_STATREG_AKT_CMD);
        if self.si_BC_RECEIVED != 0 {
            self.us_BC_CMD_NR = _BASE.b_AKT_CMD.load();
            self.si_BC_BYTE = _BASE.b_DATA_BYTE_AKT_CMD.load() as i8;
            self.i_BC_WORD = _BASE.w_DATAWORD_AKT_CMD.load() as i16;
            return;
        }
        self.si_BC_RECEIVED = ControlWordReader::Broadcast.take(&_BASE.b_STATREG_CONTROLWORD);
        if self.si_BC_RECEIVED != 0 {
            (self.us_BC_CMD_NR, self.si_BC_BYTE) = (action_command::CONTROL_WORD, 0);
            self.i_BC_WORD = _BASE.w_CONTROLWORD.load() as i16;
        }
    }
}
