use super::*;
use crate::channel::wire::{Block, ReplyBuffer, decode, serde_types};
use crate::devices::samples::event;
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::{HistoryId, Journal, Origin, Unforce};
use crate::layout::RegisterPhase;
use crate::request::Reply;
use proptest::prelude::*;

fn record() -> impl Strategy<Value = Record> {
    let latency = proptest::option::of(0..u32::MAX);
    let octets = proptest::option::of(proptest::collection::vec(any::<u8>(), 0..=255));
    let phase = any::<(u16, u8, u8)>().prop_map(|(plc, node, live)| PortPhase {
        port: Origin { plc: DeviceIndex(plc), node: PortNumber(node) },
        live: RegisterPhase::numbered(live),
    });
    let phases = proptest::option::of(proptest::collection::vec(phase, 0..5));
    (event(), any::<(u64, u64, u32)>(), 1..u32::MAX, latency, octets, phases).prop_map(
        |(event, (seq, time_us, period_us), count, latency_us, octets, phases)| Record {
            seq,
            time_us,
            event,
            count,
            period_us,
            latency_us,
            octets: octets.map(Into::into),
            phases: phases.map(Into::into),
        },
    )
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn records_come_back_as_they_were(records in proptest::collection::vec(record(), 0..60), end in any::<u64>()) {
        let sent = Reply::Journal { records, end, turn: HistoryId { number: 2, begin: 5 } };
        let mut buffer = ReplyBuffer::default();
        buffer.push(&sent).unwrap();
        let mut replies = Vec::new();
        decode(buffer.blocks(), &mut replies).unwrap();
        prop_assert_eq!(replies, [sent]);
    }

    #[test]
    fn any_bytes_are_a_record_or_none(bytes in proptest::collection::vec(any::<u8>(), 0..80)) {
        if let Some(record) = serde_types::decode::<WireRecord>(&bytes).and_then(|wire| wire.record()) {
            prop_assert!(record.count > 0);
            let _ = (record.first_us(), record.times().next());
        }
    }

    #[test]
    fn nearly_valid_records_are_records_or_none(record in record(), at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut bytes = serde_types::encode(&WireRecord::from(&record));
        let at = at.index(bytes.len());
        bytes[at] = byte;
        if let Some(wire) = serde_types::decode::<WireRecord>(&bytes) && let Some(record) = wire.record() {
            prop_assert_eq!(WireRecord::from(&record), wire);
            let _ = (record.first_us(), record.times().next());
        }
    }
}

#[test]
fn a_record_cut_short_is_refused() {
    let mut journal = Journal::default();
    journal.push(1, Unforce { plc: DeviceIndex(0), offset: 4 });
    let mut buffer = ReplyBuffer::default();
    let records = journal.read(0).collect();
    buffer.push(&Reply::Journal { records, end: 0, turn: HistoryId::default() }).unwrap();
    let mut blocks: Vec<Block> = buffer.blocks().to_vec();
    blocks[0].data_len -= 1;
    assert!(decode(&blocks, &mut Vec::new()).is_err());
}
