//! The journal: events with their times in emulated microseconds.
//!
//! The journal has three parts. A running hash covers **all** events ever written: two runs are the same run if their
//! hashes are equal. A table counts the [`Findings`] of the access checker. Bounded rings keep [`Record`]s for reading
//! and drop the oldest ones:
//!
//! - Frames, register traffic, missed deadlines and states have a ring each, so that bus traffic cannot push out the
//!   events that an engineer needs.
//! - Events that repeat at equal distances (SYNC edges, handshakes and missed deadlines of every interval) are counted
//!   in one record with the last time, the distance and the count. No information is lost. Frames are never counted
//!   together.
//! - Records are numbered without gaps. So a reader can continue after the last number that it has read, and can
//!   compute the number of records that it has missed.
//!
//! An [`Event`] consists of an [`EventKind`] and words. This module defines the kinds of events in registers of any
//! device; each family of devices defines its own kinds. Each kind is a structure with an implementation of
//! [`EventText`]. The [`Catalogue`] contains all kinds.
//!
//! [`text`], [`jsonl`], [`candump`], [`pcapng`] write records for people and programs. [`vcd`] and `fst` (feature
//! `studio`) write records as signals: [`Waves`]. `docs/reference/journal.md` describes the formats.

pub mod candump;
mod catalogue;
mod changed;
mod coded;
mod draft;
mod event;
mod fields;
mod finding;
mod findings;
mod fingerprint;
#[cfg(feature = "cli")]
pub(crate) mod folded;
#[cfg(feature = "studio")]
pub mod fst;
mod history;
pub mod jsonl;
mod kind;
mod names;
mod onlookers;
pub mod pcapng;
mod phases;
mod printer;
mod reader;
mod record;
pub mod recording;
mod registers;
mod requests;
mod ring;
mod rule;
mod snapshot;
mod tally;
#[cfg(test)]
#[allow(unreachable_pub, reason = "the macro declares what families publish")]
mod testing;
#[cfg(test)]
mod tests;
pub mod text;
pub mod vcd;
mod waves;
mod window;

pub use catalogue::{Catalogue, FaultName};
pub use changed::{By, ChangeDetails, Changed};
pub use coded::{EventCodec, EventSource, Packer, Part, Unpacker, Words};
pub use event::{Event, Keeping, Origin, Source};
pub use fields::Fields;
pub(crate) use fields::hex;
pub use finding::{Finding, Found};
pub use findings::{Entry, Findings, LONGEST_NOTE, MAX_ENTRIES};
pub(crate) use history::Rams;
pub use history::{Change, KEPT_CHANGES, Keep, MAX_FOLLOWED, Stored};
pub use kind::{ArrivedFrame, EventKind, EventText, Octets, OctetsKind, Ring};
pub use names::Names;
pub use phases::PortPhase;
#[cfg(feature = "script")]
pub(crate) use phases::since;
#[cfg(feature = "script")]
pub(crate) use printer::may_be_lost;
pub use printer::{Printer, Selection};
pub use reader::Reader;
pub use record::Record;
pub use registers::{ChannelWrite, Force, Handshake, Late, Register, State, Unforce};
pub use ring::Records;
pub(crate) use ring::Rings;
pub use rule::{Rule, Severity};
pub use snapshot::HistoryId;
pub use waves::{Past, Waves};
#[cfg(all(feature = "script", feature = "studio"))]
pub(crate) use window::Window;

use crate::identity::DeviceIndex;
use crate::layout::Width;
use core::ops::Range;
use draft::Draft;
use fingerprint::Fingerprint;
use history::History;
use phases::PhaseLog;
use requests::Requests;
use std::sync::Arc;
use tally::{LONGEST_PERIOD_US, Outcome, Tally};
use twox_hash::XxHash3_64;

/// Kinds of events that can happen in any device.
pub static KINDS: &[&EventKind] = &[
    State::KIND,
    Handshake::KIND,
    Register::KIND,
    ChannelWrite::KIND,
    Force::KIND,
    Unforce::KIND,
    Late::KIND,
    Found::KIND,
    Changed::KIND,
];

/// Writes records one after the other in some format: text, or bytes.
pub trait Format<Out = String> {
    /// Appends the head of the output.
    fn begin(&self, out: &mut Out) {
        let _ = out;
    }

    /// Appends the record to `out`, if the format can express it.
    fn record(&mut self, record: &Record, out: &mut Out);

