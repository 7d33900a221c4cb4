//! What a soft-PLC needs whatever its device is: the RAM with what is connected to `_BASE`, and a small runner of tasks.
//!
//! The function blocks are the devices' own: [`devices`](crate::devices). They have the manual's names, inputs, outputs
//! and presets, and a `call` for each PLC cycle. What the manual connects to `_BASE` is a [`Base`], declared at its
//! address with [`Ram::at`]. Blocks touch nothing but registers, and of the header page the clock: so they work on the
//! RAM of a plant in this process and on an attached image alike, and monitoring times are in emulated time.
//!
//! A call never waits. A block that needs the firmware's answer goes on at a later call, so that the same
//! program runs in real time and with a stepped clock. The function block page of each device has all inputs and outputs.

mod block;
mod pin;
mod ram;
mod structured_text;
mod tasks;

pub use block::{BlockKind, FunctionBlock, Place, Placed, Shared, Variables, Wire};
pub(crate) use block::{block_kinds, function_block};
pub use pin::{Direction, Pin, PinError, PinType, PinValue};
pub use ram::{Base, Like, Ram};
pub(crate) use ram::{Viewed, Watch};
pub use structured_text::StPart;
pub use tasks::{Program, Progress, RunError, Tasks};
