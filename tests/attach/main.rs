//! Programs that attach to an emulator through shared memory.

#[cfg(feature = "channel")]
#[path = "../../tools/benches/support/active.rs"]
mod active;
#[path = "../common/mod.rs"]
mod common;

mod attach_contract;
mod bm4;
mod events;
#[cfg(feature = "channel")]
mod federate;
mod lockstep;
mod novram;
mod novram_kill;
