//! What the data bytes of CANsync frames mean (manual 5.00005.03a p. 136-143).
//!
//! Sending: build the value ([`ActionCommand`], [`ParameterJob`], [`UpDownJob`] or an `answer` to a job)
//! and take its `frame`. Receiving: [`Frame::kind`](crate::devices::cansync::bus::Frame::kind) says which `decode` to call;
//! an answer is read together with its job. [`decode`] takes any frame apart for a trace.

pub mod action;
mod decoded;
mod error;
pub mod parameter;
pub mod process;
pub mod updown;

pub use action::{Action, ActionCommand};
pub use decoded::{Decoded, decode, is_up_download};
pub use error::CodecError;
pub use parameter::{Access, ParameterJob, ParameterResponse, ParameterResult};
pub use process::{Built, FrameConfig, WordConfig};
pub use updown::{Direction, UpDownJob, UpDownResponse, UpDownResult, UpDownStep};
