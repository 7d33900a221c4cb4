//! What a snapshot holds of the journal: where it is, not what it has told.

use super::findings::Findings;
use super::history::Followed;
use super::{Catalogue, Coded, Entry, Event, Finding, Found, Journal, Words};
use crate::state::{Damaged, Saved, Saving, State};
use serde::{Deserialize, Serialize};

/// An [`Entry`], with its finding as the journal has it.
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
        let Entry { last, is_single, count, first_us, last_us, latest_us } = *entry;
        KeptEntry { last: Found::from(last).words(), is_single, count, first_us, last_us, latest_us }
    }

    fn entry(&self, catalogue: &'static Catalogue) -> Option<Entry> {
        let KeptEntry { last, is_single, count, first_us, last_us, latest_us } = *self;
        let last: Finding = catalogue.event(last)?.get::<Found>()?.finding(catalogue)?;
        Some(Entry { last, is_single, count, first_us, last_us, latest_us })
    }
}

impl Journal {
    /// Saves its position, its hash, what is being counted and what was found. The records themselves are not kept.
    pub(crate) fn save(&self, to: &mut Saving) {
        let Journal { ring, tally, requests, findings, next_look, written, fingerprint, history, epoch: _ } = self;
        to.value(&(ring.end(), next_look, written));
        tally.save(to);
        requests.save(to);
        let (single, records, further) = findings.parts();
        let kept = |entries: &[Entry]| entries.iter().map(KeptEntry::of).collect::<Vec<_>>();
        to.value(&(kept(single), records, kept(further)));
        fingerprint.save(to);
        to.value(&history.in_journal().collect::<Vec<&Followed>>());
    }

    /// Takes over the position of a snapshot. `goes_back`: this journal has been there, so its records up to there stay;
    /// otherwise they are another plant's, and none stays. Whoever reads it is told by [`Journal::epoch`] that it is another
    /// one from now on.
    pub(crate) fn restore(
        &mut self,
        from: &mut Saved<'_>,
        catalogue: &'static Catalogue,
        goes_back: bool,
    ) -> Result<(), Damaged> {
        let end;
        (end, self.next_look, self.written) = from.value()?;
        self.epoch = self.epoch.wrapping_add(1);
        self.ring.begin_at(end, goes_back);
        self.tally.restore(from, catalogue)?;
        self.requests.restore(from)?;
        let (single, records, further): (Vec<KeptEntry>, Vec<u8>, Vec<KeptEntry>) = from.value()?;
        let entries = |kept: Vec<KeptEntry>| kept.iter().map(|entry| entry.entry(catalogue)).collect::<Option<_>>();
        let findings = entries(single).zip(entries(further));
        let (single, further) = findings.ok_or_else(|| from.no("finding"))?;
        self.findings = Findings::of_parts(single, records, further).ok_or_else(|| from.no("table of findings"))?;
        self.fingerprint.restore(from)?;
        self.history.restore_in_journal(from.value()?);
        Ok(())
    }

    /// How often its records were replaced by those of a snapshot. Numbers and times of records are comparable within one
    /// epoch only.
    #[must_use]
    pub fn epoch(&self) -> u32 {
        self.epoch
    }
}

/// The event with these words, if there is one.
pub(super) fn event_of(words: Words, catalogue: &'static Catalogue, from: &Saved<'_>) -> Result<Event, Damaged> {
    catalogue.event(words).ok_or_else(|| from.no("event"))
}
