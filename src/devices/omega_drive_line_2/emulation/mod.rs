//! The emulation of an Omega Drive-Line II: its board, the drive interface BAPS, Ethernet, the serial interface, and the
//! CANsync nodes.

pub(crate) mod baps;
pub(crate) mod board;
mod config;
mod demo;
pub(crate) mod ethernet;
mod exercise;
pub(crate) mod faults;
mod plc;
pub mod rules;
mod serial;

pub use config::{PlcConfig, ProjectConfig};
pub use plc::Plc;

use crate::devices::{Emulation, FirstExchange};

/// The device's emulation in the registry.
pub(super) const EMULATION: Emulation = Emulation {
    schema: Some(include_str!("plant.schema.json")),
    template: Some(include_str!("plant.toml")),
    first_exchange: Some(FirstExchange {
        writes: &[("node2.w_CPU_CONTROL", 0x0001)],
        answer: ("node2.w_OPTION_STATUS", 0x0002),
        within: "1ms",
    }),
    rules: rules::ALL,
    faults: faults::KINDS,
    demo: Some(&demo::DEMO),
    exercises: &exercise::EXERCISES,
    option_interfaces: config::OPTION_INTERFACES,
    ..Emulation::of(PlcConfig::read)
};
