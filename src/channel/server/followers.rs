//! Clients that follow the journal or the changes of registers. At the end of the emulator they get the rest of both.
//!
//! A client that has read everything, and asks again, gets [`Code::SHUTTING_DOWN`](crate::request::Code::SHUTTING_DOWN) as
//! answer. So this answer to a client that reads the journal or the changes means that nothing is missing.

use crate::channel::wire::WireOp;
use crate::journal::{Journal, Keep};
use crate::request::{MAX_OPS, Op};
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// A client that has not read for this time is not waited for at the end. It is suspended, or its output is not read.
const RECENT: Duration = Duration::from_millis(500);

/// The clients that have read the journal or changes, by their numbers.
#[derive(Default)]
pub(super) struct Followers(HashMap<u128, Follower>);

struct Follower {
    /// Real time of the last read.
    asked: Instant,
    /// `None` if the client has never read the journal.
    journal: Option<Reading>,
    /// `None` if the client has never read changes.
    changes: Option<Reading>,
    /// True if the client has learned that it has everything.
    is_done: bool,
}

/// How far a client has read one of both.
#[derive(Clone, Copy, Default)]
struct Reading {
    /// True if the last request began at the end, so that the client had all records before it.
    is_at_end: bool,
    /// True if the emulator has answered a request since its clock has ended. Only this answer contains the final state of
    /// records that are still counted, and shows whether the plant has gone back in time.
    is_answered: bool,
}

impl Follower {
    fn has_everything(&self) -> bool {
        let is_complete = |reading: Reading| reading.is_at_end && reading.is_answered;
        self.journal.is_none_or(is_complete) && self.changes.is_none_or(is_complete)
    }
}

/// What the emulator does with a request after its clock has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LastRequest {
    /// Executes it.
    Answered,
    /// Refuses it, because the emulator ends.
    Refused,
}

/// The first record or change that an operation reads.
enum ReadFrom {
    Journal(u64),
    Changes(u64),
}

impl ReadFrom {
    fn of(op: WireOp) -> Option<Self> {
        match Op::try_from(op).ok()? {
            Op::Journal { from, .. } => Some(Self::Journal(from)),
            Op::Changes { from, .. } => Some(Self::Changes(from)),
            _ => None,
        }
    }
}

impl Followers {
    /// Notes a request, if it reads the journal or changes. `present` returns the connected clients; others are forgotten.
    pub(super) fn note(
        &mut self,
        client: u128,
        ops: &[WireOp],
        most: usize,
        present: impl FnOnce() -> Vec<u128>,
    ) {
        let mut reads = ops.iter().take(MAX_OPS).filter_map(|op| ReadFrom::of(*op)).peekable();
        if reads.peek().is_none() {
            return;
        }
        if self.0.len() >= most && !self.0.contains_key(&client) {
            self.keep(&present());
        }
        let known = self.0.entry(client).or_insert_with(Follower::new);
        known.asked = Instant::now();
        reads.for_each(|read| {
            known.reading(&read);
        });
    }

    /// Decides about a request that arrives after the clock has ended. `changes_end` is the number of the next change.
    pub(super) fn judge_last(
        &mut self,
        client: u128,
        ops: &[WireOp],
        journal: &Journal,
        changes_end: u64,
    ) -> LastRequest {
        if ops.len() > MAX_OPS || !ops.iter().all(|op| may_be_last(*op)) {
            return LastRequest::Refused;
        }
        let mut reads = ops.iter().filter_map(|op| ReadFrom::of(*op)).peekable();
        if reads.peek().is_none() {
            // A follower can need other values with the records, such as the time.
            let is_following = self.0.get(&client).is_some_and(|known| !known.is_done);
            return if is_following { LastRequest::Answered } else { LastRequest::Refused };
        }
        let known = self.0.entry(client).or_insert_with(Follower::new);
        for read in reads {
            let is_at_end = match read {
                ReadFrom::Journal(from) => from >= journal.end(),
                ReadFrom::Changes(from) => from >= changes_end,
            };
            known.reading(&read).is_at_end = is_at_end;
        }
        if known.has_everything() {
            known.is_done = true;
            return LastRequest::Refused;
        }
        let reads = ops.iter().filter_map(|op| ReadFrom::of(*op));
        reads.for_each(|read| known.reading(&read).is_answered = true);
        LastRequest::Answered
    }

    /// True if a client of `present` has read lately, and does not know yet that it has everything. `since` is the time at
    /// which the clock has ended.
    pub(super) fn are_waiting(&self, present: &[u128], since: Instant) -> bool {
        self.0.iter().any(|(client, known)| {
            !known.is_done && known.asked + RECENT >= since && present.contains(client)
        })
    }

    fn keep(&mut self, present: &[u128]) {
        self.0.retain(|client, _| present.contains(client));
    }
}

impl Follower {
    fn new() -> Self {
        Self { asked: Instant::now(), journal: None, changes: None, is_done: false }
    }

    fn reading(&mut self, read: &ReadFrom) -> &mut Reading {
        match read {
            ReadFrom::Journal(_) => self.journal.get_or_insert_default(),
            ReadFrom::Changes(_) => self.changes.get_or_insert_default(),
        }
    }
}

/// True if an operation may still be executed after the clock has ended: it changes nothing in the plant.
fn may_be_last(op: WireOp) -> bool {
    match Op::try_from(op) {
        Ok(Op::Follow { keep, .. }) => keep == Keep::ForOnlookers,
        Ok(op) => op.only_looks() && op != Op::Stop,
        Err(_) => false,
    }
}
