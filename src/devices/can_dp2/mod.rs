//! esd CAN-DP/2: a gateway between PROFIBUS-DP, where it is a slave, and a CAN bus (Software-Handbuch CAN-DP/2,
//! revision 1.1).

#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
pub(super) mod demo;
#[cfg(feature = "emulator")]
pub(super) mod exercise;
#[cfg(feature = "emulator")]
mod firmware;
#[cfg(any(feature = "emulator", feature = "plc"))]
mod page;
#[cfg(feature = "emulator")]
pub(crate) mod records;
#[cfg(feature = "emulator")]
pub mod rules;
#[cfg(all(test, feature = "emulator"))]
mod tests;

use crate::devices::Registered;
#[cfg(feature = "emulator")]
pub use config::CanDp2Config;

/// Areas, structures and front panel, generated from `layouts/can-dp2`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/can_dp2.rs"));
}

/// The device's entry in the registry.
pub(super) static REGISTERED: Registered = Registered {
    #[cfg(feature = "plc")]
    blocks: blocks::BLOCKS,
    #[cfg(feature = "emulator")]
    emulation: crate::devices::Emulation {
        schema: Some(include_str!("plant.schema.json")),
        template: Some(include_str!("plant.toml")),
        first_exchange: Some(crate::devices::FirstExchange {
            writes: &[("mst.mst_dsap", 60), ("mst.mst_control", 0x0005)],
            answer: ("mst.mst_control", 0x0004),
            within: "20ms",
        }),
        records: records::KINDS,
        rules: rules::ALL,
        demo: Some(&demo::DEMO),
        exercises: &exercise::EXERCISES,
        ..crate::devices::Emulation::of(CanDp2Config::read)
    },
    ..Registered::new(&registers::DEVICE)
};
