//! ifm ecomat 100 "Platinensteuerung" CS0015: a board controller with a CAN interface, CANopen slave (Systemhandbuch
//! Platinensteuerung CS0015, October 1999).

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod emulation;
#[cfg(test)]
mod registers_tests;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use emulation::{
    BootUp, Cs0015Config, GuardingConfig, MasterConfig, PdoConfig, PdoDirection, Program, rules,
};

/// Areas, structures, front panel and object dictionary, generated from `layouts/cs0015`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/cs0015.rs"));
}

/// The device's entry in the registry.
pub(super) static REGISTERED: Registered = Registered {
    board: &["power", "restarts", "program"],
    #[cfg(feature = "plc")]
    blocks: blocks::BLOCKS,
    #[cfg(feature = "emulator")]
    emulation: emulation::EMULATION,
    ..Registered::new(&registers::DEVICE)
};
