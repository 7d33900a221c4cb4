//! Drafts of the journal. Buses and watches on several cores report events independently, so the order of their events
//! is not known at first. Each core collects its events in a draft. The journal merges the drafts in the order of time.

use super::{Event, Finding, Journal, Keeping};
use std::sync::Arc;

/// An event or finding in a draft.
#[derive(Clone, Debug)]
pub(crate) struct DraftedItem {
    time_us: u64,
    by: usize,
    what: DraftEntry,
}

#[derive(Clone, Debug)]
enum DraftEntry {
    Event(Event, Keeping, Option<Arc<[u8]>>),
    Finding(Finding, Option<Arc<str>>),
}

/// The entries of the draft, and the current reporter.
#[derive(Debug, Default)]
pub(super) struct Draft {
    by: usize,
    entries: Vec<DraftedItem>,
}

impl Draft {
    #[inline]
    pub(super) fn event(&mut self, time_us: u64, event: Event, keeping: Keeping, octets: Option<Arc<[u8]>>) {
        self.entries.push(DraftedItem {
            time_us,
            by: self.by,
            what: DraftEntry::Event(event, keeping, octets),
        });
    }

    pub(super) fn finding(&mut self, time_us: u64, finding: Finding, note: Option<Arc<str>>) {
        self.entries.push(DraftedItem { time_us, by: self.by, what: DraftEntry::Finding(finding, note) });
    }
}

impl Journal {
    /// Creates a draft for one core. The journal must not follow any register, because a draft does not compare
    /// registers.
    pub(crate) fn draft() -> Self {
        Journal { draft: Some(Box::default()), ..Journal::new(1) }
    }

    /// Sets the reporter, by its number, of all following entries.
    pub(crate) fn set_reporter(&mut self, by: usize) {
        if let Some(draft) = &mut self.draft {
            draft.by = by;
        }
    }

    /// Merges the entries of drafts into the journal: sorted by time, then by reporter, then in the order of each
    /// reporter.
    pub(crate) fn merge_drafts<'a>(&mut self, drafts: impl Iterator<Item = &'a mut Journal>) {
        let drafts = drafts.filter_map(|journal| journal.draft.as_mut());
        let mut entries: Vec<_> = drafts.flat_map(|draft| draft.entries.drain(..)).collect();
        entries.sort_by_key(|entry| (entry.time_us, entry.by));
        for DraftedItem { time_us, what, .. } in entries {
            match what {
                DraftEntry::Event(event, keeping, octets) => self.keep(time_us, event, keeping, octets),
                DraftEntry::Finding(finding, note) => self.find_noted(time_us, finding, note.as_deref()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::BusIndex;
    use crate::journal::testing::{Edge, Packet};

    #[test]
    fn drafts_are_merged_as_if_reported_at_once() {
        let (mut at_once, mut later) = (Journal::default(), Journal::default());
        let mut drafts = [Journal::draft(), Journal::draft()];
        for time in 0..6 {
            for by in 0..10 {
                drafts[by % 2].set_reporter(by);
                for journal in [&mut at_once, &mut drafts[by % 2]] {
                    journal.push(time * 500, Edge { bus: BusIndex::at(by) });
                    journal.push(time * 500, Packet { bus: BusIndex::at(by), data: time as u8 });
                }
            }
        }
        later.merge_drafts(drafts.iter_mut());
        assert_eq!((later.hash(), later.written()), (at_once.hash(), at_once.written()));
        assert!(later.records().eq(at_once.records()) && later.pending() == at_once.pending());
        later.merge_drafts(drafts.iter_mut());
        assert_eq!(later.written(), at_once.written());
    }
}
