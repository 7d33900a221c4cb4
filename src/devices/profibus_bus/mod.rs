//! A PROFIBUS segment of a plant: the line, its stations, and its journal events.

mod bus;
mod config;
mod disturbance;
pub(super) mod faults;
mod guests;
mod port;
pub(crate) mod records;
mod services;

pub(crate) use bus::ProfibusBus;
pub(crate) use config::ProfibusConfig;
pub(crate) use port::{Presence, ProfibusPort, ProfibusSocket, Station};

/// The family of these buses, and of the ports that fit them.
pub(crate) const FAMILY: &str = "profibus";
