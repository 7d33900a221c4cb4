//! The channel: a request-response door to a running emulator, for tools and tests.
//!
//! The channel is the second door beside the mapped image. It can do what a map cannot: step the
//! emulated time, wait for a register without missing a change, and do several things in one go
//! (poke, step, peek) so that nothing happens in between. If it is missing or fails, firmware and mapped
//! clients go on.
//!
//! | part | content |
//! |---|---|
//! | [`wire`] | operations and replies ([`crate::request`]) as blocks of bytes, and the way back from hostile ones |
//! | [`server`], [`client`] | the two ends over iceoryx2 |
//! | [`bells`] | how the two ends wake each other |
//!
//! Rules: one server per instance; up to [`server::MAX_CLIENTS`] clients; a client has one request under way and
//! always waits for its reply.

pub mod bells;
pub mod client;
mod departed;
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
