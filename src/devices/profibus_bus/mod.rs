//! A PROFIBUS segment of a plant: the line, its stations, and its journal events.

mod bus;
mod config;
mod disturbance;
pub(super) mod faults;
mod guests;
mod port;
pub mod records;
mod services;

pub use bus::ProfibusBus;
pub use config::ProfibusConfig;
pub use port::{Presence, ProfibusPort, ProfibusSocket, Station};

/// The family of these buses, and of the ports that fit them.
pub const FAMILY: &str = "profibus";
