//! One poll of an instance on behalf of all readers.

use super::feed::{self, Followed, StateKind, Wish};
use crate::channel::ClientError;
use crate::cli::error::CliError;
use crate::cli::peek::{self, ReadTarget, RegisterReading};
use crate::cli::watch::ChangedRegisters;
use crate::cli::web::link::{Connection, guarded};
use crate::cli::{board, output, status, watch};
use crate::devices;
use crate::identity::DeviceIndex;
use crate::journal::jsonl::Jsonl;
use crate::journal::{Change, Record};
use crate::request::{MAX_OPS, MAX_RECORDS, Op, Reply, WrongReply};
use serde::Serialize;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Maximum number of requests for changes in one round, and of requests for journal records.
const PARTS: usize = 4;
/// Number of read operations in one request. The request also reads the time and the forces.
const READS: usize = MAX_OPS - 2;
/// After a pause longer than this, the registers are followed again: the emulator may have dropped them.
const FORGOTTEN: Duration = Duration::from_secs(5);
/// Pause between two requests to follow the same registers. If one client follows many registers, the emulator drops
/// those that were not requested again.
const REFRESH: Duration = Duration::from_secs(10);
/// Minimum pause between two reads of the buses: the emulator must also serve its guests for this operation.
const BUSES: Duration = Duration::from_secs(1);

/// The result of a poll.
#[derive(Default)]
pub(super) struct Round {
    pub time_us: u64,
    /// The clock in JSON.
    pub clock: String,
    /// The states that a page shows, as JSON.
    pub states: BTreeMap<StateKind, Arc<str>>,
    /// Values of the followed registers by their names.
    pub values: HashMap<String, Vec<RegisterReading>>,
    /// Changes of registers whose changes a reader gets, each with its JSON.
    pub changes: Vec<(Change, String)>,
    /// The last change of each register, by PLC and offset.
    pub last_changes: HashMap<(DeviceIndex, u32), Change>,
    /// Records of the journal, each with its kind and its JSON.
    pub records: Vec<(&'static str, String)>,
    /// Number of changes and records in all earlier rounds.
    pub before: Counts,
    /// Number of changes and records that are lost because the emulator no longer had them.
    pub lost: Counts,
    /// If the plant has gone back in time, the number of the first record of the new history. Records with this number or
    /// a higher one that were read before are no longer part of the journal.
    pub turn_begin: Option<u64>,
    /// The end of the emulator, if this round is the last one.
    pub end: Option<LastRound>,
}

/// What the last round says about the end of the emulator.
pub(super) struct LastRound {
    /// The reason for the end.
    pub reason: String,
    /// True if the rounds contain all changes and records up to the end.
    pub is_complete: bool,
}

/// Numbers of changes and of records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub changes: u64,
    pub records: u64,
}

impl Round {
    /// Creates the last round. `sent` are the changes and records of all other rounds.
    pub(super) fn end(reason: String, is_complete: bool, sent: Counts) -> Self {
        Self { before: sent, end: Some(LastRound { reason, is_complete }), ..Self::default() }
    }

    /// True if the plant has gone back in time.
    pub(super) fn is_turned(&self) -> bool {
        self.turn_begin.is_some()
    }

    /// True if the round has changes or records, or reports that there are some which it does not have.
    fn has_news(&self) -> bool {
        let is_empty = self.changes.is_empty() && self.last_changes.is_empty() && self.records.is_empty();
        !is_empty || self.is_turned() || self.lost != Counts::default()
    }

    /// Notes that the plant has gone back in time. If it has gone back several times, the lowest number counts.
    fn note_turn(&mut self, begin: u64) {
        self.turn_begin = Some(self.turn_begin.map_or(begin, |known| known.min(begin)));
    }
}

/// Polls an instance, and remembers how far it has read.
pub(super) struct Poller {
    connection: Connection,
    /// Real time of the last request.
    asked: Instant,
    /// Time of the last request to follow all registers.
    followed: Option<Instant>,
    asked_for_buses: Option<Instant>,
    buses: Option<Arc<str>>,
    next_change: u64,
    registers: ChangedRegisters,
    next_record: u64,
    /// Writes records as JSON lines. The names of overlaid registers depend on states in earlier records, so one writer
    /// handles all records.
    lines: Jsonl,
    /// Number of the history that was read last. A plant that goes back in time begins a new history.
    turn: u16,
    sent: Counts,
    /// Time and clock of the last complete round.
    shown: (u64, String),
    /// Changes and records of a round that has failed after they were read.
    rest: Option<Round>,
}

