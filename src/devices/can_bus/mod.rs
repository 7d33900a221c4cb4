//! A CAN bus of a plant, `kind = "can"`: [`can::Line`](crate::can::Line) carries the frames, and ports of devices
//! take part.
//!
//! The meaning of a frame is defined by the devices. Each device provides a [`CanSocket`] with the firmware of its
//! port, a [`CanPort`]. The firmware gives frames to its [`Controller`] and receives frames that pass the filters.

mod acceptance;
mod bus;
mod config;
mod controller;
mod device;
mod disturbance;
#[cfg(test)]
mod fault_tests;
mod guest;
mod port;
pub(crate) mod records;
mod station;
mod stations;
#[cfg(test)]
mod tests;
mod traffic;

pub use bus::CanBus;
pub use config::CanBusConfig;
pub use controller::{Controller, QueueFull};
pub use device::{CanDevice, read};
pub use port::{CanPort, CanSocket};

/// Name of the family of these buses.
pub(crate) const FAMILY: &str = "can";
