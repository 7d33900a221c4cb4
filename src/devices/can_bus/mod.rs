//! A CAN bus of a plant, `kind = "can"`: what [`can::Medium`](crate::can::Medium) is to frames, with ports of devices as its
//! participants.
//!
//! What its frames mean is the devices' affair: each hands over a [`CanSocket`] with the firmware of its port, a [`CanPort`],
//! which gives frames to its [`Controller`] and is given those that pass the filters.

mod acceptance;
mod config;
mod controller;
mod device;
mod disturbance;
mod end;
#[cfg(test)]
mod fault_tests;
mod guest;
mod medium;
mod port;
pub mod records;
mod stations;
#[cfg(test)]
mod tests;
mod traffic;

pub use config::CanBusConfig;
pub use controller::{Controller, QueueFull};
pub use device::{CanDevice, read};
pub use medium::CanBus;
pub use port::{CanPort, CanSocket};

/// What media of this kind are called.
pub(crate) const FAMILY: &str = "can";
