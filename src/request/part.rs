//! Reads the journal in parts: where a part ends, and where the next part begins.
//!
//! Every reader uses [`JournalPart`], because the end number of a journal may be large although the journal has no
//! records. A plant that continues from a snapshot continues the numbers of the snapshot, but does not have the earlier
//! records.

use super::{MAX_RECORDS, Op, Reply, WrongReply};
use crate::journal::{HistoryId, Record};

/// A part of the journal, as one [`Op::Journal`] returns it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JournalPart {
    /// Numbered records, in ascending order.
    pub records: Vec<Record>,
    /// Records that are still being counted, if the part reaches the end of the journal. They have no number yet.
    pub pending: Vec<Record>,
    /// Number of the next record that will be written.
    pub end: u64,
    /// The history that the records belong to.
    pub turn: HistoryId,
}

impl JournalPart {
    pub(super) fn new(records: Vec<Record>, end: u64, turn: HistoryId) -> Self {
        let (pending, records) = records.into_iter().partition(Record::is_pending);
        JournalPart { records, pending, end, turn }
    }

    /// Returns the number of the first record of the next part. A part without records reaches the end of the journal.
    #[must_use]
    pub fn next(&self) -> u64 {
        self.records.last().map_or(self.end, |last| last.seq.saturating_add(1))
    }

    /// True if no part follows this part.
    #[must_use]
    pub fn is_last(&self) -> bool {
        self.next() >= self.end
    }

    /// A plant that continues from a snapshot has no records from before the snapshot. If the part was read from such
    /// an earlier number, returns the number of the first record that the journal can have. The earlier records were
    /// never in this journal, so they do not count as lost.
    #[must_use]
    pub fn begins_at(&self, from: u64) -> Option<u64> {
        let HistoryId { number, begin } = self.turn;
        let has_earlier = self.records.first().is_some_and(|first| first.seq < begin);
        (number > 0 && from < begin && !has_earlier).then_some(begin)
    }
}

/// Reads the journal from record number `from` to its end, in as many operations as needed. If a snapshot is restored
/// during this time, reading starts again, so that all records are of the same history.
///
/// # Errors
/// An operation fails, or a reply contains no further records although it is not the last one.
pub fn read_journal<E: From<WrongReply>>(
    from: u64,
    mut ask: impl FnMut(Op) -> Result<Reply, E>,
) -> Result<JournalPart, E> {
    let mut records = Vec::new();
    let (mut next, mut turn) = (from, None);
    loop {
        let mut part = ask(Op::Journal { from: next, max: MAX_RECORDS })?.journal_part()?;
        // Histories are compared by their numbers only, because `begin` also depends on the first requested record.
        if turn.replace(part.turn.number).is_some_and(|known| known != part.turn.number) {
            records.clear();
            if next > from {
                next = from;
                continue;
            }
        }
        if part.is_last() {
            records.append(&mut part.records);
            return Ok(JournalPart { records, ..part });
        }
        if part.next() <= next {
            return Err(WrongReply.into());
        }
        next = part.next();
        records.append(&mut part.records);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identity::DeviceIndex;
    use crate::journal::{ChannelWrite, Event};

    fn record(seq: u64) -> Record {
        let event = Event::from(ChannelWrite { plc: DeviceIndex(0), offset: 200_000, width: 2, value: 1 });
        Record { seq, ..Record::single(seq, event) }
    }

    fn reply(numbers: &[u64], end: u64, turn: HistoryId) -> Reply {
        Reply::Journal { records: numbers.iter().map(|seq| record(*seq)).collect(), end, turn }
    }

    /// Reads from these replies. Returns the numbers of the records that were read, and the numbers that were requested.
    fn read(from: u64, replies: Vec<Reply>) -> (Result<Vec<u64>, WrongReply>, Vec<u64>) {
        let (mut replies, mut asked) = (replies.into_iter(), Vec::new());
        let read = read_journal(from, |op| {
            let Op::Journal { from, .. } = op else { panic!("{op:?}") };
            asked.push(from);
            Ok(replies.next().expect("no further question"))
        });
        assert_eq!(replies.next(), None);
        (read.map(|part| part.records.iter().map(|record| record.seq).collect()), asked)
    }

    #[test]
    fn parts_are_read_to_the_end() {
        let turn = HistoryId::default();
        let replies = vec![reply(&[3, 4], 9, turn), reply(&[7, 8], 9, turn)];
        assert_eq!(read(3, replies), (Ok(vec![3, 4, 7, 8]), vec![3, 5]));
        assert_eq!(read(9, vec![reply(&[], 9, turn)]), (Ok(vec![]), vec![9]));
    }

    #[test]
    fn a_journal_with_an_end_and_no_records_is_read_at_once() {
        let turn = HistoryId { number: 1, begin: 1000 };
        let Reply::Journal { records, end, .. } = reply(&[], 1000, turn) else { unreachable!() };
        let part = JournalPart::new(records, end, turn);
        assert_eq!((part.is_last(), part.begins_at(0), part.begins_at(1000)), (true, Some(1000), None));
        assert_eq!(read(0, vec![reply(&[], 1000, turn)]), (Ok(vec![]), vec![0]));
        assert_eq!(read(0, vec![reply(&[1000], 1001, turn)]), (Ok(vec![1000]), vec![0]));
    }

    #[test]
    fn records_of_two_histories_are_not_mixed() {
        let (one, other) = (HistoryId::default(), HistoryId { number: 1, begin: 2 });
        let replies = vec![reply(&[0, 1], 4, one), reply(&[2], 3, other), reply(&[0, 2], 3, other)];
        assert_eq!(read(0, replies), (Ok(vec![0, 2]), vec![0, 2, 0]));
    }

    #[test]
    fn a_reply_that_brings_no_progress_is_refused() {
        let turn = HistoryId::default();
        assert_eq!(read(5, vec![reply(&[3], 9, turn)]), (Err(WrongReply), vec![5]));
    }
}
