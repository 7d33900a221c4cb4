//! The vendor's function blocks, alone and as the manual's configuration examples.

#![allow(clippy::duplicate_mod, reason = "`cansync` is there for each device")]
#![allow(non_snake_case, reason = "the manuals' names, letter for letter")]

#[path = "../rig/mod.rs"]
mod rig;

mod bench;
mod bm4;
mod configurations;
mod cs0015;
mod function_blocks;
mod omega;
mod serial;
mod serial_uss;
