//! The rings: one for each group of kinds of records, read as one sequence.
//!
//! A record occupies a [`Line`]. Octets of telegrams are stored separately, and count as lines of the same size. Thus a
//! ring with telegrams contains fewer records, and does not need more memory.

use super::kind::RINGS;
use super::{Event, Record};
use std::collections::VecDeque;
use std::collections::vec_deque::Iter;
use std::sync::Arc;

/// A record without octets.
struct Line {
    seq: u64,
    time_us: u64,
    event: Event,
    count: u32,
    period_us: u32,
    latency_us: Option<u32>,
}

/// Octets of the record with a number.
struct StoredOctets {
    seq: u64,
    octets: Arc<[u8]>,
}

impl StoredOctets {
    /// Returns the number of bytes of memory for these octets. It includes two counters, and the allocator's header of
    /// about the same size.
    fn bytes(&self) -> usize {
        size_of::<Self>() + 4 * size_of::<usize>() + self.octets.len()
    }
}

/// A ring with its records.
#[derive(Default)]
struct RecordRing {
    lines: VecDeque<Line>,
    /// Octets of the records that have octets, in ascending order of their numbers.
    octets: VecDeque<StoredOctets>,
    /// Number of bytes of memory of all octets.
    octet_bytes: usize,
}

impl RecordRing {
    /// Appends a line. Drops the oldest records until there is room for it and its octets in a ring of `capacity` lines.
    #[inline]
    fn append(&mut self, line: Line, octets: Option<Arc<[u8]>>, capacity: usize) {
        if self.is_full(capacity) {
            self.make_room(capacity);
        }
        if let Some(octets) = octets {
            self.push_octets(StoredOctets { seq: line.seq, octets });
        }
        self.lines.push_back(line);
    }

    /// True if lines and octets leave no room for a line.
    #[inline]
    fn is_full(&self, capacity: usize) -> bool {
        self.lines.len() + self.octet_bytes / size_of::<Line>() >= capacity
    }

    fn make_room(&mut self, capacity: usize) {
        // The newest record is always kept, even if it alone exceeds the capacity.
        while !self.lines.is_empty() && self.is_full(capacity) {
            let dropped = self.lines.pop_front();
            while let (Some(line), Some(first)) = (&dropped, self.octets.front())
                && first.seq <= line.seq
            {
                self.octet_bytes -= first.bytes();
                self.octets.pop_front();
            }
        }
    }

    fn push_octets(&mut self, stored: StoredOctets) {
        self.octet_bytes += stored.bytes();
        self.octets.push_back(stored);
        // Octets and lines share the memory of the ring, so fewer lines fit now. Memory that the lines no longer
        // need is released.
        if self.lines.capacity() / 4 > self.lines.len().max(16) {
            self.lines.shrink_to(2 * self.lines.len());
        }
    }

    /// Drops the records from number `end` on.
    fn truncate(&mut self, end: u64) {
        self.lines.truncate(self.lines.partition_point(|line| line.seq < end));
        self.octets.truncate(self.octets.partition_point(|stored| stored.seq < end));
        self.octet_bytes = self.octets.iter().map(StoredOctets::bytes).sum();
    }
}

/// The records that are kept.
pub(crate) struct Rings {
    record_rings: [RecordRing; RINGS],
    /// Maximum number of records in the rings.
    capacity: usize,
    /// Number of the next record.
    end: u64,
}

impl Rings {
    /// Rings for `capacity` records each, at least one.
    pub(crate) fn new(capacity: usize) -> Self {
        Rings {
            record_rings: core::array::from_fn(|_| RecordRing::default()),
            capacity: capacity.max(1),
            end: 0,
        }
    }

    /// Gives a record its number and appends it. If its ring is full, drops the oldest records of this ring.
    pub(crate) fn note(&mut self, record: Record) {
        // The phases are added when the record is read.
        let Record { seq: _, time_us, event, count, period_us, latency_us, octets, phases: _ } = record;
        self.append(Line { seq: self.end, time_us, event, count, period_us, latency_us }, octets);
    }

