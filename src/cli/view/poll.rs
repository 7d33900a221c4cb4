//! A poll of the emulator: reads the data for the screen with operations that change nothing in the plant.

use super::source::{RequestError, RequestKind, Source};
use crate::devices;
use crate::devices::ModuleFront;
use crate::identity::DeviceIndex;
use crate::journal::{Change, Changed, Entry, HistoryId, Keep, Record};
use crate::layout::{FrontWord, NamedLocation, RegisterRef, Width};
use crate::memory::header::BoardState;
use crate::plant::Forced;
use crate::request::{
    BusScene, BusState, DriveEntry, InstanceInfo, JournalPart, MAX_OPS, MAX_RECORDS, Op, Reply, WrongReply,
};
use std::collections::HashSet;
use std::time::{Duration, Instant};

/// Maximum number of requests for changes in one poll, and of requests for journal records.
const PARTS: usize = 4;
/// Number of past journal records that are read at the start. They need one request less than a poll may make. The last
/// request is for records that arrive in the meantime.
const BACK: u64 = (PARTS as u64 - 1) * MAX_RECORDS as u64;
/// Maximum number of requests in one poll that search the journal for changes of recorded registers.
const PAST_PARTS: usize = 16;
/// If the last poll was longer ago than this, the poller requests to follow the registers again, because the emulator
/// may have dropped them.
const FORGOTTEN: Duration = Duration::from_secs(5);
/// Minimum pause between two reads of the buses: the emulator must also serve its guests for this operation.
const BUSES: Duration = Duration::from_secs(1);

/// A memory location in the RAM of a PLC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct MemoryLocation {
    /// Number of the PLC.
    pub plc: DeviceIndex,
    /// Offset in the image, in bytes.
    pub offset: u32,
    /// Width of the access.
    pub width: Width,
}

impl MemoryLocation {
    /// Creates the location of a register.
    pub(super) fn register(plc: DeviceIndex, register: &RegisterRef) -> Self {
        Self { plc, offset: register.offset(), width: Width::of(register.ty()) }
    }

    /// Creates the location of a named register or an address.
    pub(super) fn place(plc: DeviceIndex, place: &NamedLocation) -> Self {
        Self { plc, offset: place.offset(), width: place.width() }
    }
}

/// The data that the screen needs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Query {
    /// Registers that the screen shows, which the next poll must read.
    pub registers: Vec<MemoryLocation>,
    /// Registers to follow: the poll also reads their changes.
    pub follow: Vec<MemoryLocation>,
    /// True to read the front panels of the boards.
    pub fronts: bool,
    /// True to read the findings of the access checker.
    pub findings: bool,
    /// True to read the traffic on the buses, and the drives.
    pub scene: bool,
    /// True to read the buses with their doors and stations.
    pub buses: bool,
    /// True to read new records of the journal.
    pub journal: bool,
    /// True to read the changes of all registers that the journal records.
    pub recorded: bool,
}

