//! The channel: a request-response interface to a running emulator, for tools and tests.
//!
//! The channel is the second interface beside the mapped image. It has functions that a map does not have: it
//! advances the emulated time, waits for a register without missing a change, and executes several operations in one
//! step (poke, step, peek) with no other input in between. If it is missing or fails, firmware and mapped clients
//! continue.
//!
//! | part | content |
//! |---|---|
//! | [`wire`] | operations and replies ([`crate::request`]) as blocks of bytes, with checked decoding |
//! | [`server`], [`client`] | the two sides over iceoryx2 |
//! | [`bells`] | how the two sides wake each other |
//!
//! Rules: one server per instance; up to [`server::MAX_CLIENTS`] clients; a client has one request under way and
//! always waits for its reply.

pub mod bells;
pub mod client;
mod dead_clients;
mod domain;
pub mod events;
mod guest;
mod header_bells;
mod limit;
mod passage;
mod run;
pub mod server;
mod shm;
pub mod wire;

pub use bells::Bells;
pub use client::{Client, ClientError};
pub use events::{EventListener, EventNotifier};
pub use header_bells::HeaderBells;
pub use server::{ChannelWatch, Server, ServerError, remove_remains};

#[cfg(test)]
mod tests;
