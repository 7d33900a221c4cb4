//! The channel: a request-response door to a running emulator, for tools and tests.
//!
//! The channel is the second door beside the mapped image. It can do what a map cannot: step the
//! emulated time, wait for a register without missing a change, and do several things in one go
//! (poke, step, peek) so that nothing happens in between. If it is missing or fails, firmware and mapped
//! clients go on.
//!
//! | part | content |
//! |---|---|
//! | [`op`] | the operations and replies as plain Rust |
//! | [`wire`] | the same as fixed-width integers, and the way back from hostile bytes |
//! | [`exec`] | runs a request against a [`Machine`]; knows no iceoryx2 |
//! | [`server`], [`client`] | the two ends over iceoryx2 |
//! | [`bells`] | how the two ends wake each other |
//!
//! Rules: one server per instance; up to [`server::MAX_CLIENTS`] clients; a client has one request under way and
//! always waits for its reply; operations of one request run in order and stop at the first error.

pub mod bells;
pub mod client;
mod domain;
pub mod error;
pub mod events;
pub mod exec;
mod header_bells;
mod machine;
pub mod op;
pub mod server;
mod shm;
#[cfg(test)]
mod testing;
pub mod wire;

pub use crate::memory::Unmapped;
pub use bells::Bells;
pub use client::{Client, ClientError};
pub use error::ChannelError;
pub use events::{EventListener, EventNotifier};
pub use header_bells::HeaderBells;
pub use machine::Machine;
pub use op::{InstanceInfo, Op, Reply};
pub use server::{Server, ServerError, remove_remains};

#[cfg(test)]
mod tests;
