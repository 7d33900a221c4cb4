//! One thing that happened: its kind and its words.

use super::coded::{EventCodec, Words};
use super::fields::Fields;
use super::history::Stored;
use super::kind::{Carried, EventText, Kind, Octets};
use super::reader::Reader;
use core::fmt;

/// Where a record comes from: a port of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Index of the device in the plant.
    pub plc: u16,
    /// Number of the port; 0 is the device itself.
    pub node: u8,
}

impl Origin {
    /// In place of a device's index: a guest, a foreign program that takes part in a bus. The port is its number there.
    const GUEST: u16 = u16::MAX;

    /// Guest number `guest` of the bus that is spoken of.
    #[must_use]
    pub const fn of_guest(guest: u8) -> Self {
        Origin { plc: Self::GUEST, node: guest }
    }

    /// The guest's number, if it is one.
    #[must_use]
    pub const fn guest(self) -> Option<u8> {
        if self.plc == Self::GUEST { Some(self.node) } else { None }
    }
}

/// What an event happened to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A bus, by its index in the plant.
    Bus(u16),
    /// A device, by its index in the plant.
    Plc(u16),
    /// A port of a device.
    Node(Origin),
}

impl Source {
    /// From here on, indices of devices are those of buses: a finding may be one at a bus.
    pub(super) const BUSES: u16 = 1 << 15;

    /// The device with this index, or the bus.
    #[inline]
    #[must_use]
    pub const fn of_index(index: u16) -> Self {
        if index >= Self::BUSES { Source::Bus(index - Self::BUSES) } else { Source::Plc(index) }
    }
}

/// How the journal keeps an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeping {
    /// In a record of its own.
    Noted,
    /// Together with equal ones at equal distances.
    Counted,
    /// In a record of its own; it is a request whose answers are to tell how long it waited.
    Request {
        /// Index of the device.
        plc: u16,
        /// Offset of the register.
        offset: u32,
        /// The value written.
        value: u32,
    },
    /// Counted, unless it answers a request.
    Answer {
        /// Index of the device.
        plc: u16,
        /// Offset of the register.
        offset: u32,
        /// What had been written.
        request: u32,
        /// What stands there now, if more answers to the same request are to come.
        goes_on: Option<u32>,
    },
    /// In a record of its own, behind everything that was counted up to here; it may answer a command.
    State {
        /// Index of the device.
        plc: u16,
        /// Offset of the register that commands come in.
        command: u32,
    },
}

/// One thing that happened. Register offsets are absolute bytes of the device's RAM.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Event {
    kind: &'static Kind,
    words: Words,
}

impl Event {
    /// `words` must be those of the kind.
    pub(super) const fn of_words(kind: &'static Kind, words: Words) -> Self {
        Event { kind, words }
    }

    /// What kind of event it is.
    #[inline]
    pub const fn kind(&self) -> &'static Kind {
        self.kind
    }

    /// The event as words.
    #[inline]
    pub const fn words(&self) -> Words {
        self.words
    }

    /// Whether it is a `T`.
    #[inline]
    pub fn is<T: EventCodec>(&self) -> bool {
        *self.kind == *T::KIND
    }

    /// What there is to tell, if it is a `T`.
    #[inline]
    pub fn get<T: EventCodec>(&self) -> Option<T> {
        if self.is::<T>() { T::read(self.words) } else { None }
    }

    /// What it happened to.
    pub fn source(&self) -> Source {
        self.kind.source(self.words)
    }

    /// What happened, for people.
    pub(super) fn text(&self, reader: &mut Reader) -> String {
        self.kind.text(self.words, reader)
    }

    /// What happened, for programs.
    pub(super) fn fields(&self, reader: &mut Reader) -> Fields {
        self.kind.fields(self.words, reader)
    }

    /// The register that the firmware has written, if that is what it tells.
    pub(crate) fn stored(&self) -> Option<Stored> {
        self.kind.stored(self.words)
    }

    /// The telegram, if one was on the line.
    pub(super) fn telegram(&self) -> Option<Octets> {
        self.kind.telegram(self.words)
    }

    /// The time slot of the bus that a frame was in.
    pub(super) fn slot(&self) -> Option<&'static str> {
        self.kind.slot(self.words)
    }

    /// The frame, if one has arrived.
    #[must_use]
    pub fn frame(&self) -> Option<Carried> {
        self.kind.frame(self.words)
    }
}

impl<T: EventText> From<T> for Event {
    #[inline]
    fn from(told: T) -> Self {
        Event { kind: T::KIND, words: told.words() }
    }
}

impl fmt::Debug for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} {:X?}", self.kind, self.words)
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.guest() {
            Some(guest) => write!(f, "guest{guest}"),
            None => write!(f, "PLC {} node{}", self.plc, self.node),
        }
    }
}
