//! The function blocks of the CS0015, and related types for programs (Systemhandbuch Platinensteuerung CS0015, p.
//! 30-70, 86-131).
//! On the device the blocks call the operating system. In commram each call with ENABLE enters an order in
//! the job block. A later call shows the result; in a PLC program this is the next call (D-444). Blocks that
//! only calculate enter no order.

#![allow(non_snake_case, non_camel_case_types, reason = "the manual's names, letter for letter")]

mod calculation;
mod can;
mod can_errors;
mod controllers;
mod display;
mod io_slaves;
mod master;
mod memory;
mod order;
mod sdo;
mod slave;
mod system;
mod terminals;
mod text;

use crate::plc::{BlockKind, block_kinds};

pub use crate::plc::Ram;
pub use calculation::{DELAY, LowPass, NORM, PT1, ValueHistory};
pub use can::*;
pub use can_errors::*;
pub use controllers::{Controller, GLR, PID};
pub use display::*;
pub use io_slaves::*;
pub use master::*;
pub use memory::{CHECK_DATA, MEMCPY, ReferenceData};
pub use order::{Answer, Jobs, Order, Progress};
pub use sdo::*;
pub use slave::*;
pub use system::*;
pub use terminals::*;
pub use text::STR;

/// The function blocks, in the order of the manual's chapters.
pub static BLOCKS: &[BlockKind] = block_kinds! {
    -: CAN_BAUDRATE CAN_TRANSMIT CAN_RECEIVE CAN_RESTART CAN_ERRORHANDLER
        NMS_SET_NODEID NMS_GUARDING_CONFIG PDO_TX_CONFIG PDO_RX_CONFIG PDO_TX_REFRESH
        NMM_SET_NMT_MASTER NMM_ADD_NODE NMM_START_GUARDING NMM_STOP_GUARDING NMM_NODE_GUARDING NMM_SET_PREOPERATIONAL
        NMM_SET_OPERATIONAL NMM_SET_PREPARED NMM_GET_NODE_STATE NMM_RESET_NODE NMM_RESET_COMM PDO_INI_SEND_SYNC_OBJ
        PDO_SEND_SYNC_OBJ EMC_GET_EMERGENCY SDO_READ SDO_WRITE
        COP_MSTR_BOOTUP COP_MSTR_MAIN SLAVE_CR2010_CONFIG SLAVE_8_CONFIG SLAVE_CR2010_WORK SLAVE_8_WORK SLAVE_CR2011_CONFIG
        SLAVE_CR2011_WORK
        PWM PWM100 FREQUENCY CYCLE INC_ENCODER LCD_SEGMENTS LCD_TEXT STR
        SOFTRESET MEMCPY E2WRITE E2READ CHECK_DATA SERIAL_TX SERIAL_RX SERIAL_PENDING TIMER_READ TIMER_US_READ NORM SET_INTERRUPT_1MS
        DELAY PT1 PID GLR;
};