    /// Updates the state of the writer from a record that is not written: the text of later records may depend on the
    /// phase that this record shows.
    fn skip(&mut self, record: &Record);

    /// Appends a note that `lost` records are missing here. Returns false if the format cannot express this.
    fn gap(&mut self, lost: u64, out: &mut Out) -> bool;

    /// Appends the output that the format has held back until the following records were available.
    fn end(&mut self, out: &mut Out) {
        let _ = out;
    }
}

/// The bounded journal of a run.
pub struct Journal {
    ring: Rings,
    tally: Tally,
    requests: Requests,
    findings: Findings,
    /// Time at which the journal next searches for counts that have ended, in microseconds.
    next_look: u64,
    written: u64,
    fingerprint: Fingerprint,
    history: History,
    history_id: HistoryId,
    phases: PhaseLog,
    /// Lowest number that a record can have: 0, or, after a restore, the number that the journal in the snapshot had
    /// reached.
    base: u64,
    /// Earliest emulated time that a record can have, in microseconds: 0, or, after a restore, the time of the
    /// snapshot.
    since_us: u64,
    /// Reports that are not merged yet; `Some` if this journal is a draft, which only collects reports.
    draft: Option<Box<Draft>>,
}

impl Journal {
    /// Records of each kind kept by default.
    pub const DEFAULT_CAPACITY: usize = 65_536;
    /// Maximum number of changes of followed registers that a journal of the default capacity keeps.
    #[cfg(feature = "script")]
    pub(crate) const MOST_CHANGES: usize = Ring::History.share(Self::DEFAULT_CAPACITY);

    /// Returns a journal that keeps the last `capacity` records (at least one) of each kind: frames, register traffic,
    /// missed deadlines, everything else.
    pub fn new(capacity: usize) -> Self {
        Journal {
            ring: Rings::new(capacity),
            tally: Tally::new(),
            requests: Requests::new(),
            findings: Findings::default(),
            next_look: LONGEST_PERIOD_US,
            written: 0,
            fingerprint: Fingerprint::new(),
            history: History::new(),
            history_id: HistoryId::default(),
            phases: PhaseLog::new(capacity),
            base: 0,
            since_us: 0,
            draft: None,
        }
    }

    /// Writes an event. Times must not decrease.
    #[inline]
    pub fn push<T: EventText>(&mut self, time_us: u64, event: T) {
        self.push_octets(time_us, event, None);
    }

    /// Writes an event with octets: those of a telegram as they were on the line, or those of a text. `octets` is
    /// `None` if the event itself contains all octets.
    #[inline]
    pub fn push_octets<T: EventText>(&mut self, time_us: u64, event: T, octets: Option<&[u8]>) {
        if let Some(stored) = event.stored()
            && self.follows()
        {
            self.stored(time_us, stored);
        }
        let (event, keeping) = (Event::from(event), event.keeping());
        match &mut self.draft {
            Some(draft) => draft.event(time_us, event, keeping, octets.map(Arc::from)),
            None => self.keep(time_us, event, keeping, octets.map(Arc::from)),
        }
    }

    #[inline]
    fn keep(&mut self, time_us: u64, event: Event, keeping: Keeping, octets: Option<Arc<[u8]>>) {
        self.witness(time_us, event);
        match keeping {
            Keeping::Noted => self.ring.note_single(time_us, event, octets),
            Keeping::Counted => self.count(time_us, event),
            Keeping::Request { plc, offset, value } => {
                self.requests.written(time_us, plc, offset, value);
                self.ring.note_single(time_us, event, None);
            }
            Keeping::Answer { plc, offset, request, pending_value } => {
                match self.requests.answered(time_us, plc, offset, request, pending_value) {
                    None => self.count(time_us, event),
                    latency_us => {
                        self.ring.note(Record { latency_us, ..Record::single(time_us, event) });
                    }
                }
            }
            Keeping::State { plc, command } => self.note_state(time_us, event, plc, command),
        }
    }

    /// True if any register is followed. If not, no comparison is needed.
    #[inline]
    pub(crate) fn follows(&self) -> bool {
        !self.history.is_empty()
    }

    /// Follows a register from now on, starting with its present value; `false` if too many are followed.
    pub(crate) fn follow(
        &mut self,
        client: u128,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        keep: Keep,
        rams: &impl Rams,
    ) -> bool {
        self.history.follow(client, plc, offset, width, keep, rams)
    }

