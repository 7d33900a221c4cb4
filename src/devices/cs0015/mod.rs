//! ifm ecomat 100 "Platinensteuerung" CS0015: a board controller with a CAN interface, CANopen slave (Systemhandbuch
//! Platinensteuerung CS0015, October 1999).

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod can_errors;
#[cfg(feature = "emulator")]
mod can_jobs;
#[cfg(feature = "emulator")]
mod command;
#[cfg(feature = "emulator")]
mod communication;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
pub(super) mod demo;
#[cfg(feature = "emulator")]
mod diagnosis;
#[cfg(feature = "emulator")]
mod dictionary;
#[cfg(feature = "emulator")]
mod direct;
#[cfg(feature = "emulator")]
mod eeprom;
#[cfg(feature = "emulator")]
mod events;
#[cfg(feature = "emulator")]
pub(super) mod exercise;
#[cfg(feature = "emulator")]
mod fast_inputs;
#[cfg(feature = "emulator")]
pub mod faults;
#[cfg(feature = "emulator")]
mod hardware;
#[cfg(feature = "emulator")]
mod interrupt;
#[cfg(feature = "emulator")]
mod io_jobs;
#[cfg(feature = "emulator")]
mod io_slaves;
#[cfg(feature = "emulator")]
mod jobs;
#[cfg(feature = "emulator")]
mod lcd;
#[cfg(feature = "emulator")]
mod master;
#[cfg(feature = "emulator")]
mod master_jobs;
#[cfg(feature = "emulator")]
mod messages;
#[cfg(feature = "emulator")]
mod nmt;
#[cfg(feature = "emulator")]
mod node;
#[cfg(feature = "emulator")]
mod peripheral_jobs;
#[cfg(feature = "emulator")]
mod peripherals;
#[cfg(feature = "emulator")]
mod port;
#[cfg(feature = "emulator")]
mod pwm;
#[cfg(feature = "emulator")]
mod ram;
#[cfg(feature = "emulator")]
pub mod records;
#[cfg(test)]
mod registers_tests;
#[cfg(feature = "emulator")]
mod retained;
#[cfg(feature = "emulator")]
mod role;
#[cfg(feature = "emulator")]
pub mod rules;
#[cfg(feature = "emulator")]
mod sdo_client;
#[cfg(feature = "emulator")]
mod serial;
#[cfg(feature = "emulator")]
mod slave_jobs;
#[cfg(feature = "emulator")]
mod slow_inputs;
#[cfg(all(test, feature = "emulator"))]
mod tests;
#[cfg(feature = "emulator")]
mod watch;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use communication::{PdoConfig, PdoDirection};
#[cfg(feature = "emulator")]
pub use config::Cs0015Config;
#[cfg(feature = "emulator")]
pub use master::MasterConfig;
#[cfg(feature = "emulator")]
pub use node::{BootUp, GuardingConfig};
#[cfg(feature = "emulator")]
pub use port::Program;

/// Areas, structures, front and object dictionary, generated from `layouts/cs0015`.
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
    read: Some(Cs0015Config::read),
    #[cfg(feature = "emulator")]
    schema: Some(include_str!("plant.schema.json")),
    #[cfg(feature = "emulator")]
    template: Some(include_str!("plant.toml")),
    #[cfg(feature = "emulator")]
    records: records::KINDS,
    #[cfg(feature = "emulator")]
    rules: rules::ALL,
    #[cfg(feature = "emulator")]
    faults: faults::KINDS,
    #[cfg(feature = "emulator")]
    demo: Some(&demo::DEMO),
    #[cfg(feature = "emulator")]
    exercises: &exercise::EXERCISES,
    ..Registered::new(&registers::DEVICE)
};
