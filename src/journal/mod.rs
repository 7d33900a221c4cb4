//! The journal: what happened, when, in emulated microseconds.
//!
//! A bounded ring of fixed-size records plus a running hash over **all** records ever written. Two runs
//! are the same run if their hashes are equal; the ring is for reading, and forgets its oldest records.

mod event;

pub use event::{Command, Event, Missed, Origin};

use rustc_hash::FxHasher;
use std::collections::VecDeque;
use std::hash::Hasher;

/// One line of the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Emulated time in microseconds since power-on.
    pub time_us: u64,
    /// What happened.
    pub event: Event,
}

/// Bounded record of a run.
pub struct Journal {
    ring: VecDeque<Record>,
    capacity: usize,
    written: u64,
    hash: FxHasher,
}

impl Journal {
    /// Records kept by default.
    pub const DEFAULT_CAPACITY: usize = 65_536;

    /// A journal that keeps the last `capacity` records (at least one).
    pub fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        Journal { ring: VecDeque::new(), capacity, written: 0, hash: FxHasher::default() }
    }

    /// Appends a record; the oldest one is dropped when the ring is full.
    #[inline]
    pub fn push(&mut self, time_us: u64, event: Event) {
        self.hash.write_u64(time_us);
        for word in event.words() {
            self.hash.write_u64(word);
        }
        self.written += 1;
        if self.ring.len() == self.capacity {
            self.ring.pop_front();
        }
        self.ring.push_back(Record { time_us, event });
    }

    /// The records still kept, oldest first.
    pub fn records(&self) -> impl DoubleEndedIterator<Item = &Record> {
        self.ring.iter()
    }

    /// Number of records written since the start, kept or not.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Hash over all records written since the start. Equal for equal runs on equal versions of
    /// commram; the value itself may change from version to version.
    pub fn hash(&self) -> u64 {
        self.hash.finish()
    }
}

impl Default for Journal {
    fn default() -> Self {
        Journal::new(Self::DEFAULT_CAPACITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sync(bus: u16) -> Event {
        Event::SyncEdge { bus }
    }

    #[test]
    fn forgets_the_oldest_but_hashes_all() {
        let mut small = Journal::new(2);
        let mut large = Journal::new(10);
        for t in 0..5 {
            small.push(t, sync(0));
            large.push(t, sync(0));
        }
        assert_eq!(small.records().map(|r| r.time_us).collect::<Vec<_>>(), [3, 4]);
        assert_eq!((small.written(), small.hash()), (5, large.hash()));
    }

    #[test]
    fn time_order_and_content_change_the_hash() {
        let hash = |records: &[(u64, Event)]| {
            let mut journal = Journal::default();
            for &(t, e) in records {
                journal.push(t, e);
            }
            journal.hash()
        };
        let base = hash(&[(1, sync(0)), (2, sync(1))]);
        assert_ne!(base, hash(&[(1, sync(0)), (3, sync(1))]));
        assert_ne!(base, hash(&[(1, sync(1)), (2, sync(0))]));
        assert_ne!(base, hash(&[(1, sync(0))]));
    }
}
