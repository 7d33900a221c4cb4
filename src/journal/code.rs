//! Events as three words: for the running hash, for counting equal ones, and for the channel.
//!
//! First word: bits 0-7 [`Kind`], 8-15 node, 16-31 index of the PLC or bus, 32-63 what the kind has for them. The
//! other two belong to the kind.

use super::board::BoardEvent;
use super::event::{Command, Event, FaultNews, Missed, Origin};
use super::kind::Kind;
use crate::check::{Finding, Rule};
use crate::devices::cansync::bus::Frame;
use crate::fault;
use crate::layout::Live;

/// An event as numbers. Equal events have equal words, different events different ones.
pub type Words = [u64; 3];

/// The first word.
#[inline]
fn head(kind: Kind, node: u8, index: u16, rest: u32) -> u64 {
    kind as u64 | u64::from(node) << 8 | u64::from(index) << 16 | u64::from(rest) << 32
}

/// Two numbers in one word.
#[inline]
fn pair(high: u32, low: u32) -> u64 {
    u64::from(high) << 32 | u64::from(low)
}

fn news_words(news: FaultNews) -> u64 {
    match news {
        FaultNews::Added => pair(0, 0),
        FaultNews::Hit(detail) => pair(1, detail.cast_unsigned()),
        FaultNews::Over => pair(2, 0),
        FaultNews::Cleared => pair(3, 0),
    }
}

impl Event {
    /// The event as words.
    #[inline]
    pub fn words(&self) -> Words {
        let kind = self.kind();
        let bus = |index: u16, rest: u32| head(kind, 0, index, rest);
        let node = |origin: Origin, rest: u32| head(kind, origin.node, origin.plc, rest);
        match *self {
            Event::SyncEdge { bus: index } => [bus(index, 0), 0, 0],
            Event::Frame { bus: index, frame } => {
                let id_and_length = u32::from(frame.id()) << 8 | frame.data().len() as u32;
                [bus(index, id_and_length), u64::from_le_bytes(frame.padded()), 0]
            }
            Event::State { origin, from, to } => [node(origin, 0), pair(from.into(), to.into()), 0],
            Event::Handshake { origin, offset, request, answer } => {
                [node(origin, offset), pair(request.into(), answer.into()), 0]
            }
            Event::Register { origin, offset, from, to } => [node(origin, offset), pair(from, to), 0],
            Event::Missed { origin, what } => {
                let (what, channel) = match what {
                    Missed::ReferenceValue(channel) => (0, channel),
                    Missed::ActualValue(channel) => (1, channel),
                };
                [node(origin, 0), pair(what, channel.into()), 0]
            }
            Event::CommandIgnored { origin, value, why } => {
                [node(origin, 0), pair(why as u32, value.into()), 0]
            }
            Event::InitRefused { origin, reason } => [node(origin, 0), u64::from(reason), 0],
            Event::SlaveStatus { origin, slave, status } => {
                [node(origin, 0), pair(slave.into(), status.into()), 0]
            }
            Event::BaudRateMismatch { origin, node_kbit_s, bus_kbit_s } => {
                [node(origin, 0), pair(node_kbit_s.into(), bus_kbit_s.into()), 0]
            }
            Event::ChannelWrite { plc, offset, width, value }
            | Event::Force { plc, offset, width, value } => {
                [head(kind, 0, plc, offset), pair(width.into(), value), 0]
            }
            Event::Board { plc, what } => {
                let (what, numbers) = what.words();
                [head(kind, 0, plc, what.into()), numbers, 0]
            }
            Event::Unforce { plc, offset } => [head(kind, 0, plc, offset), 0, 0],
            Event::Fault { id, kind: fault, target, news } => {
                let (index, number) = target.numbers();
                [head(kind, number, index, u32::from(id) << 16 | fault as u32), news_words(news), 0]
            }
            Event::Finding(Finding { rule, plc, offset, live, value, late_us }) => {
                [head(kind, live_code(live), plc, offset), pair(rule as u32, value), late_us.into()]
            }
        }
    }

    /// The way back; `None` for words that no event has.
    pub fn from_words(words: Words) -> Option<Event> {
        let [first, second, third] = words;
        let [kind, node, ..] = first.to_le_bytes();
        let (index, rest) = ((first >> 16) as u16, (first >> 32) as u32);
        let origin = Origin { plc: index, node };
        let (high, low) = ((second >> 32) as u32, second as u32);
        // Whatever is cut off here makes the words differ in the end.
        let event = match Kind::from_number(kind)? {
            Kind::Sync => Event::SyncEdge { bus: index },
            Kind::Frame => {
                let data = second.to_le_bytes();
                let frame = Frame::new((rest >> 8) as u16, data.get(..usize::from(rest as u8))?)?;
                Event::Frame { bus: index, frame }
            }
            Kind::State => Event::State { origin, from: high as u16, to: low as u16 },
            Kind::Handshake => {
                Event::Handshake { origin, offset: rest, request: high as u16, answer: low as u16 }
            }
            Kind::Register => Event::Register { origin, offset: rest, from: high, to: low },
            Kind::Missed => {
                let what = match high {
                    0 => Missed::ReferenceValue(low as u8),
                    _ => Missed::ActualValue(low as u8),
                };
                Event::Missed { origin, what }
            }
            Kind::Ignored => {
                let why = match high {
                    0 => Command::Unknown,
                    1 => Command::NotNow,
                    _ => Command::LeftBehind,
                };
                Event::CommandIgnored { origin, value: low as u16, why }
            }
            Kind::InitRefused => Event::InitRefused { origin, reason: low as u8 },
            Kind::SlaveStatus => Event::SlaveStatus { origin, slave: high as u8, status: low as u8 },
            Kind::BaudRateMismatch => {
                Event::BaudRateMismatch { origin, node_kbit_s: high as u16, bus_kbit_s: low as u16 }
            }
            Kind::ChannelWrite => {
                Event::ChannelWrite { plc: index, offset: rest, width: high as u8, value: low }
            }
            Kind::Board => Event::Board { plc: index, what: BoardEvent::from_words(rest as u8, second)? },
            Kind::Force => Event::Force { plc: index, offset: rest, width: high as u8, value: low },
            Kind::Unforce => Event::Unforce { plc: index, offset: rest },
            Kind::Fault => {
                let kind = fault::Kind::from_code(rest as u8)?;
                let news = match high {
                    0 => FaultNews::Added,
                    1 => FaultNews::Hit(low.cast_signed()),
                    2 => FaultNews::Over,
                    _ => FaultNews::Cleared,
                };
                Event::Fault { id: (rest >> 16) as u16, kind, target: kind.target(index, node), news }
            }
            Kind::Finding => Event::Finding(Finding {
                rule: Rule::from_number(high as u8)?,
                plc: index,
                offset: rest,
                live: live_from_code(node)?,
                value: low,
                late_us: third as u32,
            }),
        };
        (event.words() == words).then_some(event)
    }
}

/// Which of the structures that overlay each other, as a number.
fn live_code(live: Live) -> u8 {
    match live {
        Live::Always => 0,
        Live::Init => 1,
        Live::Cyclic => 2,
    }
}

/// The way back from [`live_code`].
fn live_from_code(code: u8) -> Option<Live> {
    [Live::Always, Live::Init, Live::Cyclic].into_iter().find(|live| live_code(*live) == code)
}
