//! Reads logs.

use super::{
    BYTE_ORDER, ERROR, EXTENDED, INTERFACE, NAME, OFFSET, OLD_PACKET, PACKET, PACKET_FLAGS, PROFIBUS_DL,
    REMOTE, RESOLUTION, SECTION, SOCKETCAN, TIMELESS_PACKET,
};
use crate::can::{ExtendedId, Frame, Id, Payload, StandardId};
use crate::journal::recording::{Direction, Entry, Logged, Recording};
use crate::profibus::MAX_OCTETS;

/// An error in a part of a log.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("byte {at}: {right}")]
pub struct BadLog {
    /// First byte of the block.
    pub at: usize,
    /// Description of the content that would be right at this position.
    pub right: String,
}

/// Maximum number of interfaces in a section. No known program opens more.
const MOST_INTERFACES: usize = 1024;

/// True if a pcapng log begins with these bytes.
pub fn is_one(log: &[u8]) -> bool {
    log.starts_with(&SECTION.to_be_bytes())
}

/// Reads a log. Blocks of other kinds, such as names and statistics, are ignored. Packets that are neither frames of
/// Classical CAN nor telegrams of PROFIBUS are [`Recording::skipped`]: error messages of SocketCAN, CAN FD, other link
/// types, and telegrams that a capture has cut off.
///
/// # Errors
/// [`BadLog`]: the log is cut off or not in pcapng, or has a frame that is not possible on a CAN bus.
pub fn read(log: &[u8]) -> Result<Recording, BadLog> {
    let (mut recording, mut at) = (Recording::default(), 0);
    let mut section = Section { is_big: false, interfaces: Vec::new() };
    while at < log.len() {
        let bad = |right: String| BadLog { at, right };
        let rest = &log[at..];
        if is_one(rest) {
            section =
                Section::new(rest).ok_or_else(|| bad("no section of a pcapng log begins here".into()))?;
        } else if at == 0 {
            return Err(bad("no section of a pcapng log begins here".into()));
        }
        let (kind, body, length) =
            section.block(rest).ok_or_else(|| bad("the block is cut off, or its length is wrong".into()))?;
        match section.take(kind, body).map_err(bad)? {
            Some(Entry::Frame(frame)) => recording.add(at, Entry::Frame(Logged { at, ..frame })),
            Some(Entry::Telegram(it)) => recording.add(at, Entry::Telegram(Logged { at, ..it })),
            Some(skipped) => recording.add(at, skipped),
            None => {}
        }
        at += length;
    }
    Ok(recording)
}

/// Data that are valid until the next section begins.
struct Section {
    is_big: bool,
    interfaces: Vec<Interface>,
}

struct Interface {
    link: u16,
    name: Option<String>,
    /// Value of the option: a negative power of ten, or of two if its highest bit is set.
    resolution: u8,
    offset_s: i64,
}

impl Section {
    fn new(block: &[u8]) -> Option<Self> {
        let order: [u8; 4] = block.get(8..12)?.try_into().ok()?;
        let is_big = match order {
            _ if order == BYTE_ORDER.to_le_bytes() => false,
            _ if order == BYTE_ORDER.to_be_bytes() => true,
            _ => return None,
        };
        let section = Section { is_big, interfaces: Vec::new() };
        (section.half(block, 12)? == 1).then_some(section)
    }

