//! A single event: its kind and its words.

use super::coded::{EventCodec, Words};
use super::fields::Fields;
use super::history::Stored;
use super::kind::{ArrivedFrame, EventKind, EventText, Octets};
use super::reader::Reader;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Origin of a record: a port of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Origin {
    /// Index of the device in the plant.
    pub plc: DeviceIndex,
    /// Number of the port, or [`PortNumber::DEVICE`].
    pub node: PortNumber,
}

impl Origin {
    /// The device itself.
    #[must_use]
    pub const fn of_device(plc: DeviceIndex) -> Self {
        Origin { plc, node: PortNumber::DEVICE }
    }

    /// Index of the device if the origin is a guest: a foreign program that takes part in a bus. The port is then the
    /// guest's number.
    const GUEST: DeviceIndex = DeviceIndex(u16::MAX);

    /// Index of the device if the origin is a drive of the section of a serial line. The port is then the address of the
    /// drive.
    const DRIVE: DeviceIndex = DeviceIndex(u16::MAX - 1);

    /// The drive with this address on the event's serial line.
    #[must_use]
    pub const fn of_drive(address: u8) -> Self {
        Origin { plc: Self::DRIVE, node: PortNumber(address) }
    }

    /// Returns the address of the drive, if the origin is a drive on a serial line.
    #[must_use]
    pub const fn drive(self) -> Option<u8> {
        if self.plc.0 == Self::DRIVE.0 { Some(self.node.0) } else { None }
    }

    /// Guest number `guest` of the event's bus.
    #[must_use]
    pub const fn of_guest(guest: u8) -> Self {
        Origin { plc: Self::GUEST, node: PortNumber(guest) }
    }

    /// Returns the guest's number, if the origin is a guest.
    #[must_use]
    pub const fn guest(self) -> Option<u8> {
        if self.plc.0 == Self::GUEST.0 { Some(self.node.0) } else { None }
    }
}

/// The device or bus of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A bus, by its index in the plant.
    Bus(BusIndex),
    /// A device, by its index in the plant.
    Plc(DeviceIndex),
    /// A port of a device.
    Node(Origin),
}

impl Source {
    /// An index of at least this number means a bus: subtract this number to get the index of the bus. Only findings on
    /// a bus have such an index.
    pub(super) const BUSES: u16 = 1 << 15;

    /// Returns the device with this index, or the bus.
    #[inline]
    #[must_use]
    pub const fn of_index(index: DeviceIndex) -> Self {
        if index.0 >= Self::BUSES {
            Source::Bus(BusIndex::of_number(index.0 - Self::BUSES))
        } else {
            Source::Plc(index)
        }
    }
}

/// Defines how the journal keeps an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeping {
    /// The event has a separate record.
    Noted,
    /// Equal events at equal distances in time share one record.
    Counted,
    /// The event is a request and has its own record. The records of its answers contain the time since the request.
    Request {
        /// Index of the device.
        plc: DeviceIndex,
        /// Offset of the register.
        offset: u32,
        /// Value that was written.
        value: u32,
    },
    /// An event that answers a request has its own record. Otherwise, the event is counted as in `Counted`.
    Answer {
        /// Index of the device.
        plc: DeviceIndex,
        /// Offset of the register.
        offset: u32,
        /// The value of the request.
        request: u32,
        /// The present value of the register, if more answers to this request will follow.
        pending_value: Option<u32>,
    },
    /// The event has its own record. It ends all running counts, and their records are written before its own. The
    /// event may be the answer to a command.
    State {
        /// Index of the device.
        plc: DeviceIndex,
        /// Offset of the command register.
        command: u32,
    },
}

/// A single event of the journal. Register offsets are absolute bytes of the device's RAM.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Event {
    kind: &'static EventKind,
    words: Words,
}

impl Event {
    /// Creates an event from its words, which must be valid for the kind.
    pub(super) const fn of_words(kind: &'static EventKind, words: Words) -> Self {
        Event { kind, words }
    }

    /// Returns the kind of the event.
    #[inline]
    pub const fn kind(&self) -> &'static EventKind {
        self.kind
    }

    /// Returns the event as words.
    #[inline]
    pub const fn words(&self) -> Words {
        self.words
    }

    /// True if the event is a `T`.
    #[inline]
    pub fn is<T: EventCodec>(&self) -> bool {
        *self.kind == *T::KIND
    }

    /// Returns the fields of the event, if it is a `T`.
    #[inline]
    pub fn get<T: EventCodec>(&self) -> Option<T> {
        if self.is::<T>() { T::read(self.words) } else { None }
    }

    /// Returns the device or bus of the event.
    pub fn source(&self) -> Source {
        self.kind.source(self.words)
    }

    /// Returns the event as text for people.
    pub(super) fn text(&self, reader: &mut Reader) -> String {
        self.kind.text(self.words, reader)
    }

    /// Returns the event as fields for programs.
    pub(super) fn fields(&self, reader: &mut Reader) -> Fields {
        self.kind.fields(self.words, reader)
    }

    /// Returns the register that the firmware has written, if the event is such a write.
    pub(crate) fn stored(&self) -> Option<Stored> {
        self.kind.stored(self.words)
    }

    /// Returns the guest that has sent the frame or telegram, if the event is the end of a frame or telegram.
    #[must_use]
    pub fn guest(&self) -> Option<u8> {
        self.frame().map_or_else(|| self.kind.guest(self.words), |carried| carried.guest)
    }

    /// Returns the octets of a telegram, as far as the event contains them. `None` if the event is not a telegram on
    /// the line.
    pub(super) fn telegram(&self) -> Option<Octets> {
        self.kind.telegram(self.words)
    }

    /// Returns the time slot of the bus in which the frame was sent.
    pub(super) fn slot(&self) -> Option<&'static str> {
        self.kind.slot(self.words)
    }

    /// Returns the frame, if one has arrived.
    #[must_use]
    pub fn frame(&self) -> Option<ArrivedFrame> {
        self.kind.frame(self.words)
    }
}

impl<T: EventText> From<T> for Event {
    #[inline]
    fn from(event: T) -> Self {
        Event { kind: T::KIND, words: event.words() }
    }
}

impl fmt::Debug for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} {:X?}", self.kind, self.words)
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.guest(), self.drive()) {
            (Some(guest), _) => write!(f, "guest{guest}"),
            (None, Some(address)) => write!(f, "drive{address}"),
            (None, None) => write!(f, "PLC {} node{}", self.plc, self.node),
        }
    }
}
