//! Register tables of five kinds of devices: with fixed nodes, with modules in slots, with switches, an I/O
//! module, and a station without registers.

#[cfg(feature = "emulator")]
pub(crate) use super::station::STATION;
pub(crate) use crate::devices::bm4_o_can_06::registers::DEVICE as SLOTS;
pub(crate) use crate::devices::cansync::registers::phases;
#[cfg(feature = "export")]
pub(crate) use crate::devices::cr201x::registers::DEVICE as MODULE;
pub(crate) use crate::devices::cs0015::registers::DEVICE as PANEL;
pub(crate) use crate::devices::omega_drive_line_2::registers::DEVICE as NODES;
