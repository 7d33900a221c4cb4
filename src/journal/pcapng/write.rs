//! Writes logs.

use super::{
    BYTE_ORDER, EXTENDED, INTERFACE, Link, NAME, PACKET, PROFIBUS_DL, REMOTE, RESOLUTION, RTAC_SERIAL,
    SECTION, SOCKETCAN,
};
use crate::can::{Frame, Id};
use crate::journal::{Format, Octets, OctetsKind, Record, Source};

/// Negative exponent of the time unit: microseconds.
const MICROSECONDS: u8 = 6;

/// Writes frames and telegrams as packets.
pub struct Pcapng {
    buses: Vec<(String, Link)>,
}

impl Pcapng {
    /// Returns a writer for these buses, in the order of the plant: one interface for each.
    pub fn new(buses: Vec<(String, Link)>) -> Self {
        Pcapng { buses }
    }
}

/// Appends a block of this type.
fn block(kind: u32, body: &[u8], out: &mut Vec<u8>) {
    let length = (body.len() + 12) as u32;
    out.extend(kind.to_le_bytes());
    out.extend(length.to_le_bytes());
    out.extend(body);
    out.extend(length.to_le_bytes());
}

/// Appends an option, padded to a multiple of four bytes.
fn option(code: u16, value: &[u8], out: &mut Vec<u8>) {
    // Names in a plant are far shorter than this limit, so no name is cut.
    let value = &value[..value.len().min(u16::MAX.into())];
    out.extend(code.to_le_bytes());
    out.extend((value.len() as u16).to_le_bytes());
    out.extend(value);
    out.extend([0; 3].iter().take(value.len().next_multiple_of(4) - value.len()));
}

/// Returns a frame in the form of SocketCAN.
pub(super) fn packet(frame: &Frame) -> [u8; 16] {
    let field = frame.arbitration();
    let mut id = match field.id() {
        Id::Standard(id) => id.as_raw().into(),
        Id::Extended(id) => id.as_raw() | EXTENDED,
    };
    if field.is_remote() {
        id |= REMOTE;
    }
    let mut packet = [0; 16];
    packet[..4].copy_from_slice(&id.to_be_bytes());
    packet[4] = frame.length() as u8;
    if !field.is_remote() {
        let payload = frame.payload();
        let data = payload.data();
        packet[8..8 + data.len()].copy_from_slice(data);
    }
    packet
}

/// Number of bytes of the head of a packet with octets of a serial line.
const SERIAL_HEAD: usize = 12;

/// Returns the kind of such a packet, as Wireshark's dissector of RTAC Serial numbers the kinds.
const fn serial_kind(kind: OctetsKind) -> u8 {
    match kind {
        OctetsKind::Sent => 1,
        OctetsKind::Received => 2,
    }
}

/// Returns the head of octets of a serial line: seconds, microseconds, kind, and three bytes for signals that RS485 does
/// not have.
fn serial_head(record: &Record, kind: OctetsKind) -> [u8; SERIAL_HEAD] {
    let (seconds, us) = ((record.time_us / 1_000_000) as u32, (record.time_us % 1_000_000) as u32);
    let mut head = [0; SERIAL_HEAD];
    head[..4].copy_from_slice(&seconds.to_be_bytes());
    head[4..8].copy_from_slice(&us.to_be_bytes());
    head[8] = serial_kind(kind);
    head
}

impl Format<Vec<u8>> for Pcapng {
    fn begin(&self, out: &mut Vec<u8>) {
        let mut section = Vec::new();
        section.extend(BYTE_ORDER.to_le_bytes());
        // Version 1.0; the length of the section is not specified.
        section.extend(1_u16.to_le_bytes());
        section.extend(0_u16.to_le_bytes());
        section.extend(u64::MAX.to_le_bytes());
        block(SECTION, &section, out);
        for (bus, link) in &self.buses {
            let mut interface = Vec::new();
            let link = match link {
                Link::Can => SOCKETCAN,
                Link::Profibus => PROFIBUS_DL,
                Link::Serial => RTAC_SERIAL,
            };
            interface.extend(link.to_le_bytes());
            // A reserved field, then a zero: the length of packets has no limit.
            interface.extend([0; 6]);
            option(NAME, bus.as_bytes(), &mut interface);
            option(RESOLUTION, &[MICROSECONDS], &mut interface);
            option(0, &[], &mut interface);
            block(INTERFACE, &interface, out);
        }
    }

    fn record(&mut self, record: &Record, out: &mut Vec<u8>) {
        let Source::Bus(bus) = record.event.source() else { return };
        let frame = record.event.frame().map(|carried| {
            let known = packet(&carried.frame).to_vec();
            Octets { kind: OctetsKind::Sent, length: known.len(), known }
        });
        let Some(Octets { kind, mut known, mut length }) = frame.or_else(|| record.telegram()) else {
            return;
        };
        if let Some((_, Link::Serial)) = self.buses.get(bus.index()) {
            known.splice(0..0, serial_head(record, kind));
            length += SERIAL_HEAD;
        }
        let (high, low) = ((record.time_us >> 32) as u32, record.time_us as u32);
        let words = [bus.0, high, low, known.len() as u32, length as u32];
        let mut body: Vec<_> = words.into_iter().flat_map(u32::to_le_bytes).collect();
        known.resize(known.len().next_multiple_of(4), 0);
        body.extend(known);
        block(PACKET, &body, out);
    }

    fn skip(&mut self, _: &Record) {}

    /// Writes nothing: the format cannot express a gap.
    fn gap(&mut self, _: u64, _: &mut Vec<u8>) -> bool {
        false
    }
}
