//! Replies on the wire: encoding into blocks, and checked decoding.

use super::fault::WireStatus;
use super::findings::WireEntry;
use super::journal::{WireChange, WireRecord};
use super::{Block, MAX_REPLY_BLOCKS, MAX_REPLY_BYTES, forces, reply_kind, serde_types};
use crate::fault::FaultStatus;
use crate::journal::{Change, Entry, Record, Turn};
use crate::memory::header::BoardState;
use crate::request::{Code, Refused, Reply, Waited};
use zerocopy::{FromBytes, IntoBytes};

/// Longest text of an error in bytes; longer texts are cut.
const MAX_TEXT: usize = 1020;
/// Largest number of blocks of an error; they are reserved, so that an error about a long reply always fits.
const ERROR_BLOCKS: usize = 1 + blocks_for(size_of::<u32>() + MAX_TEXT);

/// Number of blocks for `len` bytes of data.
const fn blocks_for(len: usize) -> usize {
    len.div_ceil(size_of::<Block>())
}

/// Replies of a request under construction. The buffer is cleared and reused, so replies about registers and time need
/// no allocation in the steady state.
#[derive(Debug, Default)]
pub struct ReplyBuffer {
    blocks: Vec<Block>,
}

impl ReplyBuffer {
    /// The blocks so far.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Removes the blocks and keeps the memory.
    pub fn clear(&mut self) {
        self.blocks.clear();
    }

    /// Appends a reply.
    ///
    /// # Errors
    /// The buffer has no space for it, and nothing was appended.
    pub fn push(&mut self, reply: &Reply) -> Result<(), Refused> {
        let only = |kind| (kind, 0, 0);
        match reply {
            Reply::Value(value) => self.append((reply_kind::VALUE, 0, u64::from(*value)), &[]),
            Reply::Written => self.append(only(reply_kind::WRITTEN), &[]),
            Reply::Exchanged { ok, found } => {
                self.append((reply_kind::EXCHANGED, u16::from(*ok), u64::from(*found)), &[])
            }
            Reply::Bytes(bytes) => self.append(only(reply_kind::BYTES), bytes),
            Reply::Waited(Waited { time_us, value }) => {
                self.append((reply_kind::WAITED, 0, *time_us), value.as_bytes())
            }
            Reply::Time(time_us) => self.append((reply_kind::TIME, 0, *time_us), &[]),
            Reply::Journal { records, end, turn } => {
                let records: Vec<_> = records.iter().map(WireRecord::from).collect();
                self.append(
                    (reply_kind::JOURNAL, turn.number, *end),
                    &serde_types::encode(&(turn.begin, records)),
                )
            }
            Reply::Changes { changes, end, turn } => {
                let changes: Vec<_> = changes.iter().map(WireChange::from).collect();
                self.append(
                    (reply_kind::CHANGES, turn.number, *end),
                    &serde_types::encode(&(turn.begin, changes)),
                )
            }
            Reply::Forces(forced) => self.append(only(reply_kind::FORCES), &forces::encode(forced)),
            Reply::FaultAdded { id } => self.append((reply_kind::FAULT_ADDED, 0, u64::from(*id)), &[]),
            Reply::Faults(faults) => {
                let faults: Vec<_> = faults.iter().map(WireStatus::from).collect();
                self.append(only(reply_kind::FAULTS), &serde_types::encode(&faults))
            }
            Reply::FaultsCleared { count } => {
                self.append((reply_kind::FAULTS_CLEARED, 0, u64::from(*count)), &[])
            }
            Reply::Board(state) => self.append(only(reply_kind::BOARD), state.as_bytes()),
            Reply::Findings(entries) => {
                let entries: Vec<_> = entries.iter().map(WireEntry::from).collect();
                self.append(only(reply_kind::FINDINGS), &serde_types::encode(&entries))
            }
            Reply::Cleared => self.append(only(reply_kind::CLEARED), &[]),
            Reply::Buses(buses) => self.append(only(reply_kind::BUSES), &serde_types::encode(buses)),
            Reply::Scene(buses) => self.append(only(reply_kind::SCENE), &serde_types::encode(buses)),
            Reply::Drives(drives) => self.append(only(reply_kind::DRIVES), &serde_types::encode(drives)),
            Reply::Drive(drive) => self.append(only(reply_kind::DRIVE), &serde_types::encode(&**drive)),
            Reply::DoorOpened(door) => self.append(only(reply_kind::DOOR_OPENED), &serde_types::encode(door)),
            Reply::DoorsClosed { count } => {
                self.append((reply_kind::DOORS_CLOSED, 0, u64::from(*count)), &[])
            }
            Reply::Info(info) => self.append(only(reply_kind::INFO), &serde_types::encode(&**info)),
            Reply::Stopping => self.append(only(reply_kind::STOPPING), &[]),
            Reply::Error(refused) => {
                self.error(refused);
                Ok(())
            }
            Reply::NotExecuted => Ok(()),
        }
    }

    /// Appends an error, for which space is reserved: it is the last reply of a request.
    pub fn error(&mut self, refused: &Refused) {
        let Waited { time_us, value } = refused.waited.unwrap_or_default();
        let text = &refused.text[..refused.text.floor_char_boundary(MAX_TEXT)];
        let data = [value.as_bytes(), text.as_bytes()].concat();
        self.add((reply_kind::ERROR, refused.code.0, time_us), &data);
    }

