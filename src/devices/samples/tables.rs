//! Register tables: of a device whose nodes are what they are, and of one whose slots hold modules.

pub(crate) use crate::devices::bm4_o_can_06::registers::DEVICE as SLOTS;
pub(crate) use crate::devices::omega_drive_line_2::registers::DEVICE as NODES;
