//! Omega Drive-Line II (manual 5.00005.03a): a PLC built into a drive, with two CANsync nodes, the drive interface BAPS and
//! Ethernet.

#[cfg(feature = "emulator")]
pub mod baps;
#[cfg(feature = "plc")]
pub mod blocks;
#[cfg(feature = "emulator")]
pub mod board;
#[cfg(feature = "emulator")]
mod config;
#[cfg(feature = "emulator")]
pub mod ethernet;
#[cfg(feature = "emulator")]
mod plc;

#[cfg(feature = "emulator")]
pub use config::{PlcConfig, ProjectConfig};
#[cfg(feature = "emulator")]
pub use plc::Plc;
