//! The meaning of the data bytes of CANsync frames (manual 5.00005.03a p. 136-143).
//!
//! To send a frame, build the value ([`ActionCommand`], [`ParameterJob`], [`UpDownJob`] or an `answer` to a
//! job) and take its `frame`. To receive a frame, use
//! [`Frame::kind`](crate::devices::cansync::frames::Frame::kind) to select the `decode` function. An answer
//! is decoded together with its job. [`decode`] decodes any frame for a trace.

pub(crate) mod action;
mod decoded;
mod error;
pub(crate) mod parameter;
pub(crate) mod process;
pub(crate) mod updown;

pub use action::{Action, ActionCommand};
pub use decoded::{DecodedFrame, decode, is_up_download};
pub use error::CodecError;
pub use parameter::{Access, ParameterJob, ParameterResponse, ParameterResult};
pub use process::{Built, FrameConfig, WordConfig};
pub use updown::{Direction, UpDownJob, UpDownResponse, UpDownResult, UpDownStep};
