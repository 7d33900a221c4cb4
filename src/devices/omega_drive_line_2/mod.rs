//! Omega Drive-Line II (manual 5.00005.03a): a PLC built into a drive, with two CANsync nodes, the drive interface BAPS and
//! Ethernet.

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod emulation;
#[cfg(test)]
mod registers_tests;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use emulation::{Plc, PlcConfig, ProjectConfig, rules};

/// Areas, structures and timing, generated from `layouts/omega-drive-line-2`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/omega_drive_line_2.rs"));
}

/// The device's entry in the registry.
pub(super) static REGISTERED: Registered = Registered {
    board: &crate::memory::header::BoardWords::NAMES,
    #[cfg(feature = "plc")]
    blocks: blocks::BLOCKS,
    #[cfg(feature = "plc")]
    st: blocks::ST,
    #[cfg(feature = "emulator")]
    emulation: emulation::EMULATION,
    ..Registered::new(&registers::DEVICE)
};
