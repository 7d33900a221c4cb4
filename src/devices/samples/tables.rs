//! Register tables: of a device whose nodes are what they are, of one whose slots hold modules, of one with switches of its own, of a
//! station that has none.

#[cfg(feature = "emulator")]
pub(crate) use super::station::STATION;
pub(crate) use crate::devices::bm4_o_can_06::registers::DEVICE as SLOTS;
pub(crate) use crate::devices::cs0015::registers::DEVICE as PANEL;
pub(crate) use crate::devices::omega_drive_line_2::registers::DEVICE as NODES;
