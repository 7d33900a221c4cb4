//! b maXX PLC with CANsync option modules in slots G to M (manual 5.02066.01a). A BM4-O-CAN-06 is a master. A
//! BM4-O-CAN-05 with DIP switch 9 at ON is a slave.

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
pub(super) mod demo;
#[cfg(feature = "emulator")]
pub(super) mod exercise;
#[cfg(feature = "emulator")]
mod front;
#[cfg(feature = "emulator")]
mod leds;
#[cfg(feature = "emulator")]
mod module;
#[cfg(feature = "emulator")]
mod plc;
#[cfg(test)]
mod registers_tests;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use config::{Bm4Config, ModuleConfig, ModuleKind};
#[cfg(feature = "emulator")]
pub use leds::Leds;
#[cfg(feature = "emulator")]
pub(super) use module::read as read_module;
#[cfg(feature = "emulator")]
pub use plc::Bm4Plc;

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
    emulation: crate::devices::Emulation {
        schema: Some(include_str!("plant.schema.json")),
        template: Some(include_str!("plant.toml")),
        first_exchange: Some(crate::devices::FirstExchange {
            writes: &[("slotG.w_CPU_CONTROL", 0x0001)],
            answer: ("slotG.w_OPTION_STATUS", 0x0002),
            within: "1ms",
        }),
        module: Some(read_module),
        demo: Some(&demo::DEMO),
        exercises: &exercise::EXERCISES,
        ..crate::devices::Emulation::of(Bm4Config::read)
    },
    ..Registered::new(&registers::DEVICE)
};
