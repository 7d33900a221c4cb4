//! Classical CAN according to ISO 11898-1: frames, their bits and times on the wire, acceptance filters, a medium,
//! error counters.
//!
//! The module depends on no device and no protocol. Its users define the meaning of identifiers and data bytes. It uses
//! no I/O, no allocation and no clock.

mod arbitration;
mod confinement;
mod filter;
mod frame;
pub(crate) mod kept;
mod line;
mod message;
mod payload;
mod rate;
#[cfg(test)]
pub(crate) mod reference;
pub mod wire;

pub use arbitration::Arbitration;
pub use confinement::{ErrorCounters, ErrorState, Recovery};
pub use embedded_can::{ExtendedId, Id, StandardId};
pub use filter::Filter;
pub use frame::Frame;
pub use line::{Event, Fate, Line, OnWire, Participants};
pub use message::{BitOrder, Message, Presence, Signal, merged};
pub use payload::Payload;
pub use rate::BitRate;
