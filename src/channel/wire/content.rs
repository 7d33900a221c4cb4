//! Content of replies in the head block and the data that follow it.

use super::fault::WireStatus;
use super::findings::WireEntry;
use super::journal::{WireChange, WireRecord};
use super::{Block, forces, serde_types};
use crate::devices::DriveDetails;
use crate::door::DoorSpec;
use crate::fault::FaultStatus;
use crate::journal::{Change, Entry, HistoryId, LONGEST_NOTE, Record};
use crate::memory::header::BoardState;
use crate::plain_text::is_interpreted;
use crate::plant::Forced;
use crate::request::{BusScene, BusState, Code, DriveEntry, InstanceInfo, Refused, Waited};
use serde::Serialize;
use serde::de::DeserializeOwned;
use zerocopy::{FromBytes, IntoBytes};

/// Longest text of an error in bytes; longer texts are cut.
pub(super) const MAX_TEXT: usize = 1020;

/// The type of a field of a reply.
pub(super) trait Content: Sized {
    /// Sets the numbers of the head that the field uses, and appends its bytes to the data.
    fn put(&self, head: &mut Block, data: &mut Vec<u8>);

    /// Decodes the field from the head and the beginning of the data, and removes the bytes of the field from
    /// the data. Returns `None` for content that a server of this version never sends.
    fn take(head: &Block, data: &mut &[u8]) -> Option<Self>;
}

/// Numbers, stored in the value of the head.
macro_rules! numbers {
    ($($type:ty)+) => {$(
        impl Content for $type {
            fn put(&self, head: &mut Block, _: &mut Vec<u8>) {
                head.value = u64::from(*self);
            }

            fn take(head: &Block, _: &mut &[u8]) -> Option<Self> {
                head.value.try_into().ok()
            }
        }
    )+};
}

numbers! { u16 u32 u64 }

impl Content for bool {
    fn put(&self, head: &mut Block, _: &mut Vec<u8>) {
        head.code = u16::from(*self);
    }

