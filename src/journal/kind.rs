//! A kind of event: its number, name, ring and text. Each family has its own kinds; [`Catalogue`] contains all of them.

use super::catalogue::Catalogue;
use super::coded::{EventCodec, Words};
use super::event::{Keeping, Origin, Source};
use super::fields::Fields;
use super::history::Stored;
use super::reader::Reader;
use crate::can::Frame;
use crate::identity::DeviceIndex;
use core::fmt;

/// Number of rings of the journal.
pub(super) const RINGS: usize = 5;

/// The ring of the journal that keeps an event. Frequent events must not push out rare ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ring {
    /// Ring of frames on the buses.
    Traffic,
    /// SYNC edges and events in registers.
    Registers,
    /// Missed deadlines and injected faults.
    Missed,
    /// Events that are rare in a run without errors.
    Rare,
    /// Changes of followed registers.
    History,
}

impl Ring {
    #[cfg(test)]
    pub(super) const ALL: [Ring; RINGS] =
        [Ring::Traffic, Ring::Registers, Ring::Missed, Ring::Rare, Ring::History];

    /// Maximum number of records in this ring, for a journal whose rings have `capacity` records each by default.
    #[inline]
    pub(super) const fn share(self, capacity: usize) -> usize {
        match self {
            // Half of the capacity, because the memory of this ring is in addition to that of the other rings. The ring
            // is empty unless a client follows registers.
            Ring::History if capacity < 2 => 1,
            Ring::History => capacity / 2,
            _ => capacity,
        }
    }
}

/// The text and the fields of an event kind. The structure, number and name come from `event_kinds!`.
pub trait EventText: EventCodec {
    /// How the journal keeps the event.
    #[inline]
    fn keeping(&self) -> Keeping {
        Keeping::Noted
    }

    /// True if the catalogue has all rules and kinds to which numbers in the event refer.
    fn is_known(&self, catalogue: &Catalogue) -> bool {
        let _ = catalogue;
        true
    }

    /// Returns the event as text for people.
    fn text(&self, reader: &mut Reader) -> String;

    /// Returns the event as fields for programs, without the fields that all kinds have.
    fn fields(&self, reader: &mut Reader) -> Fields;

    /// Returns the frame, if one has arrived.
    fn frame(&self) -> Option<ArrivedFrame> {
        None
    }

    /// Returns the guest that has sent the telegram, if the event is the end of a telegram.
    fn guest(&self) -> Option<u8> {
        None
    }

    /// Returns the octets, if the event is a telegram on the line.
    fn telegram(&self) -> Option<Octets> {
        None
    }

    /// Returns the time slot of a frame, on a bus with time slots.
    fn slot(&self) -> Option<&'static str> {
        None
    }

    /// Returns the register that the firmware has written, if the event is such a write.
    #[inline]
    fn stored(&self) -> Option<Stored> {
        None
    }
}

/// A frame that has arrived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArrivedFrame {
    /// The CAN frame on the bus.
    pub frame: Frame,
    /// The guest that has sent the frame; `None` if no guest has sent it.
    pub guest: Option<u8>,
}

/// What octets on a line are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OctetsKind {
    /// Octets that a port of a device has sent.
    Sent,
    /// Octets that another participant has sent.
    Received,
}

impl OctetsKind {
    /// Returns the kind of octets that `sender` has sent.
    #[must_use]
    pub const fn of_sender(sender: Origin) -> Self {
        if sender.guest().is_none() && sender.drive().is_none() {
            OctetsKind::Sent
        } else {
            OctetsKind::Received
        }
    }
}

/// A telegram, or the first octets of a telegram if the event does not contain all of them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Octets {
    /// What the telegram is.
    pub kind: OctetsKind,
    /// The first octets of the telegram, as many as the record contains.
    pub known: Vec<u8>,
    /// Number of all octets.
    pub length: usize,
}

/// The kind of an event. Kinds are equal if their numbers are equal.
pub struct EventKind {
    number: u8,
    name: &'static str,
    ring: Ring,
    reads: KindDecoders,
}

