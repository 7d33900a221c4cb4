//! Samples for tests of other modules, with names that belong to no device.

#[cfg(feature = "emulator")]
mod events;
#[cfg(feature = "emulator")]
pub(crate) mod master;
#[cfg(feature = "emulator")]
mod station;
pub(crate) mod tables;

/// A function block of the built-in plant's device, which has an input `us_BAUDRATE`.
#[cfg(feature = "cli")]
pub(crate) const BLOCK: &str = "CANsync_INIT";

#[cfg(feature = "channel")]
pub(crate) use events::{event, event_at};
