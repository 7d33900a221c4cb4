//! PROFIBUS telegrams over a serial line, as with an RS-485 adapter: octets without times and lengths. A telegram
//! begins with a start delimiter, and its first octets define its length.

use super::protocol::GuestSession;
use super::wire::{Adapter, BadLength, BusMessage};
use crate::profibus::{self, Burst};

/// The emulator's side of a serial line to a guest. A guest on such a line cannot request emulated time.
#[derive(Debug, Default)]
pub(super) struct Session {
    /// Octets of a telegram that is not complete yet.
    begun: Vec<u8>,
}

impl GuestSession for Session {
    fn hear(&mut self, bytes: &[u8], adapter: &mut dyn Adapter, _: &mut Vec<u8>) -> Result<(), BadLength> {
        self.begun.extend_from_slice(bytes);
        while let Some(count) = profibus::octets_of_first(&self.begun) {
            let octets: Vec<u8> = self.begun.drain(..count).collect();
            // If there is no room for the telegram, it is counted as refused.
            adapter.send(BusMessage::Burst(Burst { begin: 0, octets }));
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
        true
    }
}
