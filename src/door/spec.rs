//! Specifications of doors: `slcan-tcp:127.0.0.1:0`, `slcan-pty`, `profibus-tcp:127.0.0.1:0`, `profibus-pty`,
//! `serial-tcp:127.0.0.1:0`, `serial-pty`.

use super::protocol::{PROTOCOLS, Protocol, TrafficKind, known_doors};
use core::fmt;
use core::str::FromStr;
use serde::{Deserialize, Serialize};
use std::net::SocketAddrV4;

/// Specification of a door. A request for a door may leave the TCP port or the number of the pseudo-terminal open.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct DoorSpec {
    /// Index of the protocol in [`PROTOCOLS`].
    protocol: u8,
    carrier: Carrier,
}

/// Transport of the bytes between emulator and guest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Carrier {
    /// TCP, with the address at which the door listens. Port 0 requests any free port.
    Tcp(SocketAddrV4),
    /// A pseudo-terminal, with the number in its name `/dev/pts/…`. A request for a door has no number yet.
    Pty(Option<u32>),
}

/// Directory of the pseudo-terminals of the system.
const PTS: &str = "/dev/pts/";

/// A text that does not specify a door.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BadDoor {
    /// There is no such kind of door.
    #[error("there is no door `{text}`; doors are {}", known_doors())]
    Unknown {
        /// Text that should specify a door.
        text: String,
    },
    /// The text has no address.
    #[error("`{text}` names no IPv4 address with a port; write for example {kind}:127.0.0.1:0 (0: any port)")]
    NoAddress {
        /// Text that should specify a door with an address.
        text: String,
        /// Kind of the door: the text before the first colon.
        kind: String,
    },
    /// Other machines can reach the address.
    #[error(
        "`{text}` would let anybody in the network take part; use an address of 127.0.0.0/8, or write {anybody} if that is \
         wanted"
    )]
    NotLoopback {
        /// Text with an address that other machines can reach.
        text: String,
        /// Kind of door that may have such an address.
        anybody: String,
    },
}

impl FromStr for DoorSpec {
    type Err = BadDoor;

    fn from_str(text: &str) -> Result<Self, BadDoor> {
        let (kind, rest) = match text.split_once(':') {
            Some((kind, rest)) => (kind, Some(rest)),
            None => (text, None),
        };
        let unknown = || BadDoor::Unknown { text: text.to_owned() };
        let found = (0..).zip(PROTOCOLS).find_map(|(index, protocol)| {
            let way = kind.strip_prefix(protocol.name())?;
            (way != "-pty" || protocol.pty_number().is_some()).then_some((index, way))
        });
        let (protocol, way) = found.ok_or_else(unknown)?;
        let carrier = match (way, rest) {
            ("-tcp" | "-tcp-anybody", _) => {
                let at = rest.and_then(|at| at.parse().ok());
                let no_address = || BadDoor::NoAddress { text: text.to_owned(), kind: kind.to_owned() };
                let at: SocketAddrV4 = at.ok_or_else(no_address)?;
                if way == "-tcp" && !at.ip().is_loopback() {
                    let anybody = format!("{kind}-anybody");
                    return Err(BadDoor::NotLoopback { text: text.to_owned(), anybody });
                }
                Carrier::Tcp(at)
            }
            ("-pty", None) => Carrier::Pty(None),
            ("-pty", Some(path)) => {
                let number = path.strip_prefix(PTS).and_then(|number| number.parse().ok());
                Carrier::Pty(Some(number.ok_or_else(unknown)?))
            }
            _ => return Err(unknown()),
        };
        Ok(DoorSpec { protocol, carrier })
    }
}

impl TryFrom<String> for DoorSpec {
    type Error = BadDoor;

    fn try_from(text: String) -> Result<Self, BadDoor> {
        text.parse()
    }
}

impl From<DoorSpec> for String {
    fn from(door: DoorSpec) -> String {
        door.to_string()
    }
}

impl DoorSpec {
    /// Returns the door of the kind with this number in requests of the channel. A door over TCP gets the address `at`, a
    /// door over a pseudo-terminal gets the number `pty`. `None` if no kind of door has this number.
    #[must_use]
    pub fn of_number(number: u16, at: SocketAddrV4, pty: Option<u32>) -> Option<Self> {
        (0..).zip(PROTOCOLS).find_map(|(index, protocol)| {
            let carrier = match number {
                _ if number == protocol.tcp_number() => Carrier::Tcp(at),
                _ if Some(number) == protocol.pty_number() => Carrier::Pty(pty),
                _ => return None,
            };
            Some(DoorSpec { protocol: index, carrier })
        })
    }

