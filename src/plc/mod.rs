//! The PLC's side: the vendor's function blocks, and a small runner of tasks.
//!
//! The blocks have the manual's names, inputs, outputs and presets, and a `call` for each PLC cycle. What
//! the manual connects to `_BASE` is a [`Base`], declared at its address with [`Ram::at`]. They touch
//! nothing but registers, and of the header page the clock: so they work on the RAM of a plant in this
//! process and on an attached image alike, and monitoring times are in emulated time.
//!
//! A call never waits. A block that needs the firmware's answer goes on at a later call, so that the same
//! program runs in real time and with a stepped clock. `docs/function-blocks.md` has all inputs and outputs.

#![allow(non_snake_case, non_camel_case_types, reason = "the manual's names, letter for letter")]

mod baps;
mod board;
mod cansync;
mod ram;
mod registers;
mod tasks;

pub use baps::*;
pub use board::{INTR_SET, LED, OPT_INIT, TIME_MEASURE_END, TIME_MEASURE_START};
pub use cansync::*;
pub use ram::{Base, Ram};
pub use tasks::{Program, Progress, RunError, Tasks};
