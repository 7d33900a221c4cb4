//! The CANsync bus: frames, identifiers, codecs, timing.
//!
//! This module uses no I/O, no allocation and no clock. [`Frame`] is a transmitted frame, [`FrameKind`] the
//! meaning of its identifier, [`codec`] the meaning of its data bytes, [`wire`] its duration on the bus, and
//! [`SyncLock`] the synchronization of a slave.

pub mod codec;
pub(crate) mod frame;
pub(crate) mod ident;
mod sync;
pub mod wire;

pub use frame::{Frame, FrameLength};
pub(crate) use ident::LAST_SLAVE;
pub use ident::{Channel, FrameKind};
pub use sync::SyncLock;
pub(crate) use sync::is_in_time;
