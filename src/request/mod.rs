//! Requests: the only interface to an emulator.
//!
//! An operation is a value of [`Op`]. [`Execution`] executes it on a [`Host`], which runs a plant, and returns a
//! [`Reply`] or [`Refused`]. This module does not define how a request reaches the host: a scenario calls [`Execution`]
//! in its own process, and the channel carries operations and replies between processes.
//!
//! The operations of a request run in order; after the first refusal the remaining operations are not executed. With a
//! stepped clock, earlier requests in the header pages are answered first ([`Host::begin_request`]).

mod description;
mod exec;
mod forms;
mod host;
pub(crate) mod json;
mod naming;
mod op;
pub(crate) mod ops;
mod out_of_range;
mod part;
mod refused;
mod register;
pub(crate) mod replies;
mod reply;
#[cfg(test)]
pub(crate) mod testing;
mod travel;

pub use description::describe;
#[cfg(feature = "cli")]
pub(crate) use description::{Answer, Operation, answers, operations};
pub use exec::Execution;
pub use host::Host;
#[cfg(feature = "cli")]
pub(crate) use op::Class;
#[cfg(feature = "script")]
pub(crate) use op::ranges;
pub use op::{FilePart, MAX_ADVANCE_US, MAX_CONDITIONS, MAX_OPS, MAX_RANGE, MAX_RECORDS, MAX_SPEED, Op};
pub use part::{JournalPart, read_journal};
pub use refused::{Code, Refused};
pub use reply::{
    BusScene, BusState, DriveEntry, InstanceInfo, RateMismatch, Reply, Station, Waited, WrongReply,
};
pub use travel::Travel;
