//! The faults of an installation: pending and active faults, and their hits.

use super::{
    Draft, Effect, Fault, FaultKind, FaultNews, FaultStatus, Hit, Limit, MAX_FAULTS, News, Owner, Refusal,
    Sites, Target, Values,
};
use crate::journal::Journal;
use crate::snapshot_fields::{Damaged, Saved, Saving};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Time of an event that never occurs.
const NEVER: u64 = u64::MAX;

/// A fault in the list.
struct Entry {
    status: FaultStatus,
    owner: Owner,
    /// Meaning of the values for the family that applies the fault.
    effect: Effect,
    /// Emulated time at which the fault begins, in microseconds.
    begins: u64,
    /// Emulated time at which the fault ends, in microseconds.
    ends: u64,
    /// True if the fault has ended, so that the entry can be removed.
    done: bool,
}

impl Entry {
    fn report(&self, now: u64, journal: &mut Journal, news: News) {
        let FaultStatus { id, fault, .. } = self.status;
        let kind = fault.kind();
        let record = FaultNews { target: fault.target(), id, kind: kind.number(), news };
        // A reader of the journal knows the names of commram's own kinds, but not the name of a kind that a device
        // folder declares. So the record contains this name.
        let name = kind.declaration().map(|_| kind.name().as_bytes());
        journal.push_octets(now, record, name);
    }

    /// True if the fault has hit. A fault of a kind without hits has taken effect as soon as it is active.
    fn has_acted(&self) -> bool {
        let FaultStatus { fault, acting, hits, .. } = self.status;
        hits > 0 || acting && !fault.kind().has_hits()
    }

    fn next_time(&self) -> u64 {
        if self.status.acting { self.ends } else { self.begins }
    }
}

/// A fault in a snapshot: the number of the fault's kind, and only the data that do not follow from the kind.
#[derive(Serialize, Deserialize)]
struct SavedFault {
    id: u16,
    kind: u8,
    index: u16,
    number: u8,
    values: Values,
    at_us: u64,
    limit: Limit,
    acting: bool,
    hits: u32,
    begins: u64,
    ends: u64,
}

impl SavedFault {
    fn of(entry: &Entry) -> Self {
        // The snapshot does not have the effect and the owner, because they follow from the fault. It does not have
        // `done`, because this field is false between two events.
        let Entry { status, owner: _, effect: _, begins, ends, done: _ } = entry;
        let FaultStatus { id, fault, acting, hits } = *status;
        let (index, number) = fault.target().numbers();
        SavedFault {
            id,
            kind: fault.kind().number(),
            index,
            number,
            values: fault.values(),
            at_us: fault.at_us(),
            limit: fault.limit(),
            acting,
            hits,
            begins: *begins,
            ends: *ends,
        }
    }

    fn entry(&self, kinds: &'static [&'static FaultKind], sites: &Sites) -> Option<Entry> {
        let known = kinds.iter().chain(sites.declared(self.index));
        let kind = known.copied().find(|kind| kind.number() == self.kind)?;
        let target = Target::of_numbers(kind.place(), self.index, self.number);
        let values = self.values.map(|value| value.map(u64::from));
        let (count, duration_us) = match self.limit {
            Limit::UntilCleared => (None, None),
            Limit::Count(hits) => (Some(hits.into()), None),
            Limit::Duration(us) => (None, Some(us.into())),
        };
        let fault = Draft { kind, target, values, at_us: self.at_us, count, duration_us }.check().ok()?;
        let owner = sites.owner(&fault).ok()?;
        let status = FaultStatus { id: self.id, fault, acting: self.acting, hits: self.hits };
        let SavedFault { begins, ends, .. } = *self;
        Some(Entry { status, owner, effect: fault.effect(), begins, ends, done: false })
    }
}

/// The list of faults. An empty list costs only a call of [`Faults::is_empty`].
#[derive(Default)]
pub struct Faults {
    entries: Vec<Entry>,
    last_id: u16,
    /// Numbers of the faults that have taken effect and have ended. They are not in a snapshot: a restored plant only
    /// knows its pending and active faults.
    past: BTreeSet<u16>,
    /// Time at which the next fault begins or ends, in microseconds.
    next: Option<u64>,
}

impl Faults {
    /// Saves the pending and active faults.
    pub(crate) fn save(&self, to: &mut Saving) {
        // `next` is not saved, because it follows from the entries.
        let Faults { entries, last_id, past: _, next: _ } = self;
        to.value(&(entries.iter().map(SavedFault::of).collect::<Vec<_>>(), last_id));
    }

