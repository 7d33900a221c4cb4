//! The emulation of a CS0015: its firmware as a CANopen slave or master, its board, and the jobs of its programs.

mod board;
mod canopen;
mod config;
mod demo;
mod exercise;
pub(crate) mod faults;
mod jobs;
mod port;
mod ram;
pub(crate) mod records;
mod role;
pub mod rules;
#[cfg(test)]
mod tests;

pub use canopen::communication::{PdoConfig, PdoDirection};
pub use canopen::master::MasterConfig;
pub use canopen::node::{BootUp, GuardingConfig};
pub use config::Cs0015Config;
pub use port::Program;

use crate::devices::{Emulation, FirstExchange};

/// The device's emulation in the registry.
pub(super) const EMULATION: Emulation = Emulation {
    schema: Some(include_str!("plant.schema.json")),
    template: Some(include_str!("plant.toml")),
    first_exchange: Some(FirstExchange {
        writes: &[("outputs.Q0", 0x0005)],
        answer: ("front.outputs", 0x0005),
        within: "300ms",
    }),
    records: records::KINDS,
    rules: rules::ALL,
    faults: faults::KINDS,
    demo: Some(&demo::DEMO),
    exercises: &exercise::EXERCISES,
    ..Emulation::of(Cs0015Config::read)
};
