//! The rings: one for each kind of record, read as one.

use super::Record;
use super::kind::RINGS;
use std::collections::VecDeque;

/// The records that are kept.
pub(crate) struct Rings {
    lanes: [VecDeque<Record>; RINGS],
    capacity: usize,
    end: u64,
}

impl Rings {
    /// Rings for `capacity` records each, at least one.
    pub(crate) fn new(capacity: usize) -> Self {
        Rings { lanes: [const { VecDeque::new() }; RINGS], capacity: capacity.max(1), end: 0 }
    }

    /// Numbers a record and appends it; the oldest one of its kind is dropped when there is no room.
    #[inline]
    pub(crate) fn note(&mut self, mut record: Record) {
        record.seq = self.end;
        self.end += 1;
        let ring = record.event.kind().ring();
        let lane = &mut self.lanes[ring as usize];
        if lane.len() >= ring.share(self.capacity) {
            lane.pop_front();
        }
        lane.push_back(record);
    }

    /// Gives the next record the number `end`. Earlier records stay if they are of the same run.
    pub(crate) fn begin_at(&mut self, end: u64, is_same_run: bool) {
        self.end = end;
        for lane in &mut self.lanes {
            lane.truncate(if is_same_run { lane.partition_point(|record| record.seq < end) } else { 0 });
        }
    }

    /// The records, while others come here.
    pub(crate) fn lay_aside(&mut self) -> Self {
        let new = Rings { end: self.end, ..Rings::new(self.capacity) };
        core::mem::replace(self, new)
    }

    /// The number of the next record.
    pub(crate) fn end(&self) -> u64 {
        self.end
    }

    /// The records from number `from` on.
    pub(crate) fn records(&self, from: u64) -> Records<'_> {
        let rest = self.lanes.each_ref().map(|lane| {
            let start = lane.partition_point(|record| record.seq < from);
            RemainingRecords { lane, start, end: lane.len() }
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
    lane: &'a VecDeque<Record>,
    start: usize,
    end: usize,
}

impl<'a> RemainingRecords<'a> {
    fn front(&self) -> Option<&'a Record> {
        if self.start < self.end { self.lane.get(self.start) } else { None }
    }

    fn back(&self) -> Option<&'a Record> {
        if self.start < self.end { self.lane.get(self.end - 1) } else { None }
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = &'a Record;

    fn next(&mut self) -> Option<&'a Record> {
        let fronts = self.rest.iter_mut().filter_map(|rest| Some((rest.front()?, rest)));
        let (record, rest) = fronts.min_by_key(|(record, _)| record.seq)?;
        rest.start += 1;
        Some(record)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.rest.iter().map(|rest| rest.end - rest.start).sum();
        (left, Some(left))
    }
}

impl DoubleEndedIterator for Records<'_> {
    fn next_back(&mut self) -> Option<Self::Item> {
        let backs = self.rest.iter_mut().filter_map(|rest| Some((rest.back()?, rest)));
        let (record, rest) = backs.max_by_key(|(record, _)| record.seq)?;
        rest.end -= 1;
        Some(record)
    }
}

impl ExactSizeIterator for Records<'_> {}

#[cfg(test)]
mod tests {
    use super::super::kind::Ring;
    use super::super::testing::Packet;
    use super::*;
    use crate::identity::BusIndex;

    /// With the 12 MB that an emulator takes otherwise, its binary included, it stays below 32 MB.
    #[test]
    fn full_rings_take_less_than_20_mb() {
        let mut rings = Rings::new(super::super::Journal::DEFAULT_CAPACITY);
        for time_us in 0..200_000 {
            rings.note(Record::single(time_us, Packet { bus: BusIndex(0), data: 1 }.into()));
        }
        let [traffic, ..] = &rings.lanes;
        assert_eq!(traffic.len(), super::super::Journal::DEFAULT_CAPACITY);
        let others = Ring::ALL.iter().map(|ring| ring.share(traffic.capacity())).sum::<usize>();
        assert!(others * size_of::<Record>() < 20_000_000, "{others}");
    }
}
