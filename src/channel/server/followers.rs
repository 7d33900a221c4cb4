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

/// The clients that have read the journal or changes.
#[derive(Default)]
pub(super) struct Followers {
    /// The clients by their numbers.
    clients: HashMap<u128, Follower>,
    /// Real time at which the clock of the emulator has ended.
    ended: Option<Instant>,
}

#[derive(Default)]
struct Follower {
    /// `None` if the client has never read the journal.
    journal: Option<Reading>,
    /// `None` if the client has never read changes.
    changes: Option<Reading>,
    /// True if the client has learned that it has everything.
    is_done: bool,
}

/// How far a client has read the journal, or changes.
#[derive(Clone, Copy)]
struct Reading {
    /// Real time of the last request.
    asked: Instant,
    /// True if the last request began at the end, so that the client had everything before it.
    is_at_end: bool,
    /// True if the emulator has answered a request since its clock has ended. Only this answer contains the final state of
    /// records that are still counted, and shows whether the plant has gone back in time.
    is_answered: bool,
}

impl Reading {
    /// True if the client still read when the clock ended at this time.
    fn is_recent(&self, ended: Instant) -> bool {
        self.asked + RECENT >= ended
    }
}

impl Follower {
    /// Returns what the client still read when the clock ended at this time.
    fn readings(&self, ended: Instant) -> impl Iterator<Item = &Reading> {
        self.journal.iter().chain(&self.changes).filter(move |reading| reading.is_recent(ended))
    }

    fn reading(&mut self, read: &ReadFrom) -> &mut Reading {
        let new = || Reading { asked: Instant::now(), is_at_end: false, is_answered: false };
        let reading = match read {
            ReadFrom::Journal(_) => self.journal.get_or_insert_with(new),
            ReadFrom::Changes(_) => self.changes.get_or_insert_with(new),
        };
        reading.asked = Instant::now();
        reading
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
        if self.clients.len() >= most && !self.clients.contains_key(&client) {
            let present = present();
            self.clients.retain(|client, _| present.contains(client));
        }
        let known = self.clients.entry(client).or_default();
        reads.for_each(|read| {
            known.reading(&read);
        });
    }

    /// Notes that the clock of the emulator has ended. Later calls have no effect.
    pub(super) fn end(&mut self) {
        self.ended.get_or_insert_with(Instant::now);
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
        let ended = *self.ended.get_or_insert_with(Instant::now);
        let mut reads = ops.iter().filter_map(|op| ReadFrom::of(*op)).peekable();
        if reads.peek().is_none() {
            // A follower can need other values with the records, such as the time.
            let is_following = self.clients.get(&client).is_some_and(|known| !known.is_done);
            return if is_following { LastRequest::Answered } else { LastRequest::Refused };
        }
        let known = self.clients.entry(client).or_default();
        for read in reads {
            let is_at_end = match read {
                ReadFrom::Journal(from) => from >= journal.end(),
                ReadFrom::Changes(from) => from >= changes_end,
            };
            known.reading(&read).is_at_end = is_at_end;
        }
        if known.readings(ended).all(|reading| reading.is_at_end && reading.is_answered) {
            known.is_done = true;
            return LastRequest::Refused;
        }
        let reads = ops.iter().filter_map(|op| ReadFrom::of(*op));
        reads.for_each(|read| known.reading(&read).is_answered = true);
        LastRequest::Answered
    }

