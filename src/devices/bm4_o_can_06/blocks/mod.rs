//! The function blocks for the CANsync option modules of the b maXX PLC (manual 5.02066.01a chapter 4, p. 99-196), and
//! `INTR_SET`, which p. 25 names.
//!
//! `_BASE` is connected to this device's structures: `_CANsyncMaster_Init_Slot_G AT %MB3.2001792 :
//! CANsync_PLC_INIT_BMSTRUCT` and so on. Blocks of the BACI are neither described nor provided here.

#![allow(non_snake_case, non_camel_case_types, reason = "the manual's names, letter for letter")]

mod cansync;

use crate::devices::cansync::blocks::st::st;
use crate::plc::{BlockKind, StPart, block_kinds};

pub use crate::devices::cansync::blocks::*;
pub use crate::devices::intr_set::INTR_SET;
pub use crate::plc::{Base, Program, Progress, Ram, RunError, Tasks};
pub use cansync::*;

/// The function blocks with the structures that they work on.
pub static BLOCKS: &[BlockKind] = block_kinds! {
    "CANsync_PLC_MA_BMSTRUCT":
        CANsync_BC_MA0 CANsync_BC_MA1 CANsync_BC_MA2 CANsync_COMM_CONTROL_MA CANsync_CONTROLWORD_MA CANsync_MODE_MA
        CANsync_PAR_READ_MA CANsync_PAR_WRITE_MA CANsync_PD_CFG_MA CANsync_PD_CFG_READ_MA CANsync_PD_COMM_MA
        CANsync_PD_COMM_READ_MA CANsync_UPDOWNLOAD_MA;
    "CANsync_PLC_SL_BMSTRUCT":
        CANsync_BC_SL CANsync_CONTROLWORD_SL CANsync_MODE_SL CANsync_PAR_SL CANsync_PD_CFG_READ_SL CANsync_PD_CFG_SL
        CANsync_PD_COMM_READ_SL CANsync_PD_COMM_SL CANsync_UPDOWNLOAD_SL;
    "CANsync_PLC_INIT_BMSTRUCT": CANsync_INIT;
    -: CANsync_SL_TYP_INIT INTR_SET;
};

/// The function blocks in IEC Structured Text, in the order that a compiler needs.
pub static ST: &[StPart] = st!(
    "CANsync_PLC_INIT_BMSTRUCT",
    "CANsync_PLC_MA_BMSTRUCT",
    "CANsync_PLC_SL_BMSTRUCT",
    include_str!("st/cansync.st"),
    []
);
