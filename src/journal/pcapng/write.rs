//! Writing.

use super::{BYTE_ORDER, EXTENDED, INTERFACE, NAME, PACKET, REMOTE, RESOLUTION, SECTION, SOCKETCAN};
use crate::can::{Frame, Id};
use crate::journal::{Format, Names, Record, Source};

/// Microseconds: the negative power of ten.
const MICROSECONDS: u8 = 6;

/// Writes frames as packets.
pub struct Pcapng {
    buses: Vec<String>,
}

impl Pcapng {
    /// A writer with these names: one interface for each bus.
    pub fn new(names: &Names) -> Self {
        Pcapng { buses: names.buses.clone() }
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

/// Appends an option, with what fills it up to a multiple of four bytes.
fn option(code: u16, value: &[u8], out: &mut Vec<u8>) {
    // Names in a plant are short.
    let value = &value[..value.len().min(u16::MAX.into())];
    out.extend(code.to_le_bytes());
    out.extend((value.len() as u16).to_le_bytes());
    out.extend(value);
    out.extend([0; 3].iter().take(value.len().next_multiple_of(4) - value.len()));
}

/// A frame as SocketCAN has it.
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

impl Format<Vec<u8>> for Pcapng {
    fn begin(&self, out: &mut Vec<u8>) {
        let mut section = Vec::new();
        section.extend(BYTE_ORDER.to_le_bytes());
        // Version 1.0, of a length that is not told.
        section.extend(1_u16.to_le_bytes());
        section.extend(0_u16.to_le_bytes());
        section.extend(u64::MAX.to_le_bytes());
        block(SECTION, &section, out);
        for bus in &self.buses {
            let mut interface = Vec::new();
            interface.extend(SOCKETCAN.to_le_bytes());
            // Reserved; no limit to the length of packets.
            interface.extend([0; 6]);
            option(NAME, bus.as_bytes(), &mut interface);
            option(RESOLUTION, &[MICROSECONDS], &mut interface);
            option(0, &[], &mut interface);
            block(INTERFACE, &interface, out);
        }
    }

    fn record(&mut self, record: &Record, out: &mut Vec<u8>) {
        let (Some(carried), Source::Bus(bus)) = (record.event.frame(), record.event.source()) else { return };
        let packet = packet(&carried.frame);
        let (high, low) = ((record.time_us >> 32) as u32, record.time_us as u32);
        let length = packet.len() as u32;
        let mut body = Vec::new();
        [u32::from(bus), high, low, length, length].iter().for_each(|word| body.extend(word.to_le_bytes()));
        body.extend(packet);
        block(PACKET, &body, out);
    }

    fn skip(&mut self, _: &Record) {}

    /// The format has no place for it.
    fn gap(&mut self, _: u64, _: &mut Vec<u8>) -> bool {
        false
    }
}
