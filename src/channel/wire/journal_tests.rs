use super::*;
use crate::channel::Reply;
use crate::channel::wire::{Block, ReplyBuffer, decode};
use crate::journal::Journal;
use crate::journal::samples::event;
use proptest::prelude::*;

fn record() -> impl Strategy<Value = Record> {
    let latency = proptest::option::of(0..u32::MAX);
    (event(), any::<(u64, u64, u32)>(), 1..u32::MAX, latency).prop_map(
        |(event, (seq, time_us, period_us), count, latency_us)| Record {
            seq,
            time_us,
            event,
            count,
            period_us,
            latency_us,
        },
    )
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn records_come_back_as_they_were(record in record()) {
        prop_assert_eq!(WireRecord::from(&record).record(), Some(record));
    }

    #[test]
    fn any_bytes_give_a_record_that_encodes_the_same_or_none(bytes in any::<[u64; 8]>()) {
        let wire = WireRecord::read_from_bytes(bytes.as_bytes()).unwrap();
        if let Some(record) = wire.record() {
            prop_assert_eq!(WireRecord::from(&record), wire);
            let _ = (record.first_us(), record.times().next());
        }
    }

    #[test]
    fn nearly_valid_records_do_not_panic(record in record(), at in 0_usize..64, byte in any::<u8>()) {
        let mut wire = WireRecord::from(&record);
        wire.as_mut_bytes()[at] = byte;
        if let Some(record) = wire.record() {
            prop_assert_eq!(WireRecord::from(&record), wire);
        }
    }

    #[test]
    fn a_part_of_a_journal_comes_back_as_it_was(
        events in proptest::collection::vec(event(), 0..60),
        from in 0_u64..70,
        max in 0_usize..80,
    ) {
        let mut journal = Journal::default();
        for (time, event) in events.into_iter().enumerate() {
            journal.push(time as u64, event);
        }
        let mut buffer = ReplyBuffer::default();
        buffer.journal(&journal, from, max).unwrap();
        let mut replies = Vec::new();
        decode(buffer.blocks(), &mut replies).unwrap();
        let [Reply::Journal { records, end }] = &replies[..] else { panic!("{replies:?}") };
        prop_assert_eq!(*end, journal.end());
        let noted: Vec<_> = journal.read(from).take(max).copied().collect();
        prop_assert_eq!(&records[..noted.len()], &noted[..]);
        let complete = journal.read(from).count() <= max;
        let pending = if complete { journal.pending() } else { Vec::new() };
        prop_assert_eq!(&records[noted.len()..], &pending[..]);
    }
}

#[test]
fn a_record_cut_short_is_refused() {
    let mut journal = Journal::default();
    journal.push(1, Event::SyncEdge { bus: 0 });
    let mut buffer = ReplyBuffer::default();
    buffer.journal(&journal, 0, 10).unwrap();
    let mut blocks: Vec<Block> = buffer.blocks().to_vec();
    blocks[0].data_len -= 1;
    assert!(decode(&blocks, &mut Vec::new()).is_err());
}
