//! Programs that attach to an emulator through shared memory.

#[path = "../../tools/benches/support/active.rs"]
mod active;
#[path = "../common/mod.rs"]
mod common;

mod attach_contract;
mod bm4;
mod events;
mod federate;
mod lockstep;
mod novram;
mod novram_kill;
