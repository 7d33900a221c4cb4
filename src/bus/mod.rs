//! The CANsync bus: frames, identifiers, codecs, timing.

pub mod frame;

pub use frame::Frame;
