//! A PROFIBUS segment of a plant: the line, the stations at it, and its journal events.

mod config;
mod guests;
mod medium;
mod port;
pub mod records;

pub use config::ProfibusConfig;
pub use medium::ProfibusBus;
pub use port::{Presence, ProfibusPort, ProfibusSocket, Station};

/// The family of these media, and of the ports that fit them.
pub const FAMILY: &str = "profibus";
