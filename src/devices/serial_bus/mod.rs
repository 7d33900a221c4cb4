//! A serial line of a plant, `kind = "serial"`: RS485 with two or four wires, its ports, and the foreign programs at its
//! doors.
//!
//! Participants send characters whenever they want; only their protocol keeps them from sending at the same time. The
//! bus carries characters, and does not interpret them.

mod bus;
mod config;
mod drive_config;
mod drives;
pub(super) mod faults;
mod guests;
mod port;
pub(crate) mod records;
pub(crate) mod rules;

pub(crate) use bus::SerialBus;
pub(crate) use config::SerialConfig;
pub(crate) use port::{LineState, PortSetup, SerialPort, SerialSocket};

/// The family of these buses, and of the ports that fit them.
pub(crate) const FAMILY: &str = "serial";
