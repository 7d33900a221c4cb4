//! The devices, a folder each, and [`cansync`], what the CANsync devices share.

pub mod cansync;
#[cfg(feature = "emulator")]
mod context;
pub mod omega_drive_line_2;
#[cfg(feature = "emulator")]
pub mod settings;
#[cfg(feature = "emulator")]
mod shown;

#[cfg(feature = "emulator")]
pub use context::Context;
#[cfg(feature = "emulator")]
pub use settings::BuildError;
