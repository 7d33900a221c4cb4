//! Messages through doors, and the requests of guests.

use super::slcan::{Rate, Status};
use crate::can::Frame;
use crate::profibus::Burst;

/// A message through a door.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusMessage {
    /// A frame of CAN.
    Frame(Frame),
    /// Octets on PROFIBUS, with the bit time of their first bit. A guest that wants to send as soon as the line is free
    /// gives the bit time 0. Octets on a serial line have no time.
    Burst(Burst),
}

impl BusMessage {
    /// Number of octets on the bus; 0 for a frame of CAN.
    pub(super) fn octets(&self) -> usize {
        match self {
            BusMessage::Frame(_) => 0,
            BusMessage::Burst(burst) => burst.octets.len(),
        }
    }
}

#[cfg(test)]
impl BusMessage {
    /// Creates a message of a guest on PROFIBUS.
    pub(crate) fn burst(octets: Vec<u8>) -> Self {
        Self::Burst(Burst { begin: 0, octets })
    }
}

/// Requests of a guest. The session passes them to its owner.
pub(super) trait Adapter {
    /// Sets the rate, or clears it. Returns false while the guest takes part, because the rate is then fixed.
    fn set_rate(&mut self, rate: Option<Rate>) -> bool;

    /// Connects the guest to the bus. With `listens`, it only listens.
    fn open(&mut self, listens: bool);

    /// Disconnects the guest from the bus.
    fn close(&mut self);

    /// Sends a message. Returns false if the guest does not take part or if there is no room.
    fn send(&mut self, message: BusMessage) -> bool;

    /// Asks for a turn after `us` microseconds of emulated time, or when the guest has received something. The guest
    /// sends nothing until then. Returns false if the guest does not listen, or if it already waits for a turn.
    fn ask(&mut self, us: u64) -> bool;

    /// Requests a turn like [`Adapter::ask`], but at this bit time of the guest's bus.
    fn ask_until(&mut self, bit: u64) -> bool;

    /// Returns the status. The next status reports only frames that are missed after this call.
    fn take_status(&mut self) -> Status;
}

/// An impossible number of octets in a telegram: the guest does not use the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BadLength(pub(super) u16);
