//! The function blocks of the Omega Drive-Line II, with what a program needs beside them.

#![allow(non_snake_case, non_camel_case_types, reason = "the manual's names, letter for letter")]

mod baps;
mod board;

pub use crate::devices::cansync::blocks::*;
pub use crate::plc::{Base, Program, Progress, Ram, RunError, Tasks};
pub use baps::*;
pub use board::{INTR_SET, LED, OPT_INIT, TIME_MEASURE_END, TIME_MEASURE_START};