    fn append(&mut self, head: (u16, u16, u64), data: &[u8]) -> Result<(), Refused> {
        if self.blocks.len() + 1 + blocks_for(data.len()) > MAX_REPLY_BLOCKS - ERROR_BLOCKS {
            let text = format_args!(
                "the replies of one request may have {MAX_REPLY_BYTES} bytes in all; spread it over several requests"
            );
            return Err(Refused::new(Code::REPLY_TOO_LONG, text));
        }
        self.add(head, data);
        Ok(())
    }

    fn add(&mut self, (kind, code, value): (u16, u16, u64), data: &[u8]) {
        self.blocks.push(Block { kind, code, data_len: data.len() as u32, value });
        let start = self.blocks.len();
        self.blocks.resize(start + blocks_for(data.len()), Block::default());
        if let Some(room) = self.blocks[start..].as_mut_bytes().get_mut(..data.len()) {
            room.copy_from_slice(data);
        }
    }
}

/// A reply that a server of this version cannot have sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("reply {index} at block {block} is malformed; do client and emulator have the same version?")]
pub struct DecodeError {
    /// Index of the reply.
    pub index: usize,
    /// Index of its head block.
    pub block: usize,
}

/// Appends the replies in `blocks` to `replies`.
///
/// # Errors
/// The first malformed reply; replies before it have been appended.
pub fn decode(blocks: &[Block], replies: &mut Vec<Reply>) -> Result<(), DecodeError> {
    let first = replies.len();
    let mut rest = blocks;
    while let Some((head, tail)) = rest.split_first() {
        let bad = DecodeError { index: replies.len() - first, block: blocks.len() - rest.len() };
        let len = head.data_len as usize;
        let (data, tail) = tail.split_at_checked(blocks_for(len)).ok_or(bad)?;
        let data = data.as_bytes().get(..len).ok_or(bad)?;
        replies.push(decode_one(head, data).ok_or(bad)?);
        rest = tail;
    }
    Ok(())
}

fn decode_one(head: &Block, data: &[u8]) -> Option<Reply> {
    let value = head.value;
    Some(match head.kind {
        reply_kind::VALUE => Reply::Value(value.try_into().ok()?),
        reply_kind::WRITTEN => Reply::Written,
        reply_kind::EXCHANGED => Reply::Exchanged { ok: flag(head.code)?, found: value.try_into().ok()? },
        reply_kind::BYTES => Reply::Bytes(data.to_vec()),
        reply_kind::WAITED => {
            Reply::Waited(Waited { time_us: value, value: u32::read_from_bytes(data).ok()? })
        }
        reply_kind::TIME => Reply::Time(value),
        reply_kind::JOURNAL => {
            let (begin, records) = journal_records(data)?;
            Reply::Journal { records, end: value, turn: Turn { number: head.code, begin } }
        }
        reply_kind::CHANGES => {
            let (begin, changes) = changes(data)?;
            Reply::Changes { changes, end: value, turn: Turn { number: head.code, begin } }
        }
        reply_kind::FORCES => Reply::Forces(forces::decode(data)?),
        reply_kind::FAULT_ADDED => Reply::FaultAdded { id: value.try_into().ok()? },
        reply_kind::FAULTS => Reply::Faults(faults(data)?),
        reply_kind::FAULTS_CLEARED => Reply::FaultsCleared { count: value.try_into().ok()? },
        reply_kind::BOARD => Reply::Board(BoardState::read_from_bytes(data).ok()?),
        reply_kind::FINDINGS => Reply::Findings(entries(data)?),
        reply_kind::CLEARED => Reply::Cleared,
        reply_kind::BUSES => Reply::Buses(serde_types::decode(data)?),
        reply_kind::SCENE => Reply::Scene(serde_types::decode(data)?),
        reply_kind::DRIVES => Reply::Drives(serde_types::decode(data)?),
        reply_kind::DRIVE => Reply::Drive(Box::new(serde_types::decode(data)?)),
        reply_kind::DOOR_OPENED => Reply::DoorOpened(serde_types::decode(data)?),
        reply_kind::DOORS_CLOSED => Reply::DoorsClosed { count: value.try_into().ok()? },
        reply_kind::INFO => Reply::Info(Box::new(serde_types::decode(data)?)),
        reply_kind::STOPPING => Reply::Stopping,
        reply_kind::ERROR => Reply::Error(error(Code(head.code), value, data)?),
        _ => return None,
    })
}

fn error(code: Code, time_us: u64, data: &[u8]) -> Option<Refused> {
    let (value, text) = u32::read_from_prefix(data).ok()?;
    let waited = (code == Code::NOT_IN_TIME).then_some(Waited { time_us, value });
    Some(Refused { code, text: str::from_utf8(text).ok()?.to_owned(), waited })
}

fn journal_records(data: &[u8]) -> Option<(u64, Vec<Record>)> {
    let (begin, records): (u64, Vec<WireRecord>) = serde_types::decode(data)?;
    Some((begin, records.iter().map(WireRecord::record).collect::<Option<_>>()?))
}

fn changes(data: &[u8]) -> Option<(u64, Vec<Change>)> {
    let (begin, changes): (u64, Vec<WireChange>) = serde_types::decode(data)?;
    Some((begin, changes.iter().map(WireChange::change).collect::<Option<_>>()?))
}

fn faults(data: &[u8]) -> Option<Vec<FaultStatus>> {
    serde_types::decode::<Vec<WireStatus>>(data)?.iter().map(WireStatus::status).collect()
}

fn entries(data: &[u8]) -> Option<Vec<Entry>> {
    serde_types::decode::<Vec<WireEntry>>(data)?.iter().map(WireEntry::entry).collect()
}

fn flag(code: u16) -> Option<bool> {
    match code {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}
