//! The channel: a request-response interface to a running emulator, for tools and tests.
//!
//! An emulator has two interfaces for programs: the mapped image and the channel. The channel can advance the
//! emulated time, wait for a register without missing a change, and execute several operations (poke, step,
//! peek) with no other input in between. If the channel is missing or fails, the firmware and clients with a
//! mapped image continue.
//!
//! | part | content |
//! |---|---|
//! | `wire` | operations and replies ([`crate::request`]) as blocks of bytes, with checked decoding |
//! | `server`, [`client`] | the two sides over iceoryx2 |
//! | `bells` | how the two sides wake each other |
//!
//! Rules: an instance has one server and up to `MAX_CLIENTS` clients. A client has only one request in
//! progress and always waits for its reply.

pub(crate) mod bells;
pub mod client;
mod dead_clients;
mod domain;
pub(crate) mod events;
mod guest;
mod header_bells;
mod inherited;
mod limit;
mod passage;
mod run;
pub(crate) mod server;
mod shm;
pub(crate) mod wire;

pub use bells::Bells;
pub use client::{Client, ClientError};
pub use events::{EventListener, EventNotifier};
pub use header_bells::HeaderBells;
pub use server::{ChannelWatch, Server, ServerError, remove_remains};

#[cfg(test)]
mod tests;
