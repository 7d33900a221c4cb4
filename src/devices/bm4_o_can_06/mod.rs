//! b maXX PLC with CANsync option modules in slots G to M (manual 5.02066.01a). A BM4-O-CAN-06 is a master. A
//! BM4-O-CAN-05 with DIP switch 9 at ON is a slave.

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod emulation;
#[cfg(test)]
mod registers_tests;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use emulation::{Bm4Config, Bm4Plc, Leds, ModuleConfig, ModuleKind};

/// Areas, structures and timing, generated from `layouts/bm4-plc`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/bm4_plc.rs"));
}

/// The device's entry in the registry.
pub(super) static REGISTERED: Registered = Registered {
    // The manual describes the modules only, so the PLC has no other elements (decision D-366).
    board: &["power", "restarts", "program", "start"],
    #[cfg(feature = "plc")]
    blocks: blocks::BLOCKS,
    #[cfg(feature = "plc")]
    st: blocks::ST,
    #[cfg(feature = "emulator")]
    emulation: emulation::EMULATION,
    ..Registered::new(&registers::DEVICE)
};