    /// Returns the number by which requests of the channel name this kind of door.
    #[must_use]
    pub fn number(self) -> u16 {
        let protocol = self.protocol();
        match self.carrier {
            Carrier::Tcp(_) => protocol.tcp_number(),
            // A protocol without this number has no doors over a pseudo-terminal, so 0 does not occur.
            Carrier::Pty(_) => protocol.pty_number().unwrap_or_default(),
        }
    }

    /// Protocol of the door.
    pub(super) fn protocol(self) -> &'static dyn Protocol {
        PROTOCOLS[usize::from(self.protocol)]
    }

    /// Kind of messages of the door's protocol.
    #[must_use]
    pub fn traffic_kind(self) -> TrafficKind {
        self.protocol().traffic_kind()
    }

    /// Transport of the bytes between emulator and guest.
    #[must_use]
    pub const fn carrier(self) -> Carrier {
        self.carrier
    }

    /// Returns the address at which the door listens, if it is a door over TCP.
    #[must_use]
    pub const fn address(self) -> Option<SocketAddrV4> {
        match self.carrier {
            Carrier::Tcp(at) => Some(at),
            Carrier::Pty(_) => None,
        }
    }

    /// Returns a door with the same protocol and this carrier.
    pub(super) const fn over(self, carrier: Carrier) -> Self {
        DoorSpec { carrier, ..self }
    }
}

/// The form must not change, because snapshots compare the settings of a plant in it: `SlcanTcp { at: 127.0.0.1:0 }`.
impl fmt::Debug for DoorSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.protocol().name();
        let name = name[..1].to_uppercase() + &name[1..];
        match self.carrier {
            Carrier::Tcp(at) => f.debug_struct(&format!("{name}Tcp")).field("at", &at).finish(),
            Carrier::Pty(number) => f.debug_struct(&format!("{name}Pty")).field("number", &number).finish(),
        }
    }
}

impl fmt::Display for DoorSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.protocol().name();
        match self.carrier {
            Carrier::Tcp(at) if at.ip().is_loopback() => write!(f, "{name}-tcp:{at}"),
            Carrier::Tcp(at) => write!(f, "{name}-tcp-anybody:{at}"),
            Carrier::Pty(Some(number)) => write!(f, "{name}-pty:{PTS}{number}"),
            Carrier::Pty(None) => write!(f, "{name}-pty"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doors_read_as_they_are_written() {
        for text in [
            "slcan-tcp:127.0.0.1:0",
            "slcan-tcp-anybody:0.0.0.0:4000",
            "slcan-pty",
            "slcan-pty:/dev/pts/7",
            "profibus-tcp:127.0.0.2:0",
            "profibus-tcp-anybody:0.0.0.0:4000",
            "profibus-pty",
            "profibus-pty:/dev/pts/9",
            "serial-tcp:127.0.0.1:4000",
            "serial-pty",
        ] {
            let door: DoorSpec = text.parse().unwrap();
            assert_eq!(door.to_string(), text);
        }
        // The kind of door that other machines may reach can also have a local address.
        let few: DoorSpec = "slcan-tcp-anybody:127.0.0.1:5".parse().unwrap();
        assert_eq!(few.to_string(), "slcan-tcp:127.0.0.1:5");
    }

    #[test]
    fn only_this_machine_gets_in_by_default() {
        for at in ["0.0.0.0:0", "192.168.0.7:4000", "8.8.8.8:1"] {
            for kind in ["slcan-tcp", "profibus-tcp", "serial-tcp"] {
                let refusal = format!("{kind}:{at}").parse::<DoorSpec>().unwrap_err();
                assert!(matches!(refusal, BadDoor::NotLoopback { .. }), "{refusal}");
                assert!(refusal.to_string().contains(&format!("write {kind}-anybody")), "{refusal}");
            }
        }
    }

    #[test]
    fn invalid_doors_are_refused() {
        for text in
            ["", "slcan", "slcan-udp:1.2.3.4:5", "slcan-pty:7", "slcan-pty:/dev/pts/x", "profibus-udp"]
        {
            let refusal = text.parse::<DoorSpec>().unwrap_err();
            assert!(matches!(refusal, BadDoor::Unknown { .. }), "{text}: {refusal}");
        }
        for text in [
            "slcan-tcp",
            "slcan-tcp:",
            "slcan-tcp:localhost:5",
            "slcan-tcp:127.0.0.1",
            "slcan-tcp:[::1]:5",
            "profibus-tcp:1",
        ] {
            let refusal = text.parse::<DoorSpec>().unwrap_err();
            assert!(matches!(refusal, BadDoor::NoAddress { .. }), "{text}: {refusal}");
        }
    }
}
