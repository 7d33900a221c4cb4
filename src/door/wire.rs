//! Messages through doors, and the requests of guests.

use super::slcan::{Rate, Status};
use crate::can::Frame;
use crate::profibus::Burst;

/// A message through a door.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusMessage {
    /// A frame of CAN.
    Frame(Frame),
    /// Octets on PROFIBUS, with the bit time of their first bit; from a guest 0 is as soon as the line is free.
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
    fn send(&mut self, message: BusMessage) -> bool;

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