    /// Does the same as [`Rings::note`] for a record of one event.
    #[inline]
    pub(crate) fn note_single(&mut self, time_us: u64, event: Event, octets: Option<Arc<[u8]>>) {
        let line = Line { seq: self.end, time_us, event, count: 1, period_us: 0, latency_us: None };
        self.append(line, octets);
    }

    #[inline]
    fn append(&mut self, line: Line, octets: Option<Arc<[u8]>>) {
        self.end += 1;
        let ring = line.event.kind().ring();
        self.record_rings[ring as usize].append(line, octets, ring.share(self.capacity));
    }

    /// Sets the number of the next record to `end`. Earlier records are kept only if they are of the same run.
    pub(crate) fn begin_at(&mut self, end: u64, is_same_run: bool) {
        self.end = end;
        for record_ring in &mut self.record_rings {
            record_ring.truncate(if is_same_run { end } else { 0 });
        }
    }

    /// Takes the records out of the rings. The empty rings then record new events until the caller puts the old records
    /// back.
    pub(crate) fn lay_aside(&mut self) -> Self {
        let new = Rings { end: self.end, ..Rings::new(self.capacity) };
        core::mem::replace(self, new)
    }

    /// Returns the number of the next record.
    pub(crate) fn end(&self) -> u64 {
        self.end
    }

    /// Returns the records from number `from` on.
    pub(crate) fn records(&self, from: u64) -> Records<'_> {
        let rest = self.record_rings.each_ref().map(|record_ring| {
            let start = record_ring.lines.partition_point(|line| line.seq < from);
            let octets = record_ring.octets.partition_point(|stored| stored.seq < from);
            RemainingRecords {
                lines: record_ring.lines.range(start..),
                octets: record_ring.octets.range(octets..),
            }
        });
        Records { rest }
    }
}

/// Records in the order of their numbers.
pub struct Records<'a> {
    rest: [RemainingRecords<'a>; RINGS],
}

/// The remaining records of a ring.
struct RemainingRecords<'a> {
    lines: Iter<'a, Line>,
    octets: Iter<'a, StoredOctets>,
}

impl RemainingRecords<'_> {
    /// Returns the number of the first record.
    fn first(&self) -> Option<u64> {
        self.lines.clone().next().map(|line| line.seq)
    }

    /// Returns the number of the last record.
    fn last(&self) -> Option<u64> {
        self.lines.clone().next_back().map(|line| line.seq)
    }

    fn next(&mut self) -> Option<Record> {
        let line = self.lines.next()?;
        let has_octets = self.octets.clone().next().is_some_and(|stored| stored.seq == line.seq);
        Some(line.record(if has_octets { self.octets.next() } else { None }))
    }

    fn next_back(&mut self) -> Option<Record> {
        let line = self.lines.next_back()?;
        let has_octets = self.octets.clone().next_back().is_some_and(|stored| stored.seq == line.seq);
        Some(line.record(if has_octets { self.octets.next_back() } else { None }))
    }
}

impl Line {
    fn record(&self, stored: Option<&StoredOctets>) -> Record {
        let &Line { seq, time_us, event, count, period_us, latency_us } = self;
        let octets = stored.map(|stored| Arc::clone(&stored.octets));
        Record { seq, time_us, event, count, period_us, latency_us, octets, phases: None }
    }
}

impl Iterator for Records<'_> {
    type Item = Record;

    fn next(&mut self) -> Option<Record> {
        let firsts = self.rest.iter_mut().filter_map(|rest| Some((rest.first()?, rest)));
        firsts.min_by_key(|(seq, _)| *seq)?.1.next()
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.rest.iter().map(|rest| rest.lines.len()).sum();
        (left, Some(left))
    }
}

