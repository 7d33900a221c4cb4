//! A PROFIBUS segment of a plant: the line, the stations at it, what the journal tells of it.

mod config;
mod medium;
mod port;
pub mod records;
mod visitors;

pub use config::ProfibusConfig;
pub use medium::ProfibusBus;
pub use port::{Presence, ProfibusPort, ProfibusSocket, Station};

/// The family of such media, and of the ports that fit them.
pub const FAMILY: &str = "profibus";