impl Poller {
    /// Creates a poller that begins at the present end of the changes and of the journal.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(super) fn new(connection: Connection) -> Result<Self, CliError> {
        let (_, next_change, turn) =
            connection.session.ask(Op::Changes { from: 0, max: 0 })?.turned_changes()?;
        let next_record = connection.session.journal_end()?;
        let asked = Instant::now();
        let lines = Jsonl::new(connection.names.clone(), devices::catalogue());
        let (asked_for_buses, buses, sent) = (None, None, Counts::default());
        Ok(Self {
            connection,
            asked,
            followed: None,
            asked_for_buses,
            buses,
            next_change,
            registers: ChangedRegisters::default(),
            next_record,
            lines,
            turn: turn.number,
            sent,
            shown: Default::default(),
            rest: None,
        })
    }

    /// Polls once. Returns `None` if the emulator does not answer in time.
    ///
    /// # Errors
    /// The emulator has ended. [`Poller::take_rest`] then returns what this poll has read before.
    pub(super) fn poll(&mut self, wish: &Wish) -> Result<Option<Round>, CliError> {
        match guarded(self, |it| &it.connection, |it| it.round(wish)) {
            Ok(round) => Ok(Some(round)),
            Err(CliError::Busy { .. } | CliError::Client(ClientError::Timeout { .. })) => {
                Ok(self.take_rest())
            }
            Err(error) => Err(error),
        }
    }

    /// Returns the changes and records of a round that has failed after they were read, if there are any.
    pub(super) fn take_rest(&mut self) -> Option<Round> {
        self.rest.take()
    }

    /// The number of changes and records in all rounds.
    pub(super) fn sent(&self) -> Counts {
        self.sent
    }

    /// Closes the connection to the emulator.
    pub(super) fn close(self) {
        self.connection.close();
    }

    fn round(&mut self, wish: &Wish) -> Result<Round, CliError> {
        if self.asked.elapsed() > FORGOTTEN || self.followed.is_none_or(|last| last.elapsed() > REFRESH) {
            feed::follow(&self.connection, wish)?;
            self.followed = Some(Instant::now());
        }
        let (time_us, clock) = self.shown.clone();
        let mut round = Round { time_us, clock, before: self.sent, ..Round::default() };
        let outcome = self.fill(wish, &mut round);
        self.sent.changes += round.changes.len() as u64;
        self.sent.records += round.records.len() as u64;
        match outcome {
            Ok(()) => {
                self.shown = (round.time_us, round.clock.clone());
                self.asked = Instant::now();
                Ok(round)
            }
            // The emulator passes on changes and records only once, so they are kept.
            Err(error) => {
                self.rest = Some(round).filter(Round::has_news);
                Err(error)
            }
        }
    }

    fn fill(&mut self, wish: &Wish, round: &mut Round) -> Result<(), CliError> {
        // The changes are read before the clock and the values. If a round reports that the plant went back, it then
        // contains no data from the time before this.
        self.changes(wish, round)?;
        if wish.journal.is_some() {
            self.journal(round)?;
        }
        self.states(wish, round)?;
        self.values(wish, round)
    }

    /// Reads the clock and all states except the buses, in one request.
    fn states(&mut self, wish: &Wish, round: &mut Round) -> Result<(), CliError> {
        let kinds = wish.states.iter().filter(|kind| **kind != StateKind::Buses);
        let kinds: Vec<_> = kinds.filter_map(|kind| Some((*kind, kind.op()?))).collect();
        let ops: Vec<_> = [Op::Info].into_iter().chain(kinds.iter().map(|(_, op)| *op)).collect();
        let mut replies = self.connection.session.request(&ops)?.into_iter();
        let info = replies.next().ok_or(WrongReply)?.info()?;
        round.time_us = info.time_us;
        round.clock = json(&status::ClockJson::from(&info))?;
        for ((kind, _), reply) in kinds.iter().zip(replies) {
            round.states.insert(*kind, self.form(&reply)?.into());
        }
        if wish.states.contains(&StateKind::Boards) {
            let boards = board::entries(&self.connection.session, None)?;
            let form = json(&BTreeMap::from([("boards", boards)]))?;
            round.states.insert(StateKind::Boards, form.into());
        }
        if wish.states.contains(&StateKind::Buses) {
            if self.asked_for_buses.is_none_or(|asked| asked.elapsed() >= BUSES) {
                self.asked_for_buses = Some(Instant::now());
                let reply = self.connection.session.ask(Op::Buses)?;
                self.buses = Some(self.form(&reply)?.into());
            }
            round.states.extend(self.buses.clone().map(|buses| (StateKind::Buses, buses)));
        }
        Ok(())
    }

    fn form(&self, reply: &Reply) -> Result<String, CliError> {
        json(&reply.json(&self.connection.names))
    }

    /// Reads the followed registers, in as many requests as needed.
    fn values(&self, wish: &Wish, round: &mut Round) -> Result<(), CliError> {
        // A register that is both in the list of followed registers and in the list of values is read once.
        let registers: BTreeMap<_, _> = wish.registers().map(|it| (it.text.as_str(), it)).collect();
        let registers: Vec<_> = registers.into_values().collect();
        let mut rest = registers.as_slice();
        while let Some(first) = rest.first() {
            let (mut count, mut reads) = (1, first.target.reads().len());
            while let Some(next) = rest.get(count).map(|next| next.target.reads().len()) {
                if reads + next > READS {
                    break;
                }
                (count, reads) = (count + 1, reads + next);
            }
            let (some, others) = rest.split_at(count);
            let targets: Vec<&ReadTarget> = some.iter().map(|followed| &followed.target).collect();
            let readings = peek::read_each(&self.connection.session, &targets)?;
            let name = |followed: &&Arc<Followed>| followed.text.clone();
            round.values.extend(some.iter().map(name).zip(readings));
            rest = others;
        }
        Ok(())
    }

    fn changes(&mut self, wish: &Wish, round: &mut Round) -> Result<(), CliError> {
        for _ in 0..PARTS {
            let op = Op::Changes { from: self.next_change, max: MAX_RECORDS };
            let (changes, end, turn) = self.connection.session.ask(op)?.turned_changes()?;
            if core::mem::replace(&mut self.turn, turn.number) != turn.number {
                round.note_turn(turn.begin);
            }
            if let Some(first) = changes.first() {
                round.lost.changes += first.seq.saturating_sub(self.next_change);
            }
            self.next_change = changes.last().map_or(end, |last| last.seq + 1);
            let is_last = self.next_change >= end;
            for change in changes {
                round.last_changes.insert((change.what.plc, change.what.offset), change);
                // The texts of a change cost more than all other steps of a round, so they are made only for readers
                // that get them.
                if wish.follows(&change.what) {
                    let report = watch::report(&self.connection.session, &mut self.registers, &change);
                    let form = json(&report)?;
                    round.changes.push((change, form));
                }
            }
            if is_last {
                break;
            }
        }
        Ok(())
    }

    fn journal(&mut self, round: &mut Round) -> Result<(), CliError> {
        for _ in 0..PARTS {
            let op = Op::Journal { from: self.next_record, max: MAX_RECORDS };
            let part = self.connection.session.ask(op)?.journal_part()?;
            if part.turn.number != self.turn {
                self.turn = part.turn.number;
                round.note_turn(part.turn.begin);
            }
            if round.is_turned() && self.next_record > part.turn.begin {
                // The records of the new history follow the record where the histories diverge.
                self.next_record = part.turn.begin;
                if !part.is_last() || part.next() > part.turn.begin {
                    continue;
                }
            }
            if let Some(first) = part.records.first() {
                let lost = first.seq.saturating_sub(self.next_record);
                round.lost.records += lost;
                if lost > 0 || round.is_turned() {
                    self.lines.forget_states();
                }
            }
            let is_last = part.is_last();
            self.next_record = part.next();
            for record in &part.records {
                round.records.push(line(&mut self.lines, record)?);
            }
            if is_last {
                break;
            }
        }
        Ok(())
    }
}

fn line(lines: &mut Jsonl, record: &Record) -> Result<(&'static str, String), CliError> {
    Ok((record.event.kind().name(), json(&lines.line(record))?))
}

fn json(value: &impl Serialize) -> Result<String, CliError> {
    output::json_line(value).map(|line| line.trim_end().to_owned())
}
