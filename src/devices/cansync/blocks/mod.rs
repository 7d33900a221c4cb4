//! The CANsync function blocks (manual 5.00005.03a chapter 7.3, p. 194-271; 5.02066.01a chapter 4, p. 99-196).
//!
//! If the manuals agree on a block, this module defines the block and each device exports it. Where the
//! manuals differ, this module has the pins and the common part, in a macro that creates the block of a
//! device.

#![allow(non_snake_case, non_camel_case_types, reason = "the manual's names, letter for letter")]

mod broadcast;
mod comm_control;
mod controlword;
pub(crate) mod init;
mod mode;
pub(crate) mod par_ma;
mod par_sl;
mod pd_cfg;
mod pd_comm_ma;
pub(crate) mod pd_comm_read;
pub(crate) mod pd_comm_sl;
mod process_data;
mod registers;
mod sl_typ_init;
pub(crate) mod st;
mod updownload;
pub(crate) mod updownload_ma;
mod updownload_sl;

pub use broadcast::{CANsync_BC_MA0, CANsync_BC_MA1, CANsync_BC_MA2, CANsync_BC_SL};
pub use comm_control::CANsync_COMM_CONTROL_MA;
pub use controlword::{CANsync_CONTROLWORD_MA, CANsync_CONTROLWORD_SL};
pub use mode::{CANsync_MODE_MA, CANsync_MODE_SL};
pub use par_ma::CANsync_PAR_WRITE_MA;
pub use par_sl::CANsync_PAR_SL;
pub use pd_cfg::{CANsync_PD_CFG_MA, CANsync_PD_CFG_READ_MA, CANsync_PD_CFG_READ_SL, CANsync_PD_CFG_SL};
pub use pd_comm_ma::CANsync_PD_COMM_MA;
pub use sl_typ_init::CANsync_SL_TYP_INIT;
pub use updownload::{CANsync_UPDOWN_BMARRAY, UPDOWN_VALUES};
pub use updownload_sl::CANsync_UPDOWNLOAD_SL;

/// Actual values 0 to 15 of slaves 0 to 31; values 0 to 7 are in use (p. 244).
pub type CANsync_RD_BMARRAY = [[i32; 16]; 32];
