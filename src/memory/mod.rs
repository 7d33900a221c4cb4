//! The emulated RAM: cells, segments, header page, image files.

pub mod cell;

pub use cell::{Cell8, Cell16, Cell32, SharedRegs};
