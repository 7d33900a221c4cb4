//! Parts that all CANsync devices share: registers, function blocks, emulation.

#[cfg(feature = "plc")]
pub(crate) mod blocks;
#[cfg(feature = "emulator")]
mod emulation;
mod rate;

#[cfg(feature = "emulator")]
pub use emulation::{bus, drive, firmware, frames, records, rules};
#[cfg(feature = "emulator")]
pub(crate) use emulation::{demo, exercise, faults};

/// Registers of CANsync nodes, generated from `layouts/cansync`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/cansync.rs"));
}

pub use rate::{BaudRate, Deadline};