    fn take(head: &Block, _: &mut &[u8]) -> Option<Self> {
        match head.code {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

/// The bytes are all of the data.
impl Content for Vec<u8> {
    fn put(&self, _: &mut Block, data: &mut Vec<u8>) {
        data.extend_from_slice(self);
    }

    fn take(_: &Block, data: &mut &[u8]) -> Option<Self> {
        Some(core::mem::take(data).to_vec())
    }
}

/// The time is in the value of the head, the register in the data.
impl Content for Waited {
    fn put(&self, head: &mut Block, data: &mut Vec<u8>) {
        head.value = self.time_us;
        data.extend_from_slice(self.value.as_bytes());
    }

    fn take(head: &Block, data: &mut &[u8]) -> Option<Self> {
        Some(Waited { time_us: head.value, value: take_bytes(data)? })
    }
}

/// The number of the history is in the code of the head, the number of its first record in the data.
impl Content for HistoryId {
    fn put(&self, head: &mut Block, data: &mut Vec<u8>) {
        head.code = self.number;
        serde_types::append(&self.begin, data);
    }

    fn take(head: &Block, data: &mut &[u8]) -> Option<Self> {
        Some(HistoryId { number: head.code, begin: serde_types::take(data)? })
    }
}

impl Content for BoardState {
    fn put(&self, _: &mut Block, data: &mut Vec<u8>) {
        data.extend_from_slice(self.as_bytes());
    }

    fn take(_: &Block, data: &mut &[u8]) -> Option<Self> {
        take_bytes(data)
    }
}

impl Content for Vec<Forced> {
    fn put(&self, _: &mut Block, data: &mut Vec<u8>) {
        forces::append(self, data);
    }

    fn take(_: &Block, data: &mut &[u8]) -> Option<Self> {
        forces::decode(core::mem::take(data))
    }
}

/// The `code` of the head is the code of the refusal. If a wait has failed, the value of the head and the
/// data describe how it ended. The text of the refusal follows in the data.
impl Content for Refused {
    fn put(&self, head: &mut Block, data: &mut Vec<u8>) {
        self.waited.unwrap_or_default().put(head, data);
        head.code = self.code.0;
        data.extend_from_slice(&self.text.as_bytes()[..self.text.floor_char_boundary(MAX_TEXT)]);
    }

    fn take(head: &Block, data: &mut &[u8]) -> Option<Self> {
        let (code, waited) = (Code(head.code), Waited::take(head, data)?);
        let text = str::from_utf8(core::mem::take(data)).ok()?.to_owned();
        Some(Refused { code, text, waited: (code == Code::NOT_IN_TIME).then_some(waited) })
    }
}

/// Declares the types of this program that serde encodes in the data.
macro_rules! own_types {
    ($($type:ty)+) => {$(
        impl Content for $type {
            fn put(&self, _: &mut Block, data: &mut Vec<u8>) {
                serde_types::append(self, data);
            }

            fn take(_: &Block, data: &mut &[u8]) -> Option<Self> {
                serde_types::take(data)
            }
        }
    )+};
}

own_types! { Vec<BusState> Vec<BusScene> Vec<DriveEntry> Box<DriveDetails> Box<InstanceInfo> DoorSpec }

/// An element of a list, with another type on the wire.
trait Element: Sized {
    /// Type on the wire.
    type Sent: for<'a> From<&'a Self> + Serialize + DeserializeOwned;

    /// Decodes the element; `None` if no server of this version can have sent it.
    fn of(sent: &Self::Sent) -> Option<Self>;
}

impl<T: Element> Content for Vec<T> {
    fn put(&self, _: &mut Block, data: &mut Vec<u8>) {
        serde_types::append(&self.iter().map(T::Sent::from).collect::<Vec<_>>(), data);
    }

    fn take(_: &Block, data: &mut &[u8]) -> Option<Self> {
        serde_types::take::<Vec<T::Sent>>(data)?.iter().map(T::of).collect()
    }
}

impl Element for Record {
    type Sent = WireRecord;

    fn of(sent: &WireRecord) -> Option<Self> {
        sent.record()
    }
}

impl Element for Change {
    type Sent = WireChange;

    fn of(sent: &WireChange) -> Option<Self> {
        sent.change()
    }
}

impl Element for FaultStatus {
    type Sent = WireStatus;

    fn of(sent: &WireStatus) -> Option<Self> {
        sent.status()
    }
}

/// The data are all entries, followed by the notes of the entries that have one. A client of an earlier build
/// reads the entries and ignores the notes.
impl Content for Vec<Entry> {
    fn put(&self, _: &mut Block, data: &mut Vec<u8>) {
        serde_types::append(&self.iter().map(WireEntry::from).collect::<Vec<_>>(), data);
        if self.iter().any(|entry| entry.note.is_some()) {
            serde_types::append(&self.iter().map(|entry| entry.note.as_deref()).collect::<Vec<_>>(), data);
        }
    }

    fn take(_: &Block, data: &mut &[u8]) -> Option<Self> {
        let sent: Vec<WireEntry> = serde_types::take(data)?;
        let mut entries: Self = sent.iter().map(WireEntry::entry).collect::<Option<_>>()?;
        if !data.is_empty() {
            let notes: Vec<Option<String>> = serde_types::take(data)?;
            if notes.len() != entries.len() || !notes.iter().flatten().all(|note| is_note(note)) {
                return None;
            }
            entries.iter_mut().zip(notes).for_each(|(entry, note)| entry.note = note.map(Into::into));
        }
        Some(entries)
    }
}

/// True if a server can have sent this note of a finding.
fn is_note(text: &str) -> bool {
    text.len() <= LONGEST_NOTE && !text.contains(is_interpreted)
}

/// Decodes a `T` from its bytes at the beginning of the data, and removes them.
fn take_bytes<T: FromBytes>(data: &mut &[u8]) -> Option<T> {
    let (value, rest) = T::read_from_prefix(data).ok()?;
    *data = rest;
    Some(value)
}
