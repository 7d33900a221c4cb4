//! Specifications of doors: `slcan-tcp:127.0.0.1:0`, `slcan-pty`, `profibus-tcp:127.0.0.1:0`.

use core::fmt;
use core::str::FromStr;
use serde::{Deserialize, Serialize};
use std::net::SocketAddrV4;

/// A door, as requested or as open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub enum DoorSpec {
    /// SLCAN over TCP.
    SlcanTcp {
        /// Address that it listens at. Port 0 requests any port.
        at: SocketAddrV4,
    },
    /// SLCAN over a pseudo-terminal.
    SlcanPty {
        /// For an open door: its number below `/dev/pts`.
        number: Option<u32>,
    },
    /// PROFIBUS telegrams over TCP.
    ProfibusTcp {
        /// Address that it listens at. Port 0 requests any port.
        at: SocketAddrV4,
    },
}

/// The protocol of a door.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speech {
    /// Frames of CAN.
    Frames,
    /// Telegrams of PROFIBUS.
    Telegrams,
}

/// A kind of doors over TCP.
struct Tcp {
    /// Name of a door that only programs on this machine can reach.
    name: &'static str,
    /// Name of the same door for the whole network.
    anybody: &'static str,
    /// The door that listens here.
    door: fn(SocketAddrV4) -> DoorSpec,
}

/// The TCP doors.
const TCP: [Tcp; 2] = [
    Tcp { name: "slcan-tcp", anybody: "slcan-tcp-anybody", door: |at| DoorSpec::SlcanTcp { at } },
    Tcp { name: "profibus-tcp", anybody: "profibus-tcp-anybody", door: |at| DoorSpec::ProfibusTcp { at } },
];
/// Name of a pseudo-terminal.
const PTY: &str = "slcan-pty";
/// Directory of pseudo-terminals.
const PTS: &str = "/dev/pts/";

/// A text that names no door.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BadDoor {
    /// The kind of door does not exist.
    #[error(
        "there is no door `{text}`; doors are slcan-tcp:127.0.0.1:0 (0: any port) and slcan-pty at CAN, profibus-tcp:127.0.0.1:0 at PROFIBUS"
    )]
    Unknown {
        /// The text.
        text: String,
    },
    /// The text has no address.
    #[error("`{text}` names no IPv4 address with a port; write for example {kind}:127.0.0.1:0 (0: any port)")]
    NoAddress {
        /// The text.
        text: String,
        /// The kind of door.
        kind: &'static str,
    },
    /// An address that other machines can reach.
    #[error(
        "`{text}` would let anybody in the network take part; use an address of 127.0.0.0/8, or write {anybody} if that is \
         wanted"
    )]
    NotLoopback {
        /// The text.
        text: String,
        /// Name of the door for the whole network.
        anybody: &'static str,
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
        if let Some(tcp) = TCP.iter().find(|tcp| kind == tcp.name || kind == tcp.anybody) {
            let is_few = kind == tcp.name;
            let kind = if is_few { tcp.name } else { tcp.anybody };
            let at = rest.and_then(|at| at.parse().ok());
            let at: SocketAddrV4 = at.ok_or_else(|| BadDoor::NoAddress { text: text.to_owned(), kind })?;
            if is_few && !at.ip().is_loopback() {
                return Err(BadDoor::NotLoopback { text: text.to_owned(), anybody: tcp.anybody });
            }
            return Ok((tcp.door)(at));
        }
        match (kind, rest) {
            (PTY, None) => Ok(DoorSpec::SlcanPty { number: None }),
            (PTY, Some(path)) => {
                let number = path.strip_prefix(PTS).and_then(|number| number.parse().ok());
                Ok(DoorSpec::SlcanPty { number: Some(number.ok_or_else(unknown)?) })
            }
            _ => Err(unknown()),
        }
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
    /// Protocol of the door.
    #[must_use]
    pub const fn speech(self) -> Speech {
        match self {
            DoorSpec::SlcanTcp { .. } | DoorSpec::SlcanPty { .. } => Speech::Frames,
            DoorSpec::ProfibusTcp { .. } => Speech::Telegrams,
        }
    }

    /// Address that the door listens at, if it has one.
    #[must_use]
    pub const fn address(self) -> Option<SocketAddrV4> {
        match self {
            DoorSpec::SlcanTcp { at } | DoorSpec::ProfibusTcp { at } => Some(at),
            DoorSpec::SlcanPty { .. } => None,
        }
    }

    /// The same door at this address, if it has an address.
    pub(super) const fn at(self, at: SocketAddrV4) -> Self {
        match self {
            DoorSpec::SlcanTcp { .. } => DoorSpec::SlcanTcp { at },
            DoorSpec::ProfibusTcp { .. } => DoorSpec::ProfibusTcp { at },
            DoorSpec::SlcanPty { .. } => self,
        }
    }
}

impl fmt::Display for DoorSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(at) = self.address()
            && let Some(tcp) = TCP.iter().find(|tcp| (tcp.door)(at) == *self)
        {
            let name = if at.ip().is_loopback() { tcp.name } else { tcp.anybody };
            return write!(f, "{name}:{at}");
        }
        match self {
            DoorSpec::SlcanPty { number: Some(number) } => write!(f, "{PTY}:{PTS}{number}"),
            _ => f.write_str(PTY),
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
        ] {
            let door: DoorSpec = text.parse().unwrap();
            assert_eq!(door.to_string(), text);
        }
        // A door for the whole network may also have a local address.
        let few: DoorSpec = "slcan-tcp-anybody:127.0.0.1:5".parse().unwrap();
        assert_eq!(few.to_string(), "slcan-tcp:127.0.0.1:5");
    }

    #[test]
    fn only_this_machine_gets_in_by_default() {
        for at in ["0.0.0.0:0", "192.168.0.7:4000", "8.8.8.8:1"] {
            for kind in ["slcan-tcp", "profibus-tcp"] {
                let refusal = format!("{kind}:{at}").parse::<DoorSpec>().unwrap_err();
                assert!(matches!(refusal, BadDoor::NotLoopback { .. }), "{refusal}");
                assert!(refusal.to_string().contains(&format!("write {kind}-anybody")), "{refusal}");
            }
        }
    }

    #[test]
    fn invalid_doors_are_refused() {
        for text in
            ["", "slcan", "slcan-udp:1.2.3.4:5", "slcan-pty:7", "slcan-pty:/dev/pts/x", "profibus-pty"]
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
