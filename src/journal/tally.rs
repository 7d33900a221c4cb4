//! Counts events that repeat at equal distances.
//!
//! After two equal events, the tally expects a third one at the same distance. From the third event on, events are only
//! counted, until one of them is missing or comes early, or the count has lasted a second. The time of each event can
//! be computed from last time, distance and count, so no information is lost.

use super::catalogue::Catalogue;
use super::coded::Words;
use super::snapshot::event_of;
use super::{Event, Record};
use crate::snapshot_fields::{Damaged, Saved, Saving};

/// Longest distance at which equal events count as repetition: 100 ms of emulated time.
pub(super) const LONGEST_PERIOD_US: u64 = 100_000;
/// A count becomes a record at the latest after this time, so that programs that follow the journal see it.
const LONGEST_TALLY_US: u64 = 1_000_000;

/// Number of different events that can be counted at the same time; a power of two.
const PLACES: usize = 128;
// The index of a place is stored in a byte.
const _: () = assert!(PLACES <= u8::MAX as usize);
/// Number of places where an event may be stored.
const WAYS: usize = 4;

/// An event that may repeat.
#[derive(Clone, Copy)]
struct WatchedEvent {
    event: Event,
    /// Time of the last equal event, in microseconds.
    last: u64,
    /// Distance from the previous event; 0 if there was no previous event, or it was too far away.
    period: u32,
    /// Number of events that were counted and are not in a record yet. The last event was at `last`.
    count: u32,
}

impl WatchedEvent {
    #[inline]
    fn key(&self) -> Words {
        self.event.words()
    }

    fn record(&self) -> Option<Record> {
        (self.count > 0).then(|| Record {
            count: self.count,
            period_us: if self.count > 1 { self.period } else { 0 },
            ..Record::single(self.last, self.event)
        })
    }
}

/// The records that result from an event.
pub(super) struct Outcome {
    /// A count that has ended.
    pub counted: Option<Record>,
    /// True if the event was not counted, so it needs a separate record.
    pub single: bool,
}

/// All events that are watched.
pub(super) struct Tally {
    places: Vec<Option<WatchedEvent>>,
    /// True if no count is running.
    is_quiet: bool,
}

impl Tally {
    pub(crate) fn new() -> Self {
        Tally { places: vec![None; PLACES], is_quiet: true }
    }

    /// Saves the observed events and the counts.
    pub(crate) fn save(&self, to: &mut Saving) {
        let Tally { places, is_quiet } = self;
        to.value(is_quiet);
        to.value(&(places.iter().flatten().count() as u8));
        for (place, watched) in (0u8..).zip(places) {
            if let Some(WatchedEvent { event, last, period, count }) = watched {
                to.value(&(place, event.words(), last, period, count));
            }
        }
    }

    /// Restores the events and counts that [`Tally::save`] has saved.
    pub(crate) fn restore(
        &mut self,
        from: &mut Saved<'_>,
        catalogue: &'static Catalogue,
    ) -> Result<(), Damaged> {
        *self = Tally::new();
        self.is_quiet = from.value()?;
        for _ in 0..from.value::<u8>()? {
            let (place, words, last, period, count): (u8, Words, u64, u32, u32) = from.value()?;
            let event = event_of(words, catalogue, from)?;
            let place = self.places.get_mut(usize::from(place)).ok_or_else(|| from.no("place"))?;
            *place = Some(WatchedEvent { event, last, period, count });
        }
        Ok(())
    }

    /// Counts an event, or decides to record it.
    #[inline]
    pub(crate) fn see(&mut self, time_us: u64, event: Event) -> Outcome {
        let key = event.words();
        let Some(place) = self.place(key) else { return Outcome { counted: None, single: true } };
        match place {
            Some(watched) if watched.key() == key => {
                let distance = time_us.saturating_sub(watched.last);
                if distance != 0 && distance == u64::from(watched.period) {
                    watched.last = time_us;
                    watched.count += 1;
                    let full = u64::from(watched.count) * distance >= LONGEST_TALLY_US;
                    let counted = if full { watched.record() } else { None };
                    if full {
                        watched.count = 0;
                    }
                    self.is_quiet = false;
                    return Outcome { counted, single: false };
                }
                let counted = watched.record();
                watched.count = 0;
                watched.last = time_us;
                watched.period = if distance <= LONGEST_PERIOD_US { distance as u32 } else { 0 };
                Outcome { counted, single: true }
            }
            _ => {
                let counted = place.as_ref().and_then(WatchedEvent::record);
                *place = Some(WatchedEvent { event, last: time_us, period: 0, count: 0 });
                Outcome { counted, single: true }
            }
        }
    }

    /// Returns the place of the event. For a new event, returns an empty place among those where it may be stored,
    /// otherwise the place of the event that has not occurred for the longest time.
    #[inline]
    fn place(&mut self, key: Words) -> Option<&mut Option<WatchedEvent>> {
        let mixed = key[0].wrapping_add(key[1].rotate_left(24)).wrapping_add(key[2].rotate_left(44));
        let home = (mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize;
        let mut best = home % PLACES;
        let mut oldest = u64::MAX;
        for way in 0..WAYS {
            let at = (home + way) % PLACES;
            match self.places.get(at)? {
                Some(watched) if watched.key() == key => {
                    best = at;
                    break;
                }
                Some(watched) if watched.last < oldest => (best, oldest) = (at, watched.last),
                Some(_) => {}
                // A place that was used once never becomes empty again. So if this place is empty, the later places are
                // empty, too.
                None => {
                    best = at;
                    break;
                }
            }
        }
        self.places.get_mut(best)
    }

    /// Ends counts if their next event was expected before `now` and is missing. Returns their records in the order of
    /// time.
    pub(crate) fn overdue(&mut self, now: u64) -> Vec<Record> {
        if self.is_quiet {
            return Vec::new();
        }
        let records = self.end(|watched| watched.last + u64::from(watched.period) < now);
        self.is_quiet = self.places.iter().flatten().all(|watched| watched.count == 0);
        records
    }

    /// Ends all counts. Returns their records in the order of time.
    pub(crate) fn all(&mut self) -> Vec<Record> {
        if core::mem::replace(&mut self.is_quiet, true) { Vec::new() } else { self.end(|_| true) }
    }

    fn end(&mut self, is_over: impl Fn(&WatchedEvent) -> bool) -> Vec<Record> {
        let mut records = Vec::new();
        for watched in self.places.iter_mut().flatten() {
            if watched.count > 0 && is_over(watched) {
                records.extend(watched.record());
                watched.count = 0;
            }
        }
        records.sort_by_key(|record| record.time_us);
        records
    }

    /// Records of the running counts, in the order of time.
    pub(crate) fn pending(&self) -> Vec<Record> {
        let mut records: Vec<_> = self.places.iter().flatten().filter_map(WatchedEvent::record).collect();
        records.sort_by_key(|record| record.time_us);
        records
    }
}