/// The front panel of a device.
#[derive(Clone, Debug)]
pub(super) struct DeviceFront {
    /// The values that the header page of every device has.
    pub board: BoardState,
    /// Switches and displays that only this device type has.
    pub front: Vec<(&'static FrontWord, u32)>,
    /// Fronts of the modules, each with the name of its port. Empty if the device is not modular.
    pub modules: Vec<(&'static str, ModuleFront)>,
}

/// The result of a poll. A field is empty or `None` if the query did not request its data.
#[derive(Clone, Debug)]
pub(super) struct PollData {
    pub info: InstanceInfo,
    pub forces: Vec<Forced>,
    /// Values of the registers.
    pub values: Vec<(MemoryLocation, u32)>,
    /// Changes since the last poll.
    pub changes: Vec<Change>,
    /// Number of changes that the emulator no longer had.
    pub lost: u64,
    /// Changes from the journal since the last poll.
    pub recorded: Vec<Change>,
    /// Records of the journal since the last poll.
    pub records: Vec<Record>,
    /// Records with a count that can still grow.
    pub pending: Vec<Record>,
    /// The front panels of the PLCs.
    pub faces: Option<Vec<DeviceFront>>,
    /// Findings of the access checker.
    pub findings: Option<Vec<Entry>>,
    /// Traffic on the buses.
    pub scene: Option<Vec<BusScene>>,
    pub drives: Option<Vec<DriveEntry>>,
    /// States of the buses, if they were read in this poll.
    pub buses: Option<Vec<BusState>>,
}

/// Polls the emulator repeatedly and keeps the read positions.
#[derive(Debug, Default)]
pub(super) struct Poller {
    followed: HashSet<MemoryLocation>,
    /// Registers that the emulator refused to read.
    refused: HashSet<MemoryLocation>,
    /// Real time of the last request.
    asked: Option<Instant>,
    asked_for_buses: Option<Instant>,
    next_change: Option<u64>,
    next_record: Option<Cursor>,
    /// Position in the journal up to which the poller has searched for changes of recorded registers.
    past: Cursor,
    /// Number of the next journal record at the time when the set of followed registers last changed.
    followed_from: u64,
    plcs: usize,
}

/// A position in the journal.
#[derive(Debug, Default)]
struct Cursor {
    /// The history that was read last. A plant that goes back in time begins a new history.
    turn: Option<HistoryId>,
    /// Number of the next record.
    next: u64,
}

impl Cursor {
    fn at(next: u64) -> Self {
        Cursor { turn: None, next }
    }

    /// Reads a part of the journal. Returns `None` if the plant has gone back in time; the next call then continues at
    /// the record where the histories diverge.
    fn read(&mut self, source: &mut dyn Source) -> Result<Option<JournalPart>, RequestError> {
        let part = part(source, self.next, MAX_RECORDS)?;
        let known = self.turn.replace(part.turn);
        if known.is_some_and(|known| known.number != part.turn.number) && self.next > part.turn.begin {
            self.next = part.turn.begin;
            return Ok(None);
        }
        self.next = part.next();
        Ok(Some(part))
    }
}

impl Poller {
    /// Polls the emulator.
    ///
    /// # Errors
    /// The emulator does not reply, or sends an unexpected reply.
    pub(super) fn poll(&mut self, source: &mut dyn Source, query: &Query) -> Result<PollData, RequestError> {
        self.follow(source, &query.follow)?;
        let boards = if query.fronts { self.plcs } else { 0 };
        let mut ops = vec![Op::Info, Op::Forces];
        ops.extend(DeviceIndex::first(boards).map(|plc| Op::Board { plc }));
        ops.extend(query.findings.then_some(Op::Findings));
        ops.extend(query.scene.then_some([Op::Scene, Op::Drives]).into_iter().flatten());
        let readable: Vec<_> =
            query.registers.iter().filter(|location| !self.refused.contains(location)).copied().collect();
        let (first, others) = readable.split_at(readable.len().min(MAX_OPS.saturating_sub(ops.len())));
        ops.extend(first.iter().map(peek));
        let mut replies = source.request(&ops, RequestKind::Poll)?.into_iter();
        let info = fits(next(&mut replies)?.info())?;
        let forces = fits(next(&mut replies)?.forces())?;
        let mut faces = Vec::new();
        for plc in DeviceIndex::first(boards) {
            let board = fits(next(&mut replies)?.board())?;
            faces.extend(face(source, &info, plc, board));
        }
        let findings = match query.findings {
            true => Some(fits(next(&mut replies)?.findings())?),
            false => None,
        };
        let (scene, drives) = match query.scene {
            true => (Some(fits(next(&mut replies)?.scene())?), Some(fits(next(&mut replies)?.drives())?)),
            false => (None, None),
        };
        let mut values = Vec::with_capacity(readable.len());
        self.take_values(first, replies, &mut values);
        for part in others.chunks(MAX_OPS) {
            let ops: Vec<_> = part.iter().map(peek).collect();
            let replies = source.request(&ops, RequestKind::Poll)?.into_iter();
            self.take_values(part, replies, &mut values);
        }
        self.plcs = info.names.plcs.len();
        let (changes, lost) = self.changes(source)?;
        let (records, pending) = if query.journal { self.journal(source)? } else { Default::default() };
        let recorded = self.recorded(source, query.recorded)?;
        let buses = if query.buses { self.buses(source)? } else { None };
        self.asked = Some(Instant::now());
        let faces = query.fronts.then_some(faces);
        Ok(PollData {
            info,
            forces,
            values,
            changes,
            lost,
            recorded,
            records,
            pending,
            faces,
            findings,
            scene,
            drives,
            buses,
        })
    }

    fn take_values(
        &mut self,
        locations: &[MemoryLocation],
        replies: impl Iterator<Item = Reply>,
        values: &mut Vec<(MemoryLocation, u32)>,
    ) {
        for (location, reply) in locations.iter().zip(replies) {
            match reply {
                Reply::Value(value) => values.push((*location, value)),
                Reply::Error(_) => {
                    self.refused.insert(*location);
                }
                // After a refusal the emulator executes no further operation of the request. The next poll omits the
                // refused register.
                _ => {}
            }
        }
    }

    /// Requests the emulator to record the changes of registers that are not followed yet.
    fn follow(&mut self, source: &mut dyn Source, wanted: &[MemoryLocation]) -> Result<(), RequestError> {
        if self.asked.is_some_and(|asked| asked.elapsed() > FORGOTTEN) {
            self.followed.clear();
        }
        let new: Vec<_> =
            wanted.iter().filter(|location| !self.followed.contains(location)).copied().collect();
        for part in new.chunks(MAX_OPS - 2) {
            let follow = |location: &MemoryLocation| {
                let (plc, offset, len) = (location.plc, location.offset, location.width.bytes());
                Op::Follow { plc, offset, len, keep: Keep::ForOnlookers }
            };
            let ends = [Op::Journal { from: u64::MAX, max: 0 }, Op::Changes { from: u64::MAX, max: 0 }];
            let ops: Vec<_> = part.iter().map(follow).chain(ends).collect();
            let mut replies = source.request(&ops, RequestKind::Poll)?;
            if let Some(Reply::Error(refused)) = replies.iter().find(|reply| matches!(reply, Reply::Error(_)))
            {
                return Err(RequestError::Refused(refused.to_string()));
            }
            let (_, end) = fits(replies.pop().ok_or_else(wrong)?.changes())?;
            self.next_change.get_or_insert(end);
            self.followed_from = fits(replies.pop().ok_or_else(wrong)?.journal())?.1;
            self.followed.extend(part);
        }
        Ok(())
    }

    fn changes(&mut self, source: &mut dyn Source) -> Result<(Vec<Change>, u64), RequestError> {
        let (mut all, mut lost) = (Vec::new(), 0);
        let Some(next) = &mut self.next_change else { return Ok((all, lost)) };
        for _ in 0..PARTS {
            let op = Op::Changes { from: *next, max: MAX_RECORDS };
            let (changes, end) = fits(one(source, op)?.changes())?;
            // The numbers of changes are continuous until the emulator is restarted.
            let begin = changes.first().map_or(end, |first| first.seq);
            lost += begin.saturating_sub(*next);
            *next = changes.last().map_or(end, |last| last.seq + 1);
            let is_last = changes.is_empty() || *next >= end;
            all.extend(changes);
            if is_last {
                break;
            }
        }
        Ok((all, lost))
    }

    /// Reads the journal records since the last poll, and the records with a count that can still grow.
    fn journal(&mut self, source: &mut dyn Source) -> Result<(Vec<Record>, Vec<Record>), RequestError> {
        let (mut all, mut pending) = (Vec::new(), Vec::new());
        let mut cursor = match self.next_record.take() {
            Some(cursor) => cursor,
            None => Cursor::at(part(source, u64::MAX, 0)?.end.saturating_sub(BACK)),
        };
        let mut latest = cursor.next;
        for _ in 0..PARTS {
            let Some(part) = cursor.read(source)? else { continue };
            latest = part.end;
            let is_last = part.is_last();
            all.extend(part.records);
            pending = part.pending;
            if is_last {
                break;
            }
        }
        // A view that cannot keep up skips old records.
        cursor.next = cursor.next.max(latest.saturating_sub(BACK));
        self.next_record = Some(cursor);
        Ok((all, pending))
    }

    /// Reads changes of recorded registers from the journal: the changes from before the registers were followed and,
    /// with `is_live`, also later ones.
    fn recorded(&mut self, source: &mut dyn Source, is_live: bool) -> Result<Vec<Change>, RequestError> {
        let mut all = Vec::new();
        for _ in 0..PAST_PARTS {
            if !is_live && self.past.next >= self.followed_from {
                break;
            }
            let Some(part) = self.past.read(source)? else { continue };
            let change = |record: &Record| {
                let what = record.event.get::<Changed>()?;
                Some(Change { seq: record.seq, time_us: record.time_us, what })
            };
            all.extend(part.records.iter().filter_map(change));
            if part.is_last() {
                break;
            }
        }
        Ok(all)
    }

    fn buses(&mut self, source: &mut dyn Source) -> Result<Option<Vec<BusState>>, RequestError> {
        if self.asked_for_buses.is_some_and(|asked| asked.elapsed() < BUSES) {
            return Ok(None);
        }
        self.asked_for_buses = Some(Instant::now());
        fits(one(source, Op::Buses)?.buses()).map(Some)
    }
}

fn peek(location: &MemoryLocation) -> Op {
    let MemoryLocation { plc, offset, width } = *location;
    Op::Peek { plc, offset, width }
}

fn face(
    source: &mut dyn Source,
    info: &InstanceInfo,
    plc: DeviceIndex,
    board: BoardState,
) -> Option<DeviceFront> {
    let (header, device) = (source.header(plc)?, info.names.device(plc));
    let front = header.front_words(device).collect();
    Some(DeviceFront { board, front, modules: devices::modules(&header, device).unwrap_or_default() })
}

/// Reads a part of the journal.
fn part(source: &mut dyn Source, from: u64, max: u32) -> Result<JournalPart, RequestError> {
    fits(one(source, Op::Journal { from, max })?.journal_part())
}

fn one(source: &mut dyn Source, op: Op) -> Result<Reply, RequestError> {
    let mut replies = source.request(&[op], RequestKind::Poll)?.into_iter();
    next(&mut replies)
}

/// Returns the next reply, or an error if the emulator refused the operation.
fn next(replies: &mut impl Iterator<Item = Reply>) -> Result<Reply, RequestError> {
    match replies.next() {
        Some(Reply::Error(refused)) => Err(RequestError::Refused(refused.to_string())),
        Some(reply) => Ok(reply),
        None => Err(wrong()),
    }
}

fn fits<T>(content: Result<T, WrongReply>) -> Result<T, RequestError> {
    content.map_err(|error| RequestError::Gone(error.to_string()))
}

fn wrong() -> RequestError {
    RequestError::Gone(WrongReply.to_string())
}
