//! Replies on the wire: building them without allocation, and the checked way back.

use super::fault::WireFault;
use super::findings::WireEntry;
use super::journal::WireRecord;
use super::{Block, MAX_REPLY_BLOCKS, error, forces, info, reply_kind};
use crate::channel::op::InstanceInfo;
use crate::channel::{ChannelError, Reply};
use crate::check::{Entry, Findings};
use crate::fault::FaultStatus;
use crate::journal::{Journal, Record};
use crate::memory::header::BoardState;
use crate::plant::Forced;
use zerocopy::{FromBytes, IntoBytes};

/// Blocks an error takes; they are kept free so that a reply too long can say so.
const ERROR_BLOCKS: usize = 1 + blocks_for(size_of::<error::Numbers>());

/// Blocks that `len` bytes of data take.
const fn blocks_for(len: usize) -> usize {
    len.div_ceil(size_of::<Block>())
}

/// A reply being built. Cleared and used again, so that a request in the steady state allocates nothing.
#[derive(Debug, Default)]
pub struct ReplyBuffer {
    blocks: Vec<Block>,
}

impl ReplyBuffer {
    /// The blocks so far.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Forgets the blocks and keeps the memory.
    pub fn clear(&mut self) {
        self.blocks.clear();
    }

    /// Takes back everything after the first `len` blocks.
    fn truncate(&mut self, len: usize) {
        self.blocks.truncate(len);
    }

    fn head(&mut self, kind: u16, code: u16, value: u64, data_len: usize) -> Result<(), ChannelError> {
        let blocks = self.blocks.len() + 1 + blocks_for(data_len);
        if blocks > MAX_REPLY_BLOCKS - ERROR_BLOCKS {
            return Err(ChannelError::ReplyTooLong);
        }
        self.blocks.push(Block { kind, code, data_len: data_len as u32, value });
        Ok(())
    }

    fn data(&mut self, data: &[u8]) {
        let start = self.blocks.len();
        self.blocks.resize(start + blocks_for(data.len()), Block::default());
        if let Some(room) = self.blocks[start..].as_mut_bytes().get_mut(..data.len()) {
            room.copy_from_slice(data);
        }
    }

    /// Appends the value of a register.
    ///
    /// # Errors
    /// [`ChannelError::ReplyTooLong`], as for all the functions below.
    pub fn value(&mut self, value: u32) -> Result<(), ChannelError> {
        self.head(reply_kind::VALUE, 0, value.into(), 0)
    }

    /// Appends that a register was written.
    pub fn written(&mut self) -> Result<(), ChannelError> {
        self.head(reply_kind::WRITTEN, 0, 0, 0)
    }

    /// Appends the outcome of a comparison.
    pub fn exchanged(&mut self, outcome: Result<u32, u32>) -> Result<(), ChannelError> {
        let (code, found) = match outcome {
            Ok(found) => (1, found),
            Err(found) => (0, found),
        };
        self.head(reply_kind::EXCHANGED, code, found.into(), 0)
    }

    /// Appends `len` bytes that `fill` writes. If it fails, nothing is appended.
    pub fn bytes(
        &mut self,
        len: usize,
        fill: impl FnOnce(&mut [u8]) -> Result<(), ChannelError>,
    ) -> Result<(), ChannelError> {
        let start = self.blocks.len();
        self.head(reply_kind::BYTES, 0, 0, len)?;
        self.blocks.resize(start + 1 + blocks_for(len), Block::default());
        let filled = self.blocks[start + 1..].as_mut_bytes().get_mut(..len).map_or(Ok(()), fill);
        if filled.is_err() {
            self.truncate(start);
        }
        filled
    }

    /// Appends when and with which value a register matched.
    pub fn waited(&mut self, time_us: u64, value: u32) -> Result<(), ChannelError> {
        self.head(reply_kind::WAITED, 0, time_us, size_of::<u32>())?;
        self.data(value.as_bytes());
        Ok(())
    }

    /// Appends the time after an advance.
    pub fn advanced(&mut self, time_us: u64) -> Result<(), ChannelError> {
        self.head(reply_kind::ADVANCED, 0, time_us, 0)
    }

    /// Appends the journal's records from number `from` on, `max` at most. If they reach its end, those that are
    /// still being counted follow.
    pub fn journal(&mut self, journal: &Journal, from: u64, max: usize) -> Result<(), ChannelError> {
        let records = journal.read(from);
        let all = records.len() <= max;
        let pending = if all { journal.pending() } else { Vec::new() };
        let count = records.len().min(max) + pending.len();
        self.head(reply_kind::JOURNAL, 0, journal.end(), count * size_of::<WireRecord>())?;
        for record in records.take(max).chain(&pending) {
            self.data(WireRecord::from(record).as_bytes());
        }
        Ok(())
    }

    /// Appends the forced registers.
    pub fn forces(&mut self, forced: &[Forced]) -> Result<(), ChannelError> {
        self.bytes_of_kind(reply_kind::FORCES, &forces::encode(forced))
    }