    /// True if all changes of a register become records.
    pub(crate) fn is_recorded(&self, plc: DeviceIndex, offset: u32) -> bool {
        self.history.is_recorded(plc, offset)
    }

    /// Writes the changes that `find` notes into the journal.
    fn push_changes(&mut self, time_us: u64, find: impl FnOnce(&mut History, &mut dyn FnMut(Changed))) {
        let mut noted = Vec::new();
        find(&mut self.history, &mut |change| noted.push(change));
        noted.into_iter().for_each(|change| self.push(time_us, change));
    }

    /// Compares the followed registers with their previous values.
    #[cold]
    pub(crate) fn compare(&mut self, time_us: u64, by: By, rams: &impl Rams) {
        self.push_changes(time_us, |history, note| history.compare(time_us, by, rams, note));
    }

    /// Compares the followed registers in these bytes of a PLC with their previous values.
    pub(crate) fn compare_in(
        &mut self,
        registers: (DeviceIndex, Range<u32>),
        time_us: u64,
        by: By,
        rams: &impl Rams,
    ) {
        self.push_changes(time_us, |history, note| history.compare_in(registers, time_us, by, rams, note));
    }

    /// Notifies observers that the plant has moved to another moment.
    #[cold]
    pub(crate) fn arrived(&mut self, time_us: u64, rams: &impl Rams) {
        self.history.arrived(time_us, rams);
    }

    #[cold]
    fn stored(&mut self, time_us: u64, stored: Stored) {
        self.push_changes(time_us, |history, note| history.stored(time_us, stored, note));
    }

    /// Returns at most `max` changes of registers that are followed for observers, from number `from` on, and the
    /// number of the next change.
    pub fn changes(&mut self, from: u64, max: usize) -> (Vec<Change>, u64) {
        self.changes_for(0, from, max)
    }

    /// Does the same as [`Journal::changes`] for the registers that a client follows.
    pub(crate) fn changes_for(&mut self, client: u128, from: u64, max: usize) -> (Vec<Change>, u64) {
        self.history.read(client, from, max)
    }

    /// True if a client of a channel follows registers as an observer.
    #[cfg(feature = "channel")]
    pub(crate) fn belongs_to_clients(&self) -> bool {
        self.history.belongs_to_clients()
    }

    /// True if clients of a channel follow so many registers that another client could be refused.
    #[cfg(feature = "channel")]
    pub(crate) fn follows_many_for_clients(&self) -> bool {
        self.history.belongs_to_clients() && self.history.follows_many()
    }

    /// Releases the registers of observers for which `is_present` is false.
    #[cfg(feature = "channel")]
    pub(crate) fn release_departed(&mut self, is_present: impl Fn(u128) -> bool) {
        self.history.release_departed(is_present);
    }

    /// Records a finding of the access checker.
    #[cold]
    pub fn find(&mut self, time_us: u64, finding: Finding) {
        self.find_noted(time_us, finding, None);
    }

    /// Records a finding with a text about the violation. The journal keeps [`LONGEST_NOTE`] bytes of the text, with
    /// blanks in place of control characters.
    #[cold]
    pub fn find_with(&mut self, time_us: u64, finding: Finding, note: &str) {
        let note = finding::note(note);
        self.find_noted(time_us, finding, Some(&note));
    }

    fn find_noted(&mut self, time_us: u64, finding: Finding, note: Option<&str>) {
        if let Some(draft) = &mut self.draft {
            return draft.finding(time_us, finding, note.map(Arc::from));
        }
        let event = Event::from(Found::from(finding));
        self.witness(time_us, event);
        if let Some(note) = note {
            // The words of a finding have no room for the hash of its note, so the hash is added as separate words.
            self.fingerprint.add(time_us, [0, XxHash3_64::oneshot(note.as_bytes()), 0]);
        }
        if self.findings.add(time_us, finding, note) {
            let octets = note.map(|note| Arc::from(note.as_bytes()));
            self.ring.note_single(time_us, event, octets);
        }
    }

    /// Writes an event of any kind.
    #[cfg(test)]
    pub(crate) fn push_event(&mut self, time_us: u64, event: Event) {
        event.kind().push(event.words(), self, time_us);
    }

    /// Adds an event to the hash.
    #[inline]
    fn witness(&mut self, time_us: u64, event: Event) {
        self.fingerprint.add(time_us, event.words());
        self.written += 1;
    }

