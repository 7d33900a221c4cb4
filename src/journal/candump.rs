//! The log format of `candump -L`, which can-utils (`log2asc`, `canplayer`) and Wireshark read:
//! `(0000000002.001234) drives 583#7900210000000000`. A log contains only frames. Times are emulated time since
//! power-on.

use super::{Format, Names, Record, Source};
use crate::can::{ExtendedId, Frame, Id, Payload, StandardId};
use core::fmt;
use std::fmt::Write;

/// Maximum length of the name of a network interface under Linux. Programs that read logs may refuse longer names.
const LONGEST_NAME: usize = 15;

/// Writes frames as `candump -L` does.
pub struct Candump {
    buses: Vec<String>,
}

impl Candump {
    /// Returns a writer with these names. A bus name with more than the 15 characters of an interface name is replaced
    /// by the bus number: `bus0`.
    pub fn new(names: &Names) -> Self {
        Candump { buses: Self::interfaces(&names.buses) }
    }

    /// Returns the name of each bus in such a log.
    pub fn interfaces(buses: &[String]) -> Vec<String> {
        let interface = |(index, name): (usize, &String)| {
            if name.len() <= LONGEST_NAME { name.clone() } else { number(index, buses) }
        };
        buses.iter().enumerate().map(interface).collect()
    }
}

/// Returns a name that contains the number of the bus. No other bus has this name.
fn number(index: usize, others: &[String]) -> String {
    let mut name = format!("bus{index}");
    while others.contains(&name) {
        name.push('_');
    }
    name
}

/// A frame in the form of the format: `583#7900210000000000`, `00000123#R4`.
pub struct FrameText<'a>(pub &'a Frame);

impl fmt::Display for FrameText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let field = self.0.arbitration();
        match field.id() {
            Id::Standard(id) => write!(f, "{:03X}#", id.as_raw())?,
            Id::Extended(id) => write!(f, "{:08X}#", id.as_raw())?,
        }
        match (field.is_remote(), self.0.length()) {
            (true, 0) => f.write_str("R"),
            (true, length) => write!(f, "R{length}"),
            (false, _) => self.0.payload().data().iter().try_for_each(|byte| write!(f, "{byte:02X}")),
        }
    }
}

impl Format for Candump {
    fn record(&mut self, record: &Record, out: &mut String) {
        let (Some(frame), Source::Bus(bus)) = (record.event.frame(), record.event.source()) else { return };
        let (seconds, us) = (record.time_us / 1_000_000, record.time_us % 1_000_000);
        let bus = self.buses.get(bus.index()).map_or("can", String::as_str);
        // Writing to a String cannot fail.
        let _ = write!(out, "({seconds:010}.{us:06}) {bus} {}", FrameText(&frame.frame));
        out.push('\n');
    }

    fn skip(&mut self, _: &Record) {}

    /// Writes nothing: the format cannot express a gap.
    fn gap(&mut self, _: u64, _: &mut String) -> bool {
        false
    }
}

const NO_FRAME: &str = "a frame of a candump log is for example 583#7900210000000000";

/// Reads a frame as [`FrameText`] writes it: `583#7900210000000000`, `00000123#R4`.
///
/// # Errors
/// The expected text.
pub fn frame(text: &str) -> Result<Frame, &'static str> {
    let (id, data) = text.split_once('#').ok_or(NO_FRAME)?;
    if data.starts_with('#') {
        return Err("a CAN FD frame; these buses only carry classical CAN");
    }
    let is_hex = |text: &str| text.bytes().all(|digit| digit.is_ascii_hexdigit());
    if !is_hex(id) {
        return Err(NO_FRAME);
    }
    let raw = u32::from_str_radix(id, 16).map_err(|_| NO_FRAME)?;
    let id = match id.len() {
        3 => u16::try_from(raw).ok().and_then(StandardId::new).map(Id::Standard),
        8 => ExtendedId::new(raw).map(Id::Extended),
        _ => None,
    };
    let id = id.ok_or("an identifier has three digits up to 7FF, or eight up to 1FFFFFFF")?;
    if let Some(length) = data.strip_prefix('R') {
        let length = if length.is_empty() { Some(0) } else { length.parse().ok() };
        return length
            .and_then(|length| Frame::remote(id, length))
            .ok_or("a remote frame asks for 0 to 8 bytes");
    }
    let wrong = "data are up to eight bytes of two hexadecimal digits";
    if !is_hex(data) || !data.len().is_multiple_of(2) {
        return Err(wrong);
    }
    let byte = |at| data.get(at..at + 2).and_then(|digits| u8::from_str_radix(digits, 16).ok());
    let bytes: Option<Vec<u8>> = (0..data.len()).step_by(2).map(byte).collect();
    let payload = bytes.and_then(|bytes| Payload::new(&bytes)).ok_or(wrong)?;
    Ok(Frame::new(id, payload))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_as_candump_writes_them() {
        let id = ExtendedId::new(0x123).unwrap();
        let shown = |frame: Frame| FrameText(&frame).to_string();
        assert_eq!(shown(Frame::standard(0x23, Payload::EMPTY)), "023#");
        assert_eq!(shown(Frame::standard(0x7FF, Payload::new(&[1, 0xAB]).unwrap())), "7FF#01AB");
        assert_eq!(shown(Frame::new(id, Payload::new(&[5]).unwrap())), "00000123#05");
        assert_eq!(shown(Frame::remote(id, 0).unwrap()), "00000123#R");
        assert_eq!(shown(Frame::remote(StandardId::MAX, 8).unwrap()), "7FF#R8");
    }
}
