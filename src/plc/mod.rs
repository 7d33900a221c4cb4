//! A soft-PLC for any device: access to the RAM, the structures that function blocks get at their pin `_BASE`, and a
//! small runner of tasks.
//!
//! Each device has its own function blocks, in its module of [`devices`](crate::devices). Names, inputs,
//! outputs and presets come from the manual. A program calls `call` of a block in each PLC cycle. A structure
//! that the manual connects to `_BASE` is a [`Base`], which [`Ram::at`] declares at its address. Blocks
//! access only registers and the clock in the header page, so they work in the same way on the RAM of a plant
//! in this process and on an attached image. Monitoring times are in emulated time.
//!
//! A call never waits. A block that needs the firmware's answer continues at a later call, so that the same program
//! runs in real time and with a stepped clock. The function block page of each device has all inputs and outputs.

mod block;
mod pin;
mod ram;
mod structured_text;
mod tasks;

pub use block::{BlockContext, BlockInstance, BlockKind, FunctionBlock, Shared, Variables, Wire};
pub(crate) use block::{block_kinds, function_block};
pub use pin::{Direction, Pin, PinError, PinType, PinValue};
pub use ram::{Base, Like, Ram};
pub(crate) use ram::{Viewed, Watch};
pub use structured_text::StPart;
pub use tasks::{Program, Progress, RunError, Tasks};