/// Decoders of the words of a kind. They never receive invalid words, because [`Catalogue::event`] refuses them.
struct KindDecoders {
    normal: fn(Words, &Catalogue) -> Option<Words>,
    source: fn(Words) -> Option<Source>,
    text: fn(Words, &mut Reader) -> Option<String>,
    fields: fn(Words, &mut Reader) -> Option<Fields>,
    frame: fn(Words) -> Option<ArrivedFrame>,
    guest: fn(Words) -> Option<u8>,
    telegram: fn(Words) -> Option<Octets>,
    slot: fn(Words) -> Option<&'static str>,
    stored: fn(Words) -> Option<Stored>,
    #[cfg(test)]
    push: fn(Words, &mut super::Journal, u64),
}

impl EventKind {
    /// Creates the kind of `T`. `number` is part of the channel's wire format, and no other kind may use it. `name` is
    /// the name in JSON Lines and on the command line.
    pub const fn new<T: EventText>(number: u8, name: &'static str, ring: Ring) -> Self {
        let reads = KindDecoders {
            normal: |words, catalogue| {
                T::read(words).filter(|event| event.is_known(catalogue)).map(|event| event.words())
            },
            source: |words| T::read(words).map(|event| event.source()),
            text: |words, reader| T::read(words).map(|event| event.text(reader)),
            fields: |words, reader| T::read(words).map(|event| event.fields(reader)),
            frame: |words| T::read(words).and_then(|event| event.frame()),
            guest: |words| T::read(words).and_then(|event| event.guest()),
            telegram: |words| T::read(words).and_then(|event| event.telegram()),
            slot: |words| T::read(words).and_then(|event| event.slot()),
            stored: |words| T::read(words).and_then(|event| event.stored()),
            #[cfg(test)]
            push: |words, journal, time_us| journal.push(time_us, T::read(words).unwrap()),
        };
        EventKind { number, name, ring, reads }
    }

    /// Returns the number of the kind.
    #[inline]
    pub const fn number(&self) -> u8 {
        self.number
    }

    /// Returns the name of the kind in JSON Lines and on the command line.
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the ring that keeps the events of this kind.
    #[inline]
    pub const fn ring(&self) -> Ring {
        self.ring
    }

    /// Returns the words, with 0 in all bits that this kind ignores; `None` if the words are invalid.
    pub(crate) fn normal(&self, words: Words, catalogue: &Catalogue) -> Option<Words> {
        (self.reads.normal)(words, catalogue)
    }

    pub(super) fn source(&self, words: Words) -> Source {
        (self.reads.source)(words).unwrap_or(Source::Plc(DeviceIndex(0)))
    }

    pub(super) fn text(&self, words: Words, reader: &mut Reader) -> String {
        (self.reads.text)(words, reader).unwrap_or_default()
    }

    pub(super) fn fields(&self, words: Words, reader: &mut Reader) -> Fields {
        (self.reads.fields)(words, reader).unwrap_or_default()
    }

    pub(super) fn frame(&self, words: Words) -> Option<ArrivedFrame> {
        (self.reads.frame)(words)
    }

    pub(super) fn guest(&self, words: Words) -> Option<u8> {
        (self.reads.guest)(words)
    }

    pub(super) fn telegram(&self, words: Words) -> Option<Octets> {
        (self.reads.telegram)(words)
    }

    pub(super) fn slot(&self, words: Words) -> Option<&'static str> {
        (self.reads.slot)(words)
    }

    pub(super) fn stored(&self, words: Words) -> Option<Stored> {
        (self.reads.stored)(words)
    }

    #[cfg(test)]
    pub(super) fn push(&self, words: Words, journal: &mut super::Journal, time_us: u64) {
        (self.reads.push)(words, journal, time_us);
    }
}

impl PartialEq for EventKind {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
    }
}

impl Eq for EventKind {}

impl fmt::Debug for EventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}
