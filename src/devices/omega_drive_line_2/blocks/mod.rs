//! The function blocks of the Omega Drive-Line II, with the other items that a program needs.

#![allow(non_snake_case, non_camel_case_types, reason = "the manual's names, letter for letter")]

mod baps;
mod board;
mod cansync;
mod serial_3964r;
mod serial_ring;
mod serial_uss;

use crate::devices::cansync::blocks::st::st;
use crate::plc::{BlockKind, StPart, block_kinds};

pub use crate::devices::cansync::blocks::*;
pub use crate::devices::intr_set::INTR_SET;
pub use crate::plc::{Base, Program, Progress, Ram, RunError, Tasks};
pub use baps::*;
pub use board::{LED, OPT_INIT, TIME_MEASURE_END, TIME_MEASURE_START};
pub use cansync::*;
pub use serial_3964r::{SERIAL_3964R, SERIAL_BMARRAY, SERIAL_OCTETS};
pub use serial_uss::{SERIAL_USS, USS_BMARRAY};

/// The function blocks with the structures that they work on, in the order of the manual's chapters.
pub static BLOCKS: &[BlockKind] = block_kinds! {
    "CANsync_MA_CTRL_BMSTRUCT":
        CANsync_BC_MA0 CANsync_BC_MA1 CANsync_BC_MA2 CANsync_COMM_CONTROL_MA CANsync_CONTROLWORD_MA CANsync_MODE_MA
        CANsync_PAR_READ_MA CANsync_PAR_WRITE_MA CANsync_PD_CFG_MA CANsync_PD_CFG_READ_MA CANsync_PD_COMM_MA
        CANsync_PD_COMM_READ_MA CANsync_UPDOWNLOAD_MA;
    "CANsync_SL_CTRL_BMSTRUCT":
        CANsync_BC_SL CANsync_CONTROLWORD_SL CANsync_MODE_SL CANsync_PAR_SL CANsync_PD_CFG_READ_SL CANsync_PD_CFG_SL
        CANsync_PD_COMM_READ_SL CANsync_PD_COMM_SL CANsync_UPDOWNLOAD_SL;
    "CANsync_INIT_BMSTRUCT": CANsync_INIT;
    -: CANsync_SL_TYP_INIT;
    "BAPS_CTRL_BMSTRUCT":
        BAPS_INIT BAPS_PD_COMM2 BAPS_PD_COMM8 BAPS_PD_COMM24 BAPS_PD_CONTROL BAPS_PAR_READ BAPS_PAR_WRITE
        BAPS_SD_CONTROL;
    "SERIAL_BMSTRUCT": SERIAL_3964R SERIAL_USS;
    -: LED INTR_SET OPT_INIT TIME_MEASURE_START TIME_MEASURE_END;
};

/// The function blocks in IEC Structured Text, in the order that a compiler needs.
pub static ST: &[StPart] = st!(
    "CANsync_INIT_BMSTRUCT",
    "CANsync_MA_CTRL_BMSTRUCT",
    "CANsync_SL_CTRL_BMSTRUCT",
    include_str!("st/cansync.st"),
    [
        include_str!("st/board.st"),
        include_str!("st/baps_init.st"),
        include_str!("st/baps_pd.st"),
        include_str!("st/baps_sd.st"),
        include_str!("st/serial_3964r.st"),
        include_str!("st/serial_uss.st")
    ]
);
