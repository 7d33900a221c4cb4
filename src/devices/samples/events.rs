//! Test events of every registered kind.

use crate::devices::catalogue;
use crate::journal::{Event, EventKind, Packer};
use proptest::prelude::*;

/// Any event of any kind.
pub(crate) fn event() -> impl Strategy<Value = Event> {
    event_at(proptest::sample::select(&catalogue().kinds[..]), any::<(u16, u8)>())
}

/// Returns any event of these kinds. It belongs to the bus or PLC of this index, or to the port of this
/// number.
pub(crate) fn event_at(
    kind: impl Strategy<Value = &'static EventKind>,
    place: impl Strategy<Value = (u16, u8)>,
) -> impl Strategy<Value = Event> {
    // The strategy includes values that consist of several small numbers, and the index of a guest.
    let two = (0..9_u32, 0..5_u32, 1..4_u32).prop_map(|(low, high, octet)| low | high << (8 * octet));
    let guest = 0x00FF_FF01..0x00FF_FF04_u32;
    let number = prop_oneof![
        12 => 0..8_u32,
        3 => 0..0x40_u32,
        3 => 0..0x1_0000_u32,
        3 => any::<u32>(),
        3 => two,
        1 => guest,
    ];
    let what = (place, proptest::array::uniform5(number));
    (kind, what).prop_filter_map("numbers that mean something", |(kind, ((index, number), halves))| {
        let mut packer = Packer::new(kind, index, number);
        halves.into_iter().for_each(|half| packer.put(half));
        let words = kind.normal(packer.words(), catalogue())?;
        Some(catalogue().event(words).unwrap())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::journal::Names;
    use crate::journal::Source;
    use crate::journal::jsonl::Jsonl;
    use crate::journal::text::Text;
    use crate::journal::{Format, Record};
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;

    /// Any record of this event.
    fn record(event: Event) -> impl Strategy<Value = Record> {
        let seq = prop_oneof![any::<u64>(), Just(Record::PENDING)];
        let repeated = prop_oneof![Just((1, 0)), (2..=u32::MAX, any::<u32>())];
        let octets = prop::option::of(prop::collection::vec(any::<u8>(), 0..=255));
        (seq, any::<u64>(), repeated, any::<Option<u32>>(), octets).prop_map(
            move |(seq, time_us, (count, period_us), latency_us, octets)| Record {
                seq,
                time_us,
                event,
                count,
                period_us,
                latency_us,
                octets: octets.map(Into::into),
                phases: None,
            },
        )
    }

    fn json(record: &Record) -> String {
        let mut line = String::new();
        Jsonl::new(Names::default(), catalogue()).record(record, &mut line);
        line
    }

    #[test]
    fn every_kind_is_among_the_samples() {
        let (mut runner, events) = (TestRunner::deterministic(), event());
        let mut drawn = || events.new_tree(&mut runner).unwrap().current().kind();
        let mut missing = catalogue().kinds.clone();
        for _ in 0..10_000 {
            let kind = drawn();
            missing.retain(|other| *other != kind);
        }
        assert_eq!(missing, Vec::<&crate::journal::EventKind>::new());
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn words_give_the_event_back(event in event()) {
            prop_assert_eq!(catalogue().event(event.words()), Some(event));
        }

        #[test]
        fn words_differ_if_the_events_do(one in event(), other in event()) {
            prop_assert_eq!(one == other, one.words() == other.words());
        }

        #[test]
        fn a_line_of_json_gives_the_record_back(record in event().prop_flat_map(record)) {
            let line: serde_json::Value = serde_json::from_str(&json(&record)).unwrap();
            let number = |name: &str| line[name].as_u64();
            prop_assert_eq!(number("seq"), (!record.is_pending()).then_some(record.seq));
            prop_assert_eq!(number("time_us"), Some(record.time_us));
            let repeated = (record.count > 1).then_some((record.count, record.period_us, record.first_us()));
            prop_assert_eq!(number("count"), repeated.map(|(count, ..)| count.into()));
            prop_assert_eq!(number("period_us"), repeated.map(|(_, period_us, _)| period_us.into()));
            prop_assert_eq!(number("first_us"), repeated.map(|(.., first_us)| first_us));
            prop_assert_eq!(number("latency_us"), record.latency_us.map(u64::from));
            prop_assert_eq!(line["kind"].as_str(), Some(record.event.kind().name()));
            let names = Names::default();
            let place = match record.event.source() {
                Source::Bus(bus) => (Some(names.bus(bus)), None, None),
                Source::Plc(plc) => (None, Some(names.plc(plc)), None),
                Source::Node(origin) => (None, Some(names.plc(origin.plc)), Some(origin.node.0.into())),
            };
            prop_assert_eq!((line["bus"].as_str(), line["plc"].as_str()), (place.0.as_deref(), place.1.as_deref()));
            // If the kind itself has a field with the name of the place (`node`), the line contains this
            // field instead of the place.
            prop_assert!(place.2.is_none() || number("node") == place.2);
        }

        #[test]
        fn every_event_reads(event in event()) {
            let record = Record { seq: 7, ..Record::single(8, event) };
            let (mut text, mut json) = (String::new(), String::new());
            Text::new(Names::default(), catalogue()).record(&record, &mut text);
            Jsonl::new(Names::default(), catalogue()).record(&record, &mut json);
            prop_assert!(text.ends_with('\n') && text.lines().count() == 1, "{}", text);
            let json: serde_json::Value = serde_json::from_str(&json).unwrap();
            prop_assert_eq!(json["kind"].as_str(), Some(event.kind().name()));
        }
    }
}
