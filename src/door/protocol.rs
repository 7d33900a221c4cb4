//! Protocols of doors: a file for each, and a line in [`PROTOCOLS`].

use super::spec::Carrier;
use super::wire::{Adapter, BadLength, BusMessage};
use super::{slcan, telegrams};
use core::fmt;

/// The kind of messages that a bus and the protocol of its doors have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrafficKind {
    /// Frames of CAN.
    Frames,
    /// Telegrams of PROFIBUS.
    Telegrams,
}

impl fmt::Display for TrafficKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            TrafficKind::Frames => "CAN",
            TrafficKind::Telegrams => "PROFIBUS",
        })
    }
}

/// A protocol of doors.
pub(super) trait Protocol: Sync {
    /// Name at the beginning of the names of its doors: `slcan` gives `slcan-tcp`.
    fn name(&self) -> &'static str;

    /// The kind of messages, which decides on which buses such a door can be.
    fn traffic_kind(&self) -> TrafficKind;

    /// Number of its doors over TCP on the channel. The numbers of all doors differ, are not 0, and never change.
    fn tcp_number(&self) -> u16;

    /// The same for its doors over a pseudo-terminal; `None` if it has no such doors.
    fn pty_number(&self) -> Option<u16> {
        None
    }

    /// Begins the session of a guest over this carrier.
    fn begin(&self, carrier: Carrier, adapter: &mut dyn Adapter) -> Box<dyn GuestSession>;
}

/// A guest's end of the protocol of its door.
pub(super) trait GuestSession: fmt::Debug + Send {
    /// Takes bytes of the guest and appends the answers to `answer`.
    ///
    /// # Errors
    /// [`BadLength`]: the rest of the stream cannot be decoded.
    fn hear(
        &mut self,
        bytes: &[u8],
        adapter: &mut dyn Adapter,
        answer: &mut Vec<u8>,
    ) -> Result<(), BadLength>;

    /// Appends the answer to a request for time, at this emulated time and this bit time.
    fn grant(&self, time_us: u64, bit: u64, to: &mut Vec<u8>);

    /// Appends the bytes for a message that has arrived at this emulated time. A message of another kind of bus has no
    /// bytes; a bus with such messages has no such door.
    fn encode(&self, time_us: u64, message: &BusMessage, to: &mut Vec<u8>);

    /// Whether bytes that the guest does not read in time are lost, as in the receiver of a serial adapter.
    fn loses_unread(&self) -> bool {
        false
    }
}

/// All protocols, in the order in which messages name them.
pub(super) static PROTOCOLS: [&dyn Protocol; 2] = [&slcan::Slcan, &telegrams::Telegrams];

/// The doors that exist, for messages: `slcan-tcp:127.0.0.1:0 (0: any port) and slcan-pty at CAN`.
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

/// The names of the doors on buses of this kind, for messages: `slcan-tcp or slcan-pty`.
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
    }
}
