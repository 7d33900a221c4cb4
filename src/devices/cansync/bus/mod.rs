//! The CANsync bus: frames, identifiers, codecs, timing.
//!
//! Everything here is pure: no I/O, no allocation, no clock. [`Frame`] is what travels, [`FrameKind`] what
//! its identifier says, [`codec`] what its data bytes mean, [`wire`] how long it occupies the bus, [`SyncLock`] whether a
//! slave runs in step.

pub mod codec;
pub mod frame;
pub mod ident;
mod sync;
pub mod wire;

pub use frame::{Frame, FrameLength};
pub use ident::{Channel, FrameKind, LAST_SLAVE};
pub use sync::SyncLock;
pub(crate) use sync::is_in_time;
