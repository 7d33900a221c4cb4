//! What federates tell each other.

use crate::channel::wire::WireOp;
use crate::plant::Stored;
use crate::request::Op;
use serde::{Deserialize, Serialize};
use zerocopy::{FromBytes, IntoBytes};

/// What a federate says.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Message {
    /// It is there.
    Hello(Hello),
    /// It has its turn, and waits for somebody.
    Alive,
    /// Its turn has ended.
    Turn(Turn),
    /// It ends; with a reason, if it has failed.
    Bye(Option<String>),
}

/// Who is there, and with what.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Hello {
    pub(super) version: String,
    /// How many there are.
    pub(super) count: u8,
    pub(super) follows: bool,
    /// Emulated time from one exchange with other simulators to the next, if it has any.
    pub(super) exchange_us: Option<u64>,
    /// Of its plant, see `Plant::is_like`.
    pub(super) plant: Vec<u8>,
}

/// What has entered in a turn, and until when it has nothing more to say.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Turn {
    /// Emulated time of the turn.
    pub(super) now: u64,
    pub(super) inputs: Vec<Input>,
    /// Hash of its journal behind that.
    pub(super) hash: u64,
    /// Until when time may pass as far as it is concerned.
    pub(super) want: u64,
    /// Of each device the events at which it wants to have a turn, bit n for event n.
    pub(super) watched: Vec<u16>,
}

/// What enters a plant from outside.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Input {
    /// An operation that was executed, as the channel carries it.
    Op([u8; size_of::<WireOp>()]),
    /// A store of a program that has mapped an image.
    Stored(Stored),
    /// The boards have answered what they were asked.
    Boards,
    /// What became of a task in lockstep: device, event, code of the state.
    Task(u16, u16, u32),
    /// A motor that a model turns: number of the drive, and speed; none: it does what the drive demands.
    Shaft(u16, Option<i32>),
}

impl Input {
    pub(super) fn of(op: &Op) -> Self {
        let mut bytes = [0; size_of::<WireOp>()];
        bytes.copy_from_slice(WireOp::from(op).as_bytes());
        Input::Op(bytes)
    }

    /// The operation that stands in these bytes.
    pub(super) fn op(bytes: &[u8]) -> Option<Op> {
        Op::try_from(WireOp::read_from_bytes(bytes).ok()?).ok()
    }
}

impl Message {
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        // Into a vector, writing cannot fail.
        postcard::to_allocvec(self).unwrap_or_default()
    }

    pub(super) fn of_bytes(bytes: &[u8]) -> Option<Self> {
        let (message, rest) = postcard::take_from_bytes(bytes).ok()?;
        rest.is_empty().then_some(message)
    }
}
