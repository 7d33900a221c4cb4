//! The function blocks that come with the CAN-DP/2 for a PLC that is its DP master (Software-Handbuch CAN-DP/2, p.
//! 61-70, 76-86): FB1 initialises a CANopen device by a list, FB2 does page mode, FB3 controls 127 motors by both, FB4
//! uses the Communication Window.
//!
//! The manual does not print the sources of the blocks, so their internal behaviour is a choice of commram (D-469). The
//! types that replace the PLC are also a choice of commram: [`Peripherals`], [`DataBlocks`], and [`DP_MASTER`], which
//! exchanges the peripherals with the gateway.

#![allow(non_snake_case, non_camel_case_types, reason = "the manual's names, letter for letter")]

mod data;
mod fb1;
mod fb2;
mod fb3;
mod fb4;
mod master;

use crate::plc::{BlockKind, block_kinds};

pub use data::{DataBlocks, Peripherals};
pub use fb1::{FB1, initialisation};
pub use fb2::FB2;
pub use fb3::FB3;
pub use fb4::FB4;
pub use master::DP_MASTER;

pub use crate::plc::Ram;

/// The function blocks, in the order of their numbers, and the PLC's part of the exchange.
pub static BLOCKS: &[BlockKind] = block_kinds! {
    -: FB1 FB2 FB3 FB4;
    "CAN_DP2_MST": DP_MASTER;
};
