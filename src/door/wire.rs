//! Messages of guests as bytes, by the kind of their door.

use super::slcan;
use super::slcan::{Rate, Status};
use super::spec::Speech;
use super::telegrams;
use crate::can::Frame;
use crate::profibus::Burst;

/// A message through a door.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusMessage {
    /// A frame of CAN.
    Frame(Frame),
    /// Octets at PROFIBUS, with the bit time of their first bit; from a guest 0 is as soon as the line is free.
    Burst(Burst),
}

#[cfg(test)]
impl BusMessage {
    /// A guest's message on PROFIBUS.
    pub(crate) fn burst(octets: Vec<u8>) -> Self {
        Self::Burst(Burst { begin: 0, octets })
    }
}

/// Requests of a guest to the owner of its session.
pub(super) trait Adapter {
    /// Sets the rate, or clears it; `false` while the guest takes part.
    fn set_rate(&mut self, rate: Option<Rate>) -> bool;

    /// Takes part, or only listens.
    fn open(&mut self, listens: bool);

    /// Ends the participation.
    fn close(&mut self);

    /// Sends a message; `false` if the guest does not take part or there is no room.
    fn send(&mut self, said: BusMessage) -> bool;

    /// Asks for a turn after `us` microseconds of emulated time, or when the guest has received something; until then
    /// it sends nothing. `false` if it does not listen, or waits for a turn already.
    fn ask(&mut self, us: u64) -> bool;

    /// Does the same until this bit time of its bus.
    fn ask_until(&mut self, bit: u64) -> bool;

    /// Asks for the status.
    fn take_status(&mut self) -> Status;
}

/// A number of octets that no telegram has: the guest does not speak the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BadLength(pub(super) u16);

/// A guest's end of the protocol of its door.
#[derive(Debug)]
pub(super) enum Session {
    Slcan(slcan::Session),
    Telegrams(telegrams::Session),
}

impl Session {
    /// Begins a session for this protocol. A guest that speaks in telegrams takes part at once.
    pub(super) fn begin(speech: Speech, adapter: &mut impl Adapter) -> Self {
        match speech {
            Speech::Frames => Session::Slcan(slcan::Session::default()),
            Speech::Telegrams => {
                adapter.open(false);
                Session::Telegrams(telegrams::Session::default())
            }
        }
    }

    /// Takes bytes of the guest and appends the answers to `answer`.
    ///
    /// # Errors
    /// [`BadLength`]: the rest of the stream cannot be decoded.
    pub(super) fn hear(
        &mut self,
        bytes: &[u8],
        adapter: &mut impl Adapter,
        answer: &mut Vec<u8>,
    ) -> Result<(), BadLength> {
        match self {
            Session::Slcan(session) => {
                session.hear(bytes, adapter, answer);
                Ok(())
            }
            Session::Telegrams(session) => session.hear(bytes, adapter),
        }
    }

    /// Appends the answer to a request for time, at this emulated time and this bit time.
    pub(super) fn grant(&self, time_us: u64, bit: u64, to: &mut Vec<u8>) {
        match self {
            Session::Slcan(_) => slcan::Session::grant(time_us, to),
            Session::Telegrams(_) => telegrams::tell(&Burst { begin: bit, octets: Vec::new() }, to),
        }
    }

    /// Appends the bytes for a message that has arrived at this emulated time.
    pub(super) fn tell(&self, time_us: u64, said: &BusMessage, to: &mut Vec<u8>) {
        match (self, said) {
            (Session::Slcan(session), BusMessage::Frame(frame)) => session.tell(time_us, frame, to),
            (Session::Telegrams(_), BusMessage::Burst(burst)) => telegrams::tell(burst, to),
            // A bus with other messages has no such door.
            (Session::Slcan(_), BusMessage::Burst(_)) | (Session::Telegrams(_), BusMessage::Frame(_)) => {}
        }
    }
}
