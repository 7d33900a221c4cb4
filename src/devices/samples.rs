//! What others are tested with, under names that are no device's.

#[cfg(feature = "emulator")]
mod events;
pub(crate) mod tables;

#[cfg(feature = "channel")]
pub(crate) use events::event;