    /// True if the clock has ended, and a client of `present` that still read then does not know yet that it has everything.
    pub(super) fn are_waiting(&self, present: &[u128]) -> bool {
        let Some(ended) = self.ended else { return false };
        let waits = |known: &Follower| !known.is_done && known.readings(ended).next().is_some();
        self.clients.iter().any(|(client, known)| waits(known) && present.contains(client))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::DeviceIndex;
    use crate::memory::Width;
    use crate::request::Host;
    use crate::request::testing::TestHost;

    const PEEK: Op = Op::Peek { plc: DeviceIndex(0), offset: 200_000, width: Width::Word };

    fn journal(from: u64) -> Op {
        Op::Journal { from, max: 1 }
    }

    fn changes(from: u64) -> Op {
        Op::Changes { from, max: 1 }
    }

    /// The clients of an emulator whose clock has ended, with three records and two changes.
    struct Ended {
        host: TestHost,
        followers: Followers,
    }

    impl Ended {
        fn new() -> Self {
            let mut host = TestHost::new(true);
            let poke = Op::Poke { plc: DeviceIndex(0), offset: 200_000, width: Width::Word, value: 0 };
            while host.plant().journal().end() < 3 {
                host.request(&[poke]);
            }
            Self { host, followers: Followers::default() }
        }

        fn note(&mut self, client: u128, op: Op) {
            self.followers.note(client, &[WireOp::from(&op)], 2, || vec![client]);
        }

        /// True if the request is answered.
        fn answers(&mut self, client: u128, ops: &[Op]) -> bool {
            let ops: Vec<_> = ops.iter().map(WireOp::from).collect();
            let judged = self.followers.judge_last(client, &ops, self.host.plant().journal(), 2);
            judged == LastRequest::Answered
        }

        /// Sets the time of the end to this duration after now.
        fn end_in(&mut self, after: Duration) {
            self.followers.ended = Some(Instant::now() + after);
        }

        fn waits(&self, client: u128) -> bool {
            self.followers.are_waiting(&[client])
        }
    }

    #[test]
    fn a_reader_is_answered_until_it_has_everything() {
        let mut ended = Ended::new();
        ended.note(1, journal(1));
        assert!(ended.answers(1, &[journal(1)]) && ended.answers(1, &[journal(2)]) && ended.waits(1));
        assert!(!ended.answers(1, &[journal(3)]) && !ended.waits(1));
        // The first answer contains the final state of records that are still counted.
        ended.note(2, journal(3));
        assert!(ended.answers(2, &[journal(3)]) && ended.waits(2));
        assert!(!ended.answers(2, &[journal(3)]) && !ended.waits(2));
    }

    #[test]
    fn a_reader_of_both_gets_both() {
        let mut ended = Ended::new();
        ended.note(1, changes(0));
        ended.note(1, journal(0));
        assert!(ended.answers(1, &[changes(2)]) && ended.answers(1, &[journal(0)]));
        assert!(ended.answers(1, &[changes(2)]) && ended.answers(1, &[journal(1)]));
        assert!(ended.answers(1, &[changes(2), PEEK]) && ended.waits(1));
        assert!(!ended.answers(1, &[journal(3)]) && !ended.waits(1));
    }

    #[test]
    fn other_requests_and_other_clients_are_refused() {
        let mut ended = Ended::new();
        ended.note(1, journal(0));
        assert!(ended.answers(1, &[PEEK]) && !ended.answers(2, &[PEEK]));
        assert!(!ended.answers(1, &[Op::Advance { us: 1 }]) && !ended.answers(1, &[journal(0), Op::Stop]));
        assert!(!ended.answers(1, &[Op::Save]) && !ended.answers(1, &vec![journal(0); MAX_OPS + 1]));
        assert!(ended.waits(1));
    }

    #[test]
    fn only_present_clients_that_have_read_lately_are_waited_for() {
        let mut ended = Ended::new();
        ended.note(1, journal(0));
        ended.note(2, PEEK);
        assert!(!ended.waits(1), "the clock runs");
        ended.followers.end();
        assert!(ended.waits(1) && !ended.waits(2) && !ended.followers.are_waiting(&[2, 3]));
        ended.end_in(2 * RECENT);
        assert!(!ended.waits(1));
        for client in 3..9 {
            ended.note(client, journal(0));
            assert!(ended.followers.clients.len() <= 2, "clients that have left are forgotten");
        }
    }

    /// A client that has read the journal once, and follows only changes, need not read the journal again.
    #[test]
    fn only_what_a_client_still_reads_counts() {
        let mut ended = Ended::new();
        ended.note(1, journal(0));
        ended.end_in(2 * RECENT);
        ended.note(1, changes(0));
        let known = ended.followers.clients.get_mut(&1).unwrap();
        known.changes.as_mut().unwrap().asked += 2 * RECENT;
        let ended_at = ended.followers.ended.unwrap();
        assert_eq!(ended.followers.clients[&1].readings(ended_at).count(), 1);
        assert!(ended.waits(1));
    }
}
