//! Octets of a serial line, without times and lengths, as through an RS485 adapter. Each octet is a character on the
//! line, in the order of the stream.

use super::protocol::{GuestSession, Protocol, TrafficKind};
use super::spec::Carrier;
use super::wire::{Adapter, BadLength, BusMessage};
use crate::profibus::Burst;

/// The protocol of doors to serial lines.
pub(super) struct Octets;

impl Protocol for Octets {
    fn name(&self) -> &'static str {
        "serial"
    }

    fn traffic_kind(&self) -> TrafficKind {
        TrafficKind::Octets
    }

    fn tcp_number(&self) -> u16 {
        5
    }

    fn pty_number(&self) -> Option<u16> {
        Some(6)
    }

    /// The guest takes part at once.
    fn begin(&self, carrier: Carrier, adapter: &mut dyn Adapter) -> Box<dyn GuestSession> {
        adapter.open(false);
        Box::new(Session { loses_unread: matches!(carrier, Carrier::Pty(_)) })
    }
}

/// The emulator's side of a stream of octets. A guest with such a stream cannot request emulated time.
#[derive(Debug)]
struct Session {
    loses_unread: bool,
}

impl GuestSession for Session {
    fn hear(&mut self, bytes: &[u8], adapter: &mut dyn Adapter, _: &mut Vec<u8>) -> Result<(), BadLength> {
        if !bytes.is_empty() {
            // If there is no room for the octets, they are counted as refused.
            adapter.send(BusMessage::Burst(Burst { begin: 0, octets: bytes.to_vec() }));
        }
        Ok(())
    }

    fn grant(&self, _: u64, _: u64, _: &mut Vec<u8>) {}

    fn encode(&self, _: u64, message: &BusMessage, to: &mut Vec<u8>) {
        if let BusMessage::Burst(burst) = message {
            to.extend_from_slice(&burst.octets);
        }
    }

    fn loses_unread(&self) -> bool {
        self.loses_unread
    }
}
