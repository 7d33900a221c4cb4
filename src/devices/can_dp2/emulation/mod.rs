//! The emulation of a CAN-DP/2: its firmware, which is a slave at PROFIBUS-DP and a participant of the CAN bus.

mod config;
mod demo;
mod exercise;
mod firmware;
pub(crate) mod records;
pub mod rules;
#[cfg(test)]
mod tests;

pub use config::CanDp2Config;

use crate::devices::{Emulation, FirstExchange};

/// The device's emulation in the registry.
pub(super) const EMULATION: Emulation = Emulation {
    schema: Some(include_str!("plant.schema.json")),
    template: Some(include_str!("plant.toml")),
    first_exchange: Some(FirstExchange {
        writes: &[("mst.mst_dsap", 60), ("mst.mst_control", 0x0005)],
        answer: ("mst.mst_control", 0x0004),
        within: "20ms",
    }),
    records: records::KINDS,
    rules: rules::ALL,
    demo: Some(&demo::DEMO),
    exercises: &exercise::EXERCISES,
    ..Emulation::of(CanDp2Config::read)
};
