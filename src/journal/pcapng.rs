//! Logs in pcapng, which Wireshark and its tools read and write. A log contains only frames, telegrams and octets of
//! serial lines. Times are emulated time since power-on. Each bus is an interface of the link type CAN_SOCKETCAN,
//! PROFIBUS_DL or RTAC_SERIAL.
//!
//! A log has only three kinds of blocks: section, interface, packet.

mod read;
mod write;

pub use read::{BadLog, is_one, read};
pub use write::Pcapng;

/// Block types.
const SECTION: u32 = 0x0A0D_0D0A;
const INTERFACE: u32 = 1;
const PACKET: u32 = 6;
/// Block types of packets in files of older programs: the old packet, and the simple packet, which has no time.
const OLD_PACKET: u32 = 2;
const TIMELESS_PACKET: u32 = 3;

/// Number that shows the byte order of a section.
const BYTE_ORDER: u32 = 0x1A2B_3C4D;
/// Link type LINKTYPE_CAN_SOCKETCAN.
const SOCKETCAN: u16 = 227;
/// LINKTYPE_PROFIBUS_DL: from the start delimiter to the end delimiter.
const PROFIBUS_DL: u16 = 257;
/// LINKTYPE_RTAC_SERIAL: octets of a serial line, after a head with time and direction.
const RTAC_SERIAL: u16 = 250;

/// The type of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// The interface has frames of CAN.
    Can,
    /// The interface has telegrams of PROFIBUS.
    Profibus,
    /// The interface has octets of a serial line. Octets of ports are transmitted, octets of other participants are
    /// received.
    Serial,
}

/// Options of an interface: its name, the unit of its times, and an offset of the times in seconds.
const NAME: u16 = 2;
const RESOLUTION: u16 = 9;
const OFFSET: u16 = 14;
/// Option of a packet: its direction, in the two lowest bits.
const PACKET_FLAGS: u16 = 2;

/// Flags in an identifier in the form of SocketCAN. On this link type the identifier is big-endian.
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;
const ERROR: u32 = 1 << 29;

#[cfg(test)]
mod tests;
