//! Omega Drive-Line II (manual 5.00005.03a): a PLC built into a drive, with two CANsync nodes, the drive interface BAPS and
//! Ethernet.

#[cfg(feature = "emulator")]
pub(crate) mod baps;
#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
pub(crate) mod board;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
pub(super) mod demo;
#[cfg(feature = "emulator")]
pub(crate) mod ethernet;
#[cfg(feature = "emulator")]
pub(super) mod exercise;
#[cfg(feature = "emulator")]
pub(crate) mod faults;
#[cfg(feature = "emulator")]
mod plc;
#[cfg(feature = "emulator")]
pub mod rules;
#[cfg(feature = "emulator")]
mod serial;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use config::{PlcConfig, ProjectConfig};
#[cfg(feature = "emulator")]
pub use plc::Plc;
#[cfg(test)]
mod registers_tests;

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
    emulation: crate::devices::Emulation {
        schema: Some(include_str!("plant.schema.json")),
        template: Some(include_str!("plant.toml")),
        first_exchange: Some(crate::devices::FirstExchange {
            writes: &[("node2.w_CPU_CONTROL", 0x0001)],
            answer: ("node2.w_OPTION_STATUS", 0x0002),
            within: "1ms",
        }),
        rules: rules::ALL,
        faults: faults::KINDS,
        demo: Some(&demo::DEMO),
        exercises: &exercise::EXERCISES,
        option_interfaces: config::OPTION_INTERFACES,
        ..crate::devices::Emulation::of(PlcConfig::read)
    },
    ..Registered::new(&registers::DEVICE)
};
