//! Protocols of doors. Each protocol has its own file, and a line in [`PROTOCOLS`].

use super::spec::Carrier;
use super::wire::{Adapter, BadLength, BusMessage};
use super::{octets, slcan, telegrams};
use core::fmt;

/// Kind of messages. A bus and the protocol of its doors must have the same kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrafficKind {
    /// The messages are frames of CAN.
    Frames,
    /// The messages are telegrams of PROFIBUS.
    Telegrams,
    /// The messages are octets of a serial line.
    Octets,
}

impl fmt::Display for TrafficKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            TrafficKind::Frames => "CAN",
            TrafficKind::Telegrams => "PROFIBUS",
            TrafficKind::Octets => "serial lines",
        })
    }
}

/// A protocol of doors.
pub(super) trait Protocol: Sync {
    /// Returns the name of the protocol. The names of its doors begin with this name: `slcan` gives `slcan-tcp`.
    fn name(&self) -> &'static str;

    /// Kind of messages. It decides on which buses the protocol's doors can be.
    fn traffic_kind(&self) -> TrafficKind;

    /// Returns the number by which requests of the channel name a TCP door of this protocol. Each kind of
    /// door has another number. The number is not 0 and never changes.
    fn tcp_number(&self) -> u16;

    /// Returns the number by which requests of the channel name a pseudo-terminal door of this protocol;
    /// `None` if the protocol has no such doors.
    fn pty_number(&self) -> Option<u16> {
        None
    }

    /// True if a message without room is refused with an error answer. In other protocols the further messages of the
    /// guest wait in its connection, because the guest would not learn that they are lost.
    fn answers_refusals(&self) -> bool {
        false
    }

    /// Begins the session of a guest over this carrier.
    fn begin(&self, carrier: Carrier, adapter: &mut dyn Adapter) -> Box<dyn GuestSession>;
}

/// The emulator's side of the protocol for a guest.
pub(super) trait GuestSession: fmt::Debug + Send {
    /// Interprets bytes from the guest and appends the answers to `answer`.
    ///
    /// # Errors
    /// [`BadLength`], if the rest of the stream cannot be decoded.
    fn hear(
        &mut self,
        bytes: &[u8],
        adapter: &mut dyn Adapter,
        answer: &mut Vec<u8>,
    ) -> Result<(), BadLength>;

    /// Appends the answer to a request for time. The present time is given as emulated time and as bit time.
    fn grant(&self, time_us: u64, bit: u64, to: &mut Vec<u8>);

    /// Appends the bytes for a message that has arrived at this emulated time. Appends nothing if the message is of
    /// another kind. This does not occur, because a bus with another kind of messages has no doors of this protocol.
    fn encode(&self, time_us: u64, message: &BusMessage, to: &mut Vec<u8>);

    /// True if bytes that the guest does not read in time are lost, as in the receiver of a serial adapter.
    fn loses_unread(&self) -> bool {
        false
    }
}

/// All protocols, in the order in which error messages list them.
pub(super) static PROTOCOLS: [&dyn Protocol; 3] = [&slcan::Slcan, &telegrams::Telegrams, &octets::Octets];

/// Lists all kinds of doors, for error messages: `slcan-tcp:127.0.0.1:0 (0: any port) and slcan-pty at CAN`.
pub(super) fn known_doors() -> String {
    let mut known = Vec::new();
    for (index, protocol) in PROTOCOLS.iter().enumerate() {
        let name = protocol.name();
        let any_port = if index == 0 { " (0: any port)" } else { "" };
        let pty = protocol.pty_number().map_or_else(String::new, |_| format!(" and {name}-pty"));
        known.push(format!("{name}-tcp:127.0.0.1:0{any_port}{pty} at {}", protocol.traffic_kind()));
    }
    known.join(", ")
}

/// Lists the kinds of doors that a bus with this kind of messages can have, for error messages: `slcan-tcp or
/// slcan-pty`.
#[must_use]
pub fn doors_of(traffic_kind: TrafficKind) -> String {
    let mut names = Vec::new();
    for protocol in PROTOCOLS.iter().filter(|protocol| protocol.traffic_kind() == traffic_kind) {
        names.push(format!("{}-tcp", protocol.name()));
        names.extend(protocol.pty_number().map(|_| format!("{}-pty", protocol.name())));
    }
    names.join(" or ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn protocols_have_separate_names_and_numbers() {
        let names: HashSet<_> = PROTOCOLS.iter().map(|protocol| protocol.name()).collect();
        assert_eq!(names.len(), PROTOCOLS.len());
        let numbers = PROTOCOLS.iter().flat_map(|it| [Some(it.tcp_number()), it.pty_number()]).flatten();
        let numbers: Vec<_> = numbers.collect();
        assert!(!numbers.contains(&0), "{numbers:?}");
        assert_eq!(numbers.iter().collect::<HashSet<_>>().len(), numbers.len(), "{numbers:?}");
    }

    #[test]
    fn messages_name_the_doors_of_a_bus() {
        assert_eq!(doors_of(TrafficKind::Frames), "slcan-tcp or slcan-pty");
        assert_eq!(doors_of(TrafficKind::Telegrams), "profibus-tcp or profibus-pty");
        assert_eq!(doors_of(TrafficKind::Octets), "serial-tcp or serial-pty");
    }
}
