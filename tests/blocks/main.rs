//! The vendor's function blocks, alone and as the manual's configuration examples.

#[path = "../rig/mod.rs"]
mod rig;

mod bench;
mod configurations;
mod function_blocks;
mod played;