    #[inline]
    fn count(&mut self, time_us: u64, event: Event) {
        let Outcome { counted, single } = self.tally.see(time_us, event);
        if let Some(record) = counted {
            self.ring.note(record);
        }
        if single {
            self.ring.note_single(time_us, event, None);
        }
    }

    #[cold]
    fn note_state(&mut self, time_us: u64, event: Event, plc: DeviceIndex, command: u32) {
        // The counted events belong to the previous state of the port, so their records are written before the record
        // of the new state.
        self.tally.all().into_iter().for_each(|record| self.ring.note(record));
        let mut shown = None;
        if let Some(State { origin: port, live, offset, to, .. }) = event.get() {
            self.phases.entered(self.ring.end(), PortPhase { port, live });
            shown = (offset == command).then_some(to.into());
        }
        let latency_us = self.requests.commanded(time_us, plc, command, shown);
        self.ring.note(Record { latency_us, ..Record::single(time_us, event) });
    }

    /// Passes the time to the journal, so that the journal writes ended counts even if there are no events. Must be
    /// called at regular intervals of emulated time.
    #[inline]
    pub fn tick(&mut self, now_us: u64) {
        if now_us >= self.next_look {
            self.next_look = now_us + LONGEST_PERIOD_US;
            self.tally.overdue(now_us).into_iter().for_each(|record| self.ring.note(record));
        }
    }

    /// Returns the first time at which [`Journal::tick`] has work to do.
    pub(crate) fn next_look(&self) -> u64 {
        self.next_look
    }

    /// Has the effect of `count` calls of [`Journal::tick`], the first at time `first`, at intervals of `step`.
    pub fn tick_through(&mut self, first: u64, step: u64, count: u64) {
        let end = first + count * step;
        let mut at = first;
        while self.next_look < end {
            at += self.next_look.saturating_sub(at).div_ceil(step) * step;
            if at >= end {
                return;
            }
            self.tick(at);
        }
    }

    /// Returns the records that are still kept, oldest first, without records with a running count
    /// ([`Journal::pending`]).
    pub fn records(&self) -> Records<'_> {
        self.ring.records(0)
    }

    /// Returns the records from number `from` on that are still kept, oldest first. A gap in their numbers shows how
    /// many records are no longer kept.
    pub fn read(&self, from: u64) -> Records<'_> {
        self.ring.records(from)
    }

    /// Returns the records like [`Journal::read`], with the phases that a reader needs for the names of registers
    /// ([`Record::phases`]).
    pub fn read_with_phases(&self, from: u64) -> impl Iterator<Item = Record> + '_ {
        let mut next = None;
        self.read(from).map(move |mut record| {
            if next.is_none_or(|next| self.phases.has_change_in(next, record.seq)) {
                record.phases = Some(self.phases_before(record.seq));
            }
            next = Some(record.seq + 1);
            record
        })
    }

    /// Returns the phases of the ports before the record with number `seq`. Ports that are missing in the result are in
    /// their first phase.
    pub fn phases_before(&self, seq: u64) -> Arc<[PortPhase]> {
        self.phases.before(seq)
    }

    /// Returns the records with a running count, in the order of time. These records have no number yet. A record
    /// appears in [`Journal::records`] as soon as its count has ended, at the latest after a second.
    pub fn pending(&self) -> Vec<Record> {
        self.tally.pending()
    }

    /// Emulated time in microseconds from which on the journal can have records: 0, or the time of the snapshot of
    /// another plant from which the journal continues.
    pub fn since_us(&self) -> u64 {
        self.since_us
    }

    /// Sets the emulated time at which the records begin.
    pub(crate) fn continue_from(&mut self, now_us: u64) {
        self.since_us = now_us;
    }

    /// Returns the number that the next record will have.
    pub fn end(&self) -> u64 {
        self.ring.end()
    }

    /// Returns the findings of the access checker, counted.
    pub fn findings(&self) -> &Findings {
        &self.findings
    }

    /// Removes the findings of the access checker from the table. Their records stay.
    pub fn clear_findings(&mut self) {
        self.findings.clear();
    }

    /// Returns the number of events written since the start, including those that are no longer kept.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Hash over all events written since the start. Equal for equal runs on equal versions of
    /// commram; the value itself may change from version to version.
    pub fn hash(&self) -> u64 {
        self.fingerprint.get()
    }
}

impl Default for Journal {
    fn default() -> Self {
        Journal::new(Self::DEFAULT_CAPACITY)
    }
}