    fn half(&self, bytes: &[u8], at: usize) -> Option<u16> {
        let bytes = bytes.get(at..at + 2)?.try_into().ok()?;
        Some(if self.is_big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn word(&self, bytes: &[u8], at: usize) -> Option<u32> {
        let bytes = bytes.get(at..at + 4)?.try_into().ok()?;
        Some(if self.is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// Returns the type, content and length of the first block.
    fn block<'a>(&self, rest: &'a [u8]) -> Option<(u32, &'a [u8], usize)> {
        let (kind, length) = (self.word(rest, 0)?, self.word(rest, 4)? as usize);
        let block = rest.get(..length).filter(|_| length >= 12 && length.is_multiple_of(4))?;
        let is_closed = self.word(block, length - 4)? as usize == length;
        is_closed.then(|| (kind, &block[8..length - 4], length))
    }

    /// Decodes a block: returns a frame, or stores data for later blocks.
    fn take(&mut self, kind: u32, body: &[u8]) -> Result<Option<Entry>, String> {
        match kind {
            INTERFACE if self.interfaces.len() == MOST_INTERFACES => {
                Err(format!("more than {MOST_INTERFACES} interfaces"))
            }
            INTERFACE => {
                let interface = self.interface(body).ok_or("this is not an interface")?;
                self.interfaces.push(interface);
                Ok(None)
            }
            PACKET => self.packet(body).map(Some),
            OLD_PACKET | TIMELESS_PACKET => {
                Err("a packet of an old kind; Wireshark and its `editcap` can convert the log".to_owned())
            }
            _ => Ok(None),
        }
    }

    fn interface(&self, body: &[u8]) -> Option<Interface> {
        let mut interface = Interface { link: self.half(body, 0)?, name: None, resolution: 6, offset_s: 0 };
        let mut options = body.get(8..)?;
        while let (Some(code), Some(length)) = (self.half(options, 0), self.half(options, 2)) {
            let value = options.get(4..4 + usize::from(length))?;
            match code {
                0 => break,
                NAME => interface.name = Some(String::from_utf8_lossy(value).into_owned()),
                RESOLUTION => interface.resolution = *value.first()?,
                OFFSET => {
                    let words = (self.word(value, 0)?, self.word(value, 4)?);
                    let (high, low) = if self.is_big { words } else { (words.1, words.0) };
                    interface.offset_s = (u64::from(high) << 32 | u64::from(low)) as i64;
                }
                _ => {}
            }
            options = options.get(4 + usize::from(length).next_multiple_of(4)..).unwrap_or_default();
        }
        Some(interface)
    }

    fn packet(&self, body: &[u8]) -> Result<Entry, String> {
        const CUT_OFF: &str = "the packet is cut off";
        let word = |at| self.word(body, at).ok_or(CUT_OFF);
        let number = word(0)? as usize;
        let interface =
            self.interfaces.get(number).ok_or("a packet of an interface that was not named before")?;
        let name = interface.name.clone().unwrap_or_else(|| format!("can{number}"));
        if interface.link != SOCKETCAN && interface.link != PROFIBUS_DL {
            let link = interface.link;
            return Ok(Entry::Skipped(format!(
                "a packet of interface '{name}' with link type {link}; those of CAN have {SOCKETCAN} (SocketCAN), \
                 those of PROFIBUS {PROFIBUS_DL}"
            )));
        }
        let ticks = u64::from(word(4)?) << 32 | u64::from(word(8)?);
        let time_us = interface.time_us(ticks).ok_or("there is no such time")?;
        let length = word(12)? as usize;
        let data = body.get(20..).and_then(|rest| rest.get(..length)).ok_or(CUT_OFF)?;
        let options = body.get(20 + length.next_multiple_of(4)..).unwrap_or_default();
        let direction = self.direction(options);
        if interface.link == PROFIBUS_DL {
            return Ok(if word(16)? as usize != length || data.is_empty() || length > MAX_OCTETS {
                Entry::Skipped(format!("a telegram of interface '{name}' without all its octets"))
            } else {
                let frame = data.to_vec();
                Entry::Telegram(Logged { at: 0, time_us, interface: name, direction, frame })
            });
        }
        let of = |frame| Entry::Frame(Logged { at: 0, time_us, interface: name, direction, frame });
        Ok(match frame(data)? {
            Ok(frame) => of(frame),
            Err(reason) => Entry::Skipped(reason.to_owned()),
        })
    }

    /// Direction of a packet with these options.
    fn direction(&self, mut options: &[u8]) -> Option<Direction> {
        while let (Some(code), Some(length)) = (self.half(options, 0), self.half(options, 2)) {
            match code {
                0 => break,
                PACKET_FLAGS => {
                    return match self.word(options, 4)? & 3 {
                        1 => Some(Direction::Received),
                        2 => Some(Direction::Transmitted),
                        _ => None,
                    };
                }
                _ => options = options.get(4 + usize::from(length).next_multiple_of(4)..)?,
            }
        }
        None
    }
}

impl Interface {
    /// Returns a time in microseconds, if the ticks are valid.
    fn time_us(&self, ticks: u64) -> Option<u64> {
        let millions = u128::from(ticks) * 1_000_000;
        let power = u32::from(self.resolution & 0x7F);
        let us = if self.resolution & 0x80 != 0 {
            millions >> power
        } else {
            millions / 10_u128.checked_pow(power)?
        };
        u64::try_from(i128::try_from(us).ok()? + i128::from(self.offset_s) * 1_000_000).ok()
    }
}

/// Decodes a frame in the form of SocketCAN, or returns the reason why it is skipped.
///
/// # Errors
/// The packet is damaged.
fn frame(packet: &[u8]) -> Result<Result<Frame, &'static str>, &'static str> {
    /// Flag of a CAN FD frame in this link type.
    const FD: u8 = 4;
    let cut_off = "a frame has eight bytes in front of its data";
    let (head, data) = packet.split_first_chunk::<8>().ok_or(cut_off)?;
    let [a, b, c, d, length, flags, ..] = *head;
    if flags & FD != 0 || length > 8 {
        return Ok(Err("a frame of CAN FD; these buses carry classical CAN only"));
    }
    let word = u32::from_be_bytes([a, b, c, d]);
    if word & ERROR != 0 {
        return Ok(Err("an error message of the interface"));
    }
    let (raw, length) = (word & !(EXTENDED | REMOTE), usize::from(length));
    let id = if word & EXTENDED != 0 {
        ExtendedId::new(raw).map(Id::Extended)
    } else {
        u16::try_from(raw).ok().and_then(StandardId::new).map(Id::Standard)
    };
    let id = id.ok_or("identifiers go up to 7FF, or extended up to 1FFFFFFF")?;
    let frame = if word & REMOTE != 0 {
        Frame::remote(id, length)
    } else {
        data.get(..length).and_then(Payload::new).map(|payload| Frame::new(id, payload))
    };
    frame.map(Ok).ok_or("the frame has less data than its length field")
}
