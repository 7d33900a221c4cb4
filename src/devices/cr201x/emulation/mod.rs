//! The emulation of a CR2010 or CR2011: its channels, its object dictionary, and its behaviour at the bus.

mod channels;
mod config;
mod dictionary;
mod module;
#[cfg(test)]
mod tests;

pub use channels::{CHANNELS, Channels, Model, Role};
pub use config::Cr201xConfig;

use crate::devices::{Emulation, FirstExchange};

/// The device's emulation in the registry.
pub(super) const EMULATION: Emulation = Emulation {
    schema: Some(include_str!("plant.schema.json")),
    template: Some(include_str!("plant.toml")),
    first_exchange: Some(FirstExchange {
        writes: &[("front.inputs", 0x0001)],
        answer: ("channels.a_INPUT[0]", 0x0001),
        within: "500ms",
    }),
    records: crate::devices::canopen::records::KINDS,
    ..Emulation::of(Cr201xConfig::read)
};
