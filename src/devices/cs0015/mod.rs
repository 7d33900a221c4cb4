//! ifm ecomat 100 "Platinensteuerung" CS0015: a board controller with a CAN interface, CANopen slave (Systemhandbuch
//! Platinensteuerung CS0015, October 1999).

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod board;
#[cfg(feature = "emulator")]
mod canopen;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
pub(super) mod demo;
#[cfg(feature = "emulator")]
pub(super) mod exercise;
#[cfg(feature = "emulator")]
pub(crate) mod faults;
#[cfg(feature = "emulator")]
mod jobs;
#[cfg(feature = "emulator")]
mod port;
#[cfg(feature = "emulator")]
mod ram;
#[cfg(feature = "emulator")]
pub(crate) mod records;
#[cfg(test)]
mod registers_tests;
#[cfg(feature = "emulator")]
mod role;
#[cfg(feature = "emulator")]
pub mod rules;
#[cfg(all(test, feature = "emulator"))]
mod tests;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use canopen::communication::{PdoConfig, PdoDirection};
#[cfg(feature = "emulator")]
pub use canopen::master::MasterConfig;
#[cfg(feature = "emulator")]
pub use canopen::node::{BootUp, GuardingConfig};
#[cfg(feature = "emulator")]
pub use config::Cs0015Config;
#[cfg(feature = "emulator")]
pub use port::Program;

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
    emulation: crate::devices::Emulation {
        schema: Some(include_str!("plant.schema.json")),
        template: Some(include_str!("plant.toml")),
        first_exchange: Some(crate::devices::FirstExchange {
            writes: &[("outputs.Q0", 0x0005)],
            answer: ("front.outputs", 0x0005),
            within: "300ms",
        }),
        records: records::KINDS,
        rules: rules::ALL,
        faults: faults::KINDS,
        demo: Some(&demo::DEMO),
        exercises: &exercise::EXERCISES,
        ..crate::devices::Emulation::of(Cs0015Config::read)
    },
    ..Registered::new(&registers::DEVICE)
};
