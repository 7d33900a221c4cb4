//! The emulation of a b maXX PLC with its CANsync option modules.

mod config;
mod demo;
mod exercise;
mod front;
mod leds;
mod module;
mod plc;

pub use config::{Bm4Config, ModuleConfig, ModuleKind};
pub use leds::Leds;
pub use plc::Bm4Plc;

use crate::devices::{Emulation, FirstExchange};

/// The device's emulation in the registry.
pub(super) const EMULATION: Emulation = Emulation {
    schema: Some(include_str!("plant.schema.json")),
    template: Some(include_str!("plant.toml")),
    first_exchange: Some(FirstExchange {
        writes: &[("slotG.w_CPU_CONTROL", 0x0001)],
        answer: ("slotG.w_OPTION_STATUS", 0x0002),
        within: "1ms",
    }),
    module: Some(module::read),
    demo: Some(&demo::DEMO),
    exercises: &exercise::EXERCISES,
    ..Emulation::of(Bm4Config::read)
};