    /// Appends the number of a fault that was added.
    pub fn fault_added(&mut self, id: u16) -> Result<(), ChannelError> {
        self.head(reply_kind::FAULT_ADDED, 0, id.into(), 0)
    }

    /// Appends the faults that wait or act.
    pub fn faults(&mut self, faults: &[FaultStatus]) -> Result<(), ChannelError> {
        let faults: Vec<_> = faults.iter().map(WireFault::from).collect();
        self.bytes_of_kind(reply_kind::FAULTS, faults.as_bytes())
    }

    /// Appends how many faults were cleared.
    pub fn faults_cleared(&mut self, count: u16) -> Result<(), ChannelError> {
        self.head(reply_kind::FAULTS_CLEARED, 0, count.into(), 0)
    }

    /// Appends what the access checker has found.
    pub fn findings(&mut self, findings: &Findings) -> Result<(), ChannelError> {
        self.head(reply_kind::FINDINGS, 0, 0, findings.len() * size_of::<WireEntry>())?;
        for entry in findings.iter() {
            self.data(WireEntry::from(entry).as_bytes());
        }
        Ok(())
    }

    /// Appends that this is forgotten.
    pub fn cleared(&mut self) -> Result<(), ChannelError> {
        self.head(reply_kind::CLEARED, 0, 0, 0)
    }

    /// Appends what the instance says about itself.
    pub fn info(&mut self, information: &InstanceInfo) -> Result<(), ChannelError> {
        let mut bytes = Vec::new();
        info::encode(information, &mut bytes);
        self.bytes_of_kind(reply_kind::INFO, &bytes)
    }

    fn bytes_of_kind(&mut self, kind: u16, bytes: &[u8]) -> Result<(), ChannelError> {
        self.head(kind, 0, 0, bytes.len())?;
        self.data(bytes);
        Ok(())
    }

    /// Appends what a board looks like.
    pub fn board(&mut self, state: &BoardState) -> Result<(), ChannelError> {
        self.bytes_of_kind(reply_kind::BOARD, state.as_bytes())
    }

    /// Appends that the emulator is going to end.
    pub fn stopping(&mut self) -> Result<(), ChannelError> {
        self.head(reply_kind::STOPPING, 0, 0, 0)
    }

    /// Appends an error, for which there is always room: it is the last reply of a request.
    pub fn error(&mut self, error: &ChannelError) {
        let (code, numbers) = error::encode(error);
        let data_len = size_of_val(&numbers) as u32;
        self.blocks.push(Block { kind: reply_kind::ERROR, code, data_len, value: 0 });
        self.data(numbers.as_bytes());
    }
}

/// A reply that no server of this version can have sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("reply {index} at block {block} is malformed; do client and emulator have the same version?")]
pub struct DecodeError {
    /// Position of the reply, from 0.
    pub index: usize,
    /// Position of its head block.
    pub block: usize,
}

/// Appends the replies in `blocks` to `replies`.
///
/// # Errors
/// The first reply that does not make sense; those before it have been appended.
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
        reply_kind::WAITED => Reply::Waited { time_us: value, value: u32::read_from_bytes(data).ok()? },
        reply_kind::ADVANCED => Reply::Advanced { time_us: value },
        reply_kind::JOURNAL => Reply::Journal { records: journal_records(data)?, end: value },
        reply_kind::FORCES => Reply::Forces(forces::decode(data)?),
        reply_kind::FAULT_ADDED => Reply::FaultAdded { id: value.try_into().ok()? },
        reply_kind::FAULTS => Reply::Faults(faults(data)?),
        reply_kind::FAULTS_CLEARED => Reply::FaultsCleared { count: value.try_into().ok()? },
        reply_kind::BOARD => Reply::Board(BoardState::read_from_bytes(data).ok()?),
        reply_kind::FINDINGS => Reply::Findings(entries(data)?),
        reply_kind::CLEARED => Reply::Cleared,
        reply_kind::INFO => Reply::Info(Box::new(info::decode(data)?)),
        reply_kind::STOPPING => Reply::Stopping,
        reply_kind::ERROR => {
            Reply::Error(error::decode(head.code, error::Numbers::read_from_bytes(data).ok()?)?)
        }
        _ => return None,
    })
}

fn journal_records(data: &[u8]) -> Option<Vec<Record>> {
    let chunks = data.chunks(size_of::<WireRecord>());
    chunks.map(|bytes| WireRecord::read_from_bytes(bytes).ok()?.record()).collect()
}

fn faults(data: &[u8]) -> Option<Vec<FaultStatus>> {
    let chunks = data.chunks(size_of::<WireFault>());
    chunks.map(|bytes| WireFault::read_from_bytes(bytes).ok()?.status()).collect()
}

fn entries(data: &[u8]) -> Option<Vec<Entry>> {
    let chunks = data.chunks(size_of::<WireEntry>());
    chunks.map(|bytes| WireEntry::read_from_bytes(bytes).ok()?.entry()).collect()
}

fn flag(code: u16) -> Option<bool> {
    match code {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}
