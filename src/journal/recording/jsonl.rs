//! Reads lines of `commram trace --format json`. Each record is an object. Only frames and telegrams are read.

use super::{Entry, Logged};
use crate::can::{ExtendedId, Frame, Id, Payload, StandardId};
use crate::profibus::{self, Telegram};
use serde::Deserialize;

const NO_LINE: &str =
    "a line of `commram trace --format json` is an object with the fields of docs/reference/journal.md";
const NO_FRAME: &str = "there is no such frame";
const NO_TELEGRAM: &str = "there is no such telegram";

/// True if a log with this first line is of this form.
pub(super) fn is_one(line: &str) -> bool {
    line.starts_with('{')
}

/// Fields of a record. Records of other kinds may lack the optional fields, and may have other fields.
#[derive(Deserialize)]
struct Line {
    kind: String,
    #[serde(default)]
    time_us: u64,
    bus: Option<String>,
    data: Option<String>,
    id: Option<u32>,
    #[serde(default)]
    extended: bool,
    #[serde(default)]
    remote: bool,
    length: Option<usize>,
    da: Option<u8>,
    sa: Option<u8>,
    fc: Option<u8>,
    dsap: Option<u8>,
    ssap: Option<u8>,
    octets: Option<usize>,
    first: Option<String>,
}

/// Reads a line; `None` if its record is neither a frame nor a telegram.
pub(super) fn entry(at: usize, text: &str) -> Result<Option<Entry>, &'static str> {
    let line: Line = serde_json::from_str(text).map_err(|_| NO_LINE)?;
    Ok(match line.kind.as_str() {
        "frame" | "can_frame" | "foreign_frame" => Some(Entry::Frame(line.logged(at, line.frame()?)?)),
        "dp_telegram" => Some(match line.data() {
            Some(data) => Entry::Telegram(line.logged(at, line.telegram(data)?)?),
            None => Entry::Skipped("a telegram of which an older commram kept four octets".to_owned()),
        }),
        "dp_short" => Some(Entry::Telegram(line.logged(at, line.short()?)?)),
        "dp_garbled" => Some(Entry::Skipped("garbled octets".to_owned())),
        _ => None,
    })
}

/// Reads octets in hexadecimal.
fn bytes(text: &str) -> Option<Vec<u8>> {
    let octet = |at: usize| u8::from_str_radix(text.get(at..at + 2)?, 16).ok();
    (0..text.len()).step_by(2).map(octet).collect()
}

impl Line {
    fn logged<T>(&self, at: usize, frame: T) -> Result<Logged<T>, &'static str> {
        let interface = self.bus.clone().ok_or(NO_LINE)?;
        Ok(Logged { at, time_us: self.time_us, interface, direction: None, frame })
    }

    fn frame(&self) -> Result<Frame, &'static str> {
        let raw = self.id.ok_or(NO_LINE)?;
        let id = if self.extended {
            ExtendedId::new(raw).map(Id::Extended)
        } else {
            u16::try_from(raw).ok().and_then(StandardId::new).map(Id::Standard)
        };
        let id = id.ok_or(NO_FRAME)?;
        if self.remote {
            return Frame::remote(id, self.length.unwrap_or(0)).ok_or(NO_FRAME);
        }
        let data = self.data.as_deref().and_then(bytes).ok_or(NO_FRAME)?;
        Payload::new(&data).map(|payload| Frame::new(id, payload)).ok_or(NO_FRAME)
    }

    /// Returns the data of a telegram, if the line contains all of them.
    fn data(&self) -> Option<Vec<u8>> {
        let text = self.data.as_deref().or(self.first.as_deref())?;
        bytes(text).filter(|data| self.octets.is_none_or(|octets| octets == data.len()))
    }

    fn telegram(&self, data: Vec<u8>) -> Result<Vec<u8>, &'static str> {
        let &Line { da: Some(da), sa: Some(sa), fc: Some(fc), dsap, ssap, .. } = self else {
            return Err(NO_LINE);
        };
        let frame = profibus::Frame { da, sa, fc, dsap, ssap, data };
        Telegram::Frame(frame).octets().map_err(|_| NO_TELEGRAM)
    }

    /// Returns the octets of a token, or of a short acknowledgement, which has no addresses.
    fn short(&self) -> Result<Vec<u8>, &'static str> {
        let telegram = match (self.da, self.sa) {
            (Some(da), Some(sa)) => Telegram::Token { da, sa },
            _ => Telegram::ShortAck,
        };
        telegram.octets().map_err(|_| NO_TELEGRAM)
    }
}