    /// Restores the faults of a snapshot. They must be valid for an installation with these `sites`. The buses and
    /// devices restore the effects of faults with their own states.
    pub(crate) fn restore(
        &mut self,
        from: &mut Saved<'_>,
        kinds: &'static [&'static FaultKind],
        sites: &Sites,
    ) -> Result<(), Damaged> {
        let (kept, last_id): (Vec<SavedFault>, u16) = from.value()?;
        from.check(kept.len() <= MAX_FAULTS, "list of faults")?;
        let entries = kept.iter().map(|kept| kept.entry(kinds, sites)).collect::<Option<_>>();
        self.entries = entries.ok_or_else(|| from.no("fault that the plant can have"))?;
        self.last_id = last_id;
        // The numbers can be given again.
        self.past.clear();
        self.schedule();
        Ok(())
    }

    /// True if the list has no fault.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Returns the time at which the next fault begins or ends; `u64::MAX` if none does.
    #[inline]
    pub fn next_time(&self) -> u64 {
        self.next.unwrap_or(NEVER)
    }

    /// Adds a fault, which the bus or device `owner` applies, and returns the number of the fault. The fault begins
    /// with the next call of [`Faults::advance`].
    ///
    /// # Errors
    /// [`Refusal::TooMany`].
    pub fn add(
        &mut self,
        now: u64,
        fault: Fault,
        owner: Owner,
        journal: &mut Journal,
    ) -> Result<u16, Refusal> {
        if self.entries.len() >= MAX_FAULTS {
            return Err(Refusal::TooMany);
        }
        let id = self.free_id();
        self.last_id = id;
        self.past.remove(&id);
        let begins = fault.at_us().max(now);
        let ends = match fault.limit() {
            Limit::Duration(us) => begins.saturating_add(us.into()),
            Limit::UntilCleared | Limit::Count(_) => NEVER,
        };
        let status = FaultStatus { id, fault, acting: false, hits: 0 };
        let entry = Entry { status, owner, effect: fault.effect(), begins, ends, done: false };
        entry.report(now, journal, News::Added);
        self.entries.push(entry);
        self.schedule();
        Ok(id)
    }

    /// Returns the number after the last given number. After 65535 it returns free numbers from 1.
    fn free_id(&self) -> u16 {
        let taken = |id: &u16| self.entries.iter().any(|entry| entry.status.id == *id);
        let mut id = self.last_id;
        loop {
            id = id.checked_add(1).unwrap_or(1);
            // This loop ends, because at most MAX_FAULTS of 65535 numbers are taken.
            if !taken(&id) {
                return id;
            }
        }
    }

    /// Begins and ends faults at time `now`.
    pub fn advance(&mut self, now: u64, journal: &mut Journal) {
        for entry in &mut self.entries {
            entry.status.acting |= entry.begins <= now;
            if entry.ends <= now {
                entry.report(now, journal, News::Over);
                entry.done = true;
            }
        }
        self.tidy_up();
    }

    /// Clears a fault.
    ///
    /// # Errors
    /// [`Refusal::UnknownFault`].
    pub fn clear(&mut self, now: u64, id: u16, journal: &mut Journal) -> Result<(), Refusal> {
        let entry = self.entries.iter_mut().find(|entry| entry.status.id == id);
        let entry = entry.ok_or(Refusal::UnknownFault { id })?;
        entry.report(now, journal, News::Cleared);
        entry.done = true;
        self.tidy_up();
        Ok(())
    }

    /// Calls `fire` for each active fault that `owner` applies, in the order in which they were added. `fire` receives
    /// the target, the effect and the number of earlier hits. If the fault hits, `fire` returns the details of the hit.
    pub fn fire<E: 'static>(
        &mut self,
        now: u64,
        owner: Owner,
        journal: &mut Journal,
        mut fire: impl FnMut(Target, &E, u32) -> Option<Hit>,
    ) {
        self.fire_each(now, journal, |entry| {
            if entry.owner != owner {
                return None;
            }
            fire(entry.status.fault.target(), entry.effect.get()?, entry.status.hits)
        });
    }

    /// Calls `fire` for the active faults of all owners.
    pub fn fire_all(
        &mut self,
        now: u64,
        journal: &mut Journal,
        mut fire: impl FnMut(Owner, Target, &Effect) -> Option<Hit>,
    ) {
        self.fire_each(now, journal, |entry| fire(entry.owner, entry.status.fault.target(), &entry.effect));
    }

    fn fire_each(&mut self, now: u64, journal: &mut Journal, mut fire: impl FnMut(&Entry) -> Option<Hit>) {
        let mut over = false;
        for entry in self.entries.iter_mut().filter(|entry| entry.status.acting) {
            let Some(detail) = fire(entry) else { continue };
            entry.status.hits = entry.status.hits.saturating_add(1);
            entry.report(now, journal, News::Hit(detail));
            let limit = entry.status.fault.limit();
            if matches!(limit, Limit::Count(count) if entry.status.hits >= count) {
                entry.report(now, journal, News::Over);
                entry.done = true;
                over = true;
            }
        }
        if over {
            self.tidy_up();
        }
    }

    /// Returns the effects of active faults that `owner` applies, each with its target.
    pub fn acting<E: 'static>(&self, owner: Owner) -> impl Iterator<Item = (Target, &E)> {
        let entries = self.entries.iter().filter(move |entry| entry.status.acting && entry.owner == owner);
        entries.filter_map(|entry| Some((entry.status.fault.target(), entry.effect.get()?)))
    }

    /// Returns the numbers and effects of active faults of the device `owner` itself.
    pub(crate) fn acting_numbered<E: 'static>(&self, owner: Owner) -> impl Iterator<Item = (u16, &E)> {
        let entries = self.entries.iter().filter(move |entry| entry.status.acting && entry.owner == owner);
        entries.filter_map(|entry| Some((entry.status.id, entry.effect.get()?)))
    }

    /// Returns all faults in the order in which they were added.
    pub fn list(&self) -> impl Iterator<Item = FaultStatus> {
        self.entries.iter().map(|entry| entry.status)
    }

    /// True if the fault with this number has taken effect since it was added. The fault may have ended.
    pub fn has_acted(&self, id: u16) -> bool {
        let known = self.entries.iter().find(|entry| entry.status.id == id);
        known.map_or_else(|| self.past.contains(&id), Entry::has_acted)
    }

    fn tidy_up(&mut self) {
        let past = self.entries.iter().filter(|entry| entry.done && entry.has_acted());
        self.past.extend(past.map(|entry| entry.status.id));
        self.entries.retain(|entry| !entry.done);
        self.schedule();
    }

    fn schedule(&mut self) {
        self.next = self.entries.iter().map(Entry::next_time).filter(|time| *time != NEVER).min();
    }
}
