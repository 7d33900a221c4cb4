//! What the data bytes of CANsync frames mean (manual 5.00005.03a p. 136-143).

pub mod action;
mod error;
pub mod parameter;
pub mod process;

pub use action::{Action, ActionCommand};
pub use error::CodecError;
pub use parameter::{Access, ParameterJob, ParameterResponse, ParameterResult};
pub use process::{Built, FrameConfig, WordConfig};