impl DoubleEndedIterator for Records<'_> {
    fn next_back(&mut self) -> Option<Record> {
        let lasts = self.rest.iter_mut().filter_map(|rest| Some((rest.last()?, rest)));
        lasts.max_by_key(|(seq, _)| *seq)?.1.next_back()
    }
}

impl ExactSizeIterator for Records<'_> {}

#[cfg(test)]
mod tests {
    use super::super::kind::Ring;
    use super::super::testing::Packet;
    use super::*;
    use crate::identity::BusIndex;

    /// The target is an emulator below 32 MB. It uses 12 MB for other purposes, including its binary.
    #[test]
    fn full_rings_take_less_than_20_mb() {
        let mut rings = Rings::new(super::super::Journal::DEFAULT_CAPACITY);
        for time_us in 0..200_000 {
            rings.note(Record::single(time_us, Packet { bus: BusIndex(0), data: 1 }.into()));
        }
        let [traffic, ..] = &rings.record_rings;
        assert_eq!(traffic.lines.len(), super::super::Journal::DEFAULT_CAPACITY);
        let others = Ring::ALL.iter().map(|ring| ring.share(traffic.lines.capacity())).sum::<usize>();
        assert!(others * size_of::<Line>() < 20_000_000, "{others}");
    }

    fn note(rings: &mut Rings, octets: usize) {
        let record = Record::single(rings.end(), Packet { bus: BusIndex(0), data: 1 }.into());
        let octets = (octets > 0).then(|| vec![rings.end() as u8; octets].into());
        rings.note(Record { octets, ..record });
    }

    #[test]
    fn octets_take_the_memory_of_lines() {
        let mut rings = Rings::new(1000);
        (0..10_000).for_each(|n| note(&mut rings, if n % 2 == 0 { 255 } else { 0 }));
        let record_ring = &rings.record_rings[Ring::Traffic as usize];
        let sum: usize = record_ring.octets.iter().map(StoredOctets::bytes).sum();
        assert_eq!(record_ring.octet_bytes, sum);
        assert!(sum + record_ring.lines.len() * size_of::<Line>() <= 1000 * size_of::<Line>() + 400, "{sum}");
        assert!(
            record_ring.lines.len() > 250 && record_ring.octets.len() == record_ring.lines.len() / 2,
            "{}",
            record_ring.lines.len()
        );
        // Records without octets that follow use all lines of the ring.
        (0..1000).for_each(|_| note(&mut rings, 0));
        let record_ring = &rings.record_rings[Ring::Traffic as usize];
        assert_eq!(
            (record_ring.lines.len(), record_ring.octets.len(), record_ring.octet_bytes),
            (1000, 0, 0)
        );
        // The newest record is always kept, even if it alone exceeds the capacity.
        let mut small = Rings::new(1);
        (0..3).for_each(|_| note(&mut small, 255));
        assert_eq!(small.records(0).map(|it| (it.seq, it.octets.unwrap()[0])).collect::<Vec<_>>(), [(2, 2)]);
    }

    #[test]
    fn octets_come_with_their_records_in_both_directions() {
        let mut rings = Rings::new(100);
        (0..60).for_each(|n| note(&mut rings, if n % 3 == 0 { 9 } else { 0 }));
        let check = |record: &Record| {
            let octets = record.octets.as_ref().map(|octets| u64::from(octets[0]));
            assert_eq!(octets, record.seq.is_multiple_of(3).then_some(record.seq));
        };
        let forward: Vec<_> = rings.records(20).inspect(check).collect();
        let mut back: Vec<_> = rings.records(20).rev().inspect(check).collect();
        back.reverse();
        assert!(forward.len() == 40 && forward == back);
        rings.begin_at(31, true);
        assert_eq!(rings.records(0).inspect(check).count(), 31);
        note(&mut rings, 9);
        assert!(rings.records(31).all(|record| record.octets.is_some()));
    }
}
