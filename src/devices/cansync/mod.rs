//! Parts that all CANsync devices share: frames and their times, the firmware of the nodes, drives with a CANsync card,
//! function blocks.

#[cfg(feature = "plc")]
pub(crate) mod blocks;
#[cfg(feature = "emulator")]
pub mod bus;
#[cfg(feature = "emulator")]
pub(crate) mod demo;
#[cfg(feature = "emulator")]
pub mod drive;
#[cfg(feature = "emulator")]
pub(in crate::devices) mod exercise;
#[cfg(feature = "emulator")]
pub(crate) mod faults;
#[cfg(feature = "emulator")]
pub mod firmware;
#[cfg(feature = "emulator")]
pub mod frames;
#[cfg(feature = "emulator")]
mod messages;
mod rate;
#[cfg(feature = "emulator")]
pub mod records;
#[cfg(feature = "emulator")]
pub mod rules;
#[cfg(feature = "emulator")]
mod watch;

/// Registers of CANsync nodes, generated from `layouts/cansync`.
#[allow(non_snake_case, non_camel_case_types)]
pub mod registers {
    include!(concat!(env!("OUT_DIR"), "/cansync.rs"));
}

pub use rate::{BaudRate, Deadline};
