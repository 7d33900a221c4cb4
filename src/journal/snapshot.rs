//! The part of the journal in a snapshot: its position, counts and findings, not its records.

use super::finding;
use super::findings::Findings;
use super::history::FollowedRegister;
use super::ring::Rings;
use super::{Catalogue, Entry, Event, EventCodec, Finding, Found, Journal, PortPhase, Words};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};

/// A history: the run of a plant between two returns to earlier moments. Numbers and times of records are comparable
/// only within one history.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct HistoryId {
    /// Number of the history. It is incremented at each return to an earlier moment or to a snapshot, and wraps around
    /// after 65535.
    pub number: u16,
    /// Number of the first record after the last return. Earlier records belong to the previous history. If a reader
    /// has asked for records before the journal's first record, the reply contains the number of the journal's first
    /// record here (D-709).
    pub begin: u64,
}

/// Bit in the number of records of an entry: the entry has a note.
const HAS_NOTE: u8 = 0x80;

/// An [`Entry`] with its finding in the form of an event.
#[derive(Serialize, Deserialize)]
struct KeptEntry {
    last: Words,
    is_single: bool,
    count: u64,
    first_us: u64,
    last_us: u64,
    latest_us: u32,
}

impl KeptEntry {
    fn of(entry: &Entry) -> Self {
        // The notes follow the table.
        let Entry { last, is_single, count, first_us, last_us, latest_us, note: _ } = *entry;
        KeptEntry { last: Found::from(last).words(), is_single, count, first_us, last_us, latest_us }
    }

    fn entry(&self, catalogue: &'static Catalogue) -> Option<Entry> {
        let KeptEntry { last, is_single, count, first_us, last_us, latest_us } = *self;
        let last: Finding = catalogue.event(last)?.get::<Found>()?.finding(catalogue)?;
        Some(Entry { last, is_single, count, first_us, last_us, latest_us, note: None })
    }
}

impl Journal {
    /// Saves the position, the hash, the running counts and the findings. The records themselves are not kept.
    pub(crate) fn save(&self, to: &mut Saving) {
        let Journal {
            ring,
            tally,
            requests,
            findings,
            next_look,
            written,
            fingerprint,
            history,
            history_id: _,
            // Taken from the firmware when the snapshot is restored.
            phases: _,
            // Set to the end and the time of the snapshot when it is restored.
            base: _,
            since_us: _,
            // The journal of a plant is not a draft.
            draft: _,
        } = self;
        to.value(&(ring.end(), next_look, written));
        tally.save(to);
        requests.save(to);
        let (single, records, further) = findings.parts();
        let kept = |entries: &[Entry]| entries.iter().map(KeptEntry::of).collect::<Vec<_>>();
        let noted =
            |(entry, records): (&Entry, &u8)| records | if entry.note.is_some() { HAS_NOTE } else { 0 };
        let records: Vec<u8> = single.iter().zip(records).map(noted).collect();
        to.value(&(kept(single), records, kept(further)));
        single.iter().filter_map(|entry| entry.note.as_deref()).for_each(|note| to.value(&note));
        fingerprint.save(to);
        to.value(&history.in_journal().collect::<Vec<&FollowedRegister>>());
    }

    /// Restores the position, the counts and the findings of a snapshot. `goes_back`: the snapshot is an earlier state of
    /// this journal, which keeps its records up to that position. Otherwise the journal drops all its records, because
    /// they are from another plant. In both cases a new history begins ([`Journal::history_id`]).
    pub(crate) fn restore(
        &mut self,
        from: &mut Saved<'_>,
        catalogue: &'static Catalogue,
        goes_back: bool,
    ) -> Result<(), Damaged> {
        let end;
        (end, self.next_look, self.written) = from.value()?;
        self.history_id = HistoryId { number: self.history_id.number.wrapping_add(1), begin: end };
        if !goes_back {
            self.base = end;
        }
        self.ring.begin_at(end, goes_back);
        self.tally.restore(from, catalogue)?;
        self.requests.restore(from)?;
        let (single, mut records, further): (Vec<KeptEntry>, Vec<u8>, Vec<KeptEntry>) = from.value()?;
        let entries =
            |kept: Vec<KeptEntry>| kept.iter().map(|entry| entry.entry(catalogue)).collect::<Option<_>>();
        let findings = entries(single).zip(entries(further));
        let (mut single, further): (Vec<Entry>, _) = findings.ok_or_else(|| from.no("finding"))?;
        for (entry, records) in single.iter_mut().zip(&mut records) {
            if *records & HAS_NOTE != 0 {
                *records &= !HAS_NOTE;
                let text: String = from.value()?;
                from.check(finding::note(&text) == text, "note of a finding")?;
                entry.note = Some(text.into());
            }
        }
        self.findings =
            Findings::of_parts(single, records, further).ok_or_else(|| from.no("table of findings"))?;
        self.fingerprint.restore(from)?;
        self.history.restore_in_journal(from.value()?);
        Ok(())
    }

    /// Continues with ports in the phases `present`, after a snapshot was restored. `is_same_run`: the snapshot is an
    /// earlier state of this journal.
    pub(crate) fn continue_phases(&mut self, is_same_run: bool, present: impl Iterator<Item = PortPhase>) {
        self.phases.continue_at(self.ring.end(), is_same_run, present);
    }

    /// Returns the history that the records belong to.
    #[must_use]
    pub fn history_id(&self) -> HistoryId {
        self.history_id
    }

    /// Returns the history for a reader of the records from number `from` on. A journal that continues from a snapshot
    /// has no records before that snapshot. If `from` is such a number, the result begins with the first record that
    /// the journal can have, even if there was a return since then.
    pub(crate) fn history_from(&self, from: u64) -> HistoryId {
        if from < self.base { HistoryId { begin: self.base, ..self.history_id } } else { self.history_id }
    }

    /// Takes the records out before a search for an earlier moment, which creates records that are not kept.
    pub(crate) fn lay_aside(&mut self) -> Rings {
        self.history.is_searching = true;
        self.ring.lay_aside()
    }

    /// Ends the search: restores the records up to the present position.
    pub(crate) fn put_back(&mut self, mut records: Rings) {
        self.history.is_searching = false;
        records.begin_at(self.ring.end(), true);
        self.ring = records;
        self.history_id.begin = self.ring.end();
    }
}

/// Decodes an event; an error if the words are not an event.
pub(super) fn event_of(
    words: Words,
    catalogue: &'static Catalogue,
    from: &Saved<'_>,
) -> Result<Event, Damaged> {
    catalogue.event(words).ok_or_else(|| from.no("event"))
}
