//! Messages between federates.

use crate::channel::wire::WireOp;
use crate::identity::DeviceIndex;
use crate::plant::Stored;
use crate::request::Op;
use serde::{Deserialize, Serialize};
use zerocopy::{FromBytes, IntoBytes};

/// A message from one federate to all others.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Message {
    /// The federate has joined.
    Hello(Hello),
    /// The federate has the turn and is still working or waiting.
    Alive,
    /// The federate ends its turn.
    Turn(Turn),
    /// The federate ends; with a reason if it failed.
    Bye(Option<String>),
}

/// Settings of a federate, which each other federate compares with its own settings.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Hello {
    pub(super) version: String,
    /// Number of federates for which the sender was started.
    pub(super) count: u8,
    pub(super) follows: bool,
    /// Emulated time between two exchanges with other simulators, if the federate has any.
    pub(super) exchange_us: Option<u64>,
    /// Description of the plant, see `Plant::is_like`.
    pub(super) plant: Vec<u8>,
}

/// The input of a turn, and the time up to which the sender permits the clock to advance.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Turn {
    /// Emulated time of the turn, in microseconds.
    pub(super) now: u64,
    pub(super) inputs: Vec<Input>,
    /// Hash of the sender's journal after the inputs.
    pub(super) hash: u64,
    /// Emulated time before which the sender has no further input, in microseconds.
    pub(super) want: u64,
    /// For each device, the events at which the sender needs a turn: bit n for event n.
    pub(super) watched: Vec<u16>,
}

/// Input that enters a plant from outside.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Input {
    /// An executed operation, in the format of the channel.
    Op([u8; size_of::<WireOp>()]),
    /// A store of a program that maps an image.
    Stored(Stored),
    /// The boards have answered the pending requests.
    Boards,
    /// New state of a task in lockstep: index of the device, event, code of the state.
    Task(DeviceIndex, u16, u32),
    /// Speed of a motor, set by a client that simulates the load: number of the drive, and speed. `None`: the motor
    /// follows the drive again.
    Shaft(u16, Option<i32>),
}

impl Input {
    pub(super) fn of(op: &Op) -> Self {
        let mut bytes = [0; size_of::<WireOp>()];
        bytes.copy_from_slice(WireOp::from(op).as_bytes());
        Input::Op(bytes)
    }

    /// Decodes an operation of a client.
    pub(super) fn op(bytes: &[u8]) -> Option<Op> {
        Op::try_from(WireOp::read_from_bytes(bytes).ok()?).ok()
    }
}

impl Message {
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        // Writing into a vector cannot fail.
        postcard::to_allocvec(self).unwrap_or_default()
    }

    pub(super) fn of_bytes(bytes: &[u8]) -> Option<Self> {
        let (message, rest) = postcard::take_from_bytes(bytes).ok()?;
        rest.is_empty().then_some(message)
    }
}
