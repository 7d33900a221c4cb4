//! Register tables: of a device with fixed nodes, of a device with modules in slots, of a device with switches, of an
//! I/O module, and of a station without any.

#[cfg(feature = "emulator")]
pub(crate) use super::station::STATION;
pub(crate) use crate::devices::bm4_o_can_06::registers::DEVICE as SLOTS;
pub(crate) use crate::devices::cansync::registers::phases;
#[cfg(feature = "export")]
pub(crate) use crate::devices::cr201x::registers::DEVICE as MODULE;
pub(crate) use crate::devices::cs0015::registers::DEVICE as PANEL;
pub(crate) use crate::devices::omega_drive_line_2::registers::DEVICE as NODES;
