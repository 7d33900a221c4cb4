//! Records of the journal on the wire: 48 bytes each.

use crate::bus::Frame;
use crate::journal::{Command, Event, Missed, Origin, Record};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// No latency is known.
const NO_LATENCY: u32 = u32::MAX;

/// A record. What the last four fields hold depends on the kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub(super) struct WireRecord {
    seq: u64,
    time_us: u64,
    count: u32,
    period_us: u32,
    latency_us: u32,
    /// Which event: one of [`kind`].
    kind: u16,
    /// Index of the PLC or bus.
    index: u16,
    /// Node, or number of data bytes of a frame.
    node: u16,
    small: u16,
    large: u32,
    data: u64,
}

const _: () = assert!(size_of::<WireRecord>() == 48);

mod kind {
    pub const SYNC: u16 = 1;
    pub const FRAME: u16 = 2;
    pub const STATE: u16 = 3;
    pub const HANDSHAKE: u16 = 4;
    pub const MISSED: u16 = 5;
    pub const IGNORED: u16 = 6;
    pub const INIT_REFUSED: u16 = 7;
    pub const SLAVE_STATUS: u16 = 8;
    pub const BAUD_RATE_MISMATCH: u16 = 9;
    pub const CHANNEL_WRITE: u16 = 10;
}

impl From<&Record> for WireRecord {
    fn from(record: &Record) -> Self {
        WireRecord {
            seq: record.seq,
            time_us: record.time_us,
            count: record.count,
            period_us: record.period_us,
            latency_us: record.latency_us.unwrap_or(NO_LATENCY),
            ..Self::event(&record.event)
        }
    }
}

impl WireRecord {
    fn of_node(kind: u16, origin: Origin) -> Self {
        WireRecord { kind, index: origin.plc, node: origin.node.into(), ..Self::default() }
    }

    fn event(event: &Event) -> Self {
        match *event {
            Event::SyncEdge { bus } => WireRecord { kind: kind::SYNC, index: bus, ..Self::default() },
            Event::Frame { bus, frame } => WireRecord {
                kind: kind::FRAME,
                index: bus,
                node: frame.data().len() as u16, // at most 8
                small: frame.id(),
                data: u64::from_le_bytes(frame.padded()),
                ..Self::default()
            },
            Event::State { origin, from, to } => {
                WireRecord { small: from, large: to.into(), ..Self::of_node(kind::STATE, origin) }
            }
            Event::Handshake { origin, offset, request, answer } => WireRecord {
                small: request,
                large: offset,
                data: answer.into(),
                ..Self::of_node(kind::HANDSHAKE, origin)
            },
            Event::Missed { origin, what } => {
                let (channel, large) = match what {
                    Missed::ReferenceValue(channel) => (channel, 0),
                    Missed::ActualValue(channel) => (channel, 1),
                };
                WireRecord { small: channel.into(), large, ..Self::of_node(kind::MISSED, origin) }
            }
            Event::CommandIgnored { origin, value, why } => {
                let large = u32::from(why == Command::NotNow);
                WireRecord { small: value, large, ..Self::of_node(kind::IGNORED, origin) }
            }
            Event::InitRefused { origin, reason } => {
                WireRecord { small: reason.into(), ..Self::of_node(kind::INIT_REFUSED, origin) }
            }
            Event::SlaveStatus { origin, slave, status } => WireRecord {
                small: slave.into(),
                large: status.into(),
                ..Self::of_node(kind::SLAVE_STATUS, origin)
            },
            Event::BaudRateMismatch { origin, node_kbit_s, bus_kbit_s } => WireRecord {
                small: node_kbit_s,
                large: bus_kbit_s.into(),
                ..Self::of_node(kind::BAUD_RATE_MISMATCH, origin)
            },
            Event::ChannelWrite { plc, offset, width, value } => WireRecord {
                kind: kind::CHANNEL_WRITE,
                index: plc,
                small: width.into(),
                large: offset,
                data: value.into(),
                ..Self::default()
            },
        }
    }

    /// The way back; `None` for what no server of this version can have sent.
    pub fn record(&self) -> Option<Record> {
        let record = Record {
            seq: self.seq,
            time_us: self.time_us,
            event: self.to_event()?,
            count: self.count,
            period_us: self.period_us,
            latency_us: (self.latency_us != NO_LATENCY).then_some(self.latency_us),
        };
        // A field that a later version gives a meaning must not be passed over by this one.
        (record.count > 0 && WireRecord::from(&record) == *self).then_some(record)
    }

    fn to_event(self) -> Option<Event> {
        let origin = || Some(Origin { plc: self.index, node: u8::try_from(self.node).ok()? });
        let small_byte = || u8::try_from(self.small).ok();
        let large_word = || u16::try_from(self.large).ok();
        Some(match self.kind {
            kind::SYNC => Event::SyncEdge { bus: self.index },
            kind::FRAME => {
                let bytes = self.data.to_le_bytes();
                let frame = Frame::new(self.small, bytes.get(..usize::from(self.node))?)?;
                Event::Frame { bus: self.index, frame }
            }
            kind::STATE => Event::State { origin: origin()?, from: self.small, to: large_word()? },
            kind::HANDSHAKE => Event::Handshake {
                origin: origin()?,
                offset: self.large,
                request: self.small,
                answer: u16::try_from(self.data).ok()?,
            },
            kind::MISSED => {
                let what = match self.large {
                    0 => Missed::ReferenceValue(small_byte()?),
                    1 => Missed::ActualValue(small_byte()?),
                    _ => return None,
                };
                Event::Missed { origin: origin()?, what }
            }
            kind::IGNORED => {
                let why = match self.large {
                    0 => Command::Unknown,
                    1 => Command::NotNow,
                    _ => return None,
                };
                Event::CommandIgnored { origin: origin()?, value: self.small, why }
            }
            kind::INIT_REFUSED => Event::InitRefused { origin: origin()?, reason: small_byte()? },
            kind::SLAVE_STATUS => Event::SlaveStatus {
                origin: origin()?,
                slave: small_byte()?,
                status: u8::try_from(self.large).ok()?,
            },
            kind::BAUD_RATE_MISMATCH => Event::BaudRateMismatch {
                origin: origin()?,
                node_kbit_s: self.small,
                bus_kbit_s: large_word()?,
            },
            kind::CHANNEL_WRITE => Event::ChannelWrite {
                plc: self.index,
                offset: self.large,
                width: small_byte()?,
                value: u32::try_from(self.data).ok()?,
            },
            _ => return None,
        })
    }
}

#[cfg(test)]
#[path = "journal_tests.rs"]
mod tests;
