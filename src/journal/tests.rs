use super::testing::{Edge, Packet, catalogue};
use super::*;
use crate::devices::samples::tables::phases;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use proptest::prelude::*;

fn sync(bus: BusIndex) -> Event {
    Edge { bus }.into()
}

fn frame(data: u8) -> Event {
    Packet { bus: BusIndex(0), data }.into()
}

fn state(to: u16) -> Event {
    let origin = Origin { plc: DeviceIndex(0), node: PortNumber(2) };
    State { origin, offset: 200_002, command: 200_000, from: 0, to, live: phases::CYCLIC }.into()
}

fn handshake(offset: u32) -> Event {
    let origin = Origin { plc: DeviceIndex(0), node: PortNumber(2) };
    Handshake { origin, offset, request: 5, answer: 4, more_answers_follow: false }.into()
}

fn write(offset: u32, value: u32) -> Event {
    ChannelWrite { plc: DeviceIndex(0), offset, width: 1, value }.into()
}

fn journal(events: &[(u64, Event)]) -> Journal {
    let mut journal = Journal::default();
    for &(time, event) in events {
        journal.push_event(time, event);
    }
    journal
}

/// Returns the time, count and distance of the records of an event.
fn counts(records: impl IntoIterator<Item = Record>, event: Event) -> Vec<(u64, u32, u32)> {
    let own = records.into_iter().filter(|record| record.event == event);
    own.map(|record| (record.time_us, record.count, record.period_us)).collect()
}

#[test]
fn forgets_the_oldest_but_hashes_all() {
    let mut small = Journal::new(2);
    let mut large = Journal::new(10);
    for t in 0..5 {
        small.push_event(t, frame(0));
        large.push_event(t, frame(0));
    }
    assert_eq!(small.records().map(|r| r.time_us).collect::<Vec<_>>(), [3, 4]);
    assert_eq!(small.records().rev().map(|r| r.time_us).collect::<Vec<_>>(), [4, 3]);
    assert_eq!((small.written(), small.hash()), (5, large.hash()));
}

#[test]
fn time_order_and_content_change_the_hash() {
    let hash = |events: &[(u64, Event)]| journal(events).hash();
    let base = hash(&[(1, sync(BusIndex(0))), (2, sync(BusIndex(1)))]);
    assert_ne!(base, hash(&[(1, sync(BusIndex(0))), (3, sync(BusIndex(1)))]));
    assert_ne!(base, hash(&[(1, sync(BusIndex(1))), (2, sync(BusIndex(0)))]));
    assert_ne!(base, hash(&[(1, sync(BusIndex(0)))]));
}

#[test]
fn bus_traffic_does_not_push_out_states() {
    let mut journal = Journal::new(100);
    journal.push_event(1, state(2));
    for t in 0..1000 {
        journal.push_event(10 + t, frame(t as u8));
    }
    assert_eq!(journal.records().next().map(|r| r.event), Some(state(2)));
    assert_eq!(journal.records().count(), 101);
    let numbers: Vec<_> = journal.records().map(|r| r.seq).take(3).collect();
    assert_eq!(numbers, [0, 901, 902], "the jump shows that 900 are lost");
}

#[test]
fn a_reader_goes_on_where_it_stopped() {
    let mut journal = journal(&[(1, frame(1)), (2, state(2)), (3, frame(3))]);
    assert_eq!(journal.read(1).map(|r| r.seq).collect::<Vec<_>>(), [1, 2]);
    let end = journal.end();
    assert_eq!(journal.read(end).count(), 0);
    journal.push_event(4, frame(4));
    assert_eq!(journal.read(end).map(|r| r.time_us).collect::<Vec<_>>(), [4]);
    assert_eq!(journal.read(u64::MAX).count(), 0);
}

#[test]
fn sync_edges_at_equal_distances_are_counted_once_a_second() {
    let mut journal = Journal::default();
    for n in 0..1_600 {
        journal.push_event(n * 2_000, sync(BusIndex(0)));
        journal.push_event(n * 2_000 + 700, frame(n as u8));
    }
    // Two edges define the distance. Then 500 edges, 2 ms apart, fill a second.
    let noted = counts(journal.records(), sync(BusIndex(0)));
    assert_eq!(noted[..3], [(0, 1, 0), (2_000, 1, 0), (1_002_000, 500, 2_000)]);
    let pending = journal.pending();
    assert_eq!(counts(pending.clone(), sync(BusIndex(0))), [(3_198_000, 98, 2_000)]);
    assert!(pending[0].is_pending());
    let all: Vec<u64> = journal
        .records()
        .chain(pending)
        .filter(|r| r.event == sync(BusIndex(0)))
        .flat_map(|r| r.times())
        .collect();
    assert_eq!(all, (0..1_600).map(|n| n * 2_000).collect::<Vec<_>>(), "no edge is lost");
}

#[test]
fn a_count_that_is_over_is_noted_without_another_event() {
    let mut journal = Journal::default();
    for n in 0..10 {
        journal.push_event(n * 2_000, sync(BusIndex(0)));
        journal.tick(n * 2_000);
    }
    journal.tick(LONGEST_PERIOD_US);
    assert_eq!(counts(journal.records(), sync(BusIndex(0))).last(), Some(&(18_000, 8, 2_000)));
    assert!(journal.pending().is_empty());
}

#[test]
fn a_count_that_goes_on_is_left_alone_by_the_time() {
    let mut journal = Journal::default();
    for n in 0..=50 {
        journal.tick(n * 2_000);
        journal.push_event(n * 2_000, sync(BusIndex(0)));
    }
    journal.tick(2 * LONGEST_PERIOD_US - 98_000);
    assert_eq!(counts(journal.pending(), sync(BusIndex(0))), [(100_000, 49, 2_000)]);
}

#[test]
fn a_change_of_state_ends_all_counts() {
    let mut journal = Journal::default();
    for n in 0..10 {
        journal.push_event(n * 2_000, sync(BusIndex(0)));
        journal.push_event(n * 2_000 + 500, handshake(200_012));
    }
    journal.push_event(20_000, state(0x80));
    let last: Vec<_> = journal.records().rev().take(3).map(|r| (r.event, r.count)).collect();
    assert_eq!(last, [(state(0x80), 1), (handshake(200_012), 8), (sync(BusIndex(0)), 8)]);
}

#[test]
fn irregular_and_rare_events_are_all_noted() {
    let mut journal = Journal::default();
    for t in [0, 10, 30, 60, 100, 150] {
        journal.push_event(t, handshake(200_012));
    }
    for n in 1..10 {
        journal.push_event(n * 1_000_000, handshake(200_012));
    }
    assert_eq!(journal.records().map(|r| r.count).collect::<Vec<_>>(), [1; 15]);
}

#[test]
fn writes_are_never_counted_together() {
    let events: Vec<_> = (0..10).map(|n| (n * 2_000, write(200_012, 5))).collect();
    assert_eq!(journal(&events).records().count(), 10);
}

#[test]
fn handshakes_know_how_long_their_request_waited() {
    let journal = journal(&[
        (100, write(200_012, 5)),
        (130, write(200_013, 5)),
        (490, handshake(200_012)),
        (2_490, handshake(200_012)),
        (2_600, write(200_012, 4)),
        (4_490, handshake(200_012)),
    ]);
    let latencies: Vec<_> =
        journal.records().filter(|r| r.event == handshake(200_012)).map(|r| r.latency_us).collect();
    assert_eq!(latencies, [Some(390), None, None], "written here, by a mapped client, something else");
}

#[test]
fn an_answer_that_goes_on_leaves_the_request_open() {
    let origin = Origin { plc: DeviceIndex(0), node: PortNumber(2) };
    let answer = |request, answer, more_answers_follow| Handshake {
        origin,
        offset: 200_012,
        request,
        answer,
        more_answers_follow,
    };
    let mut journal = journal(&[(100, write(200_012, 3))]);
    journal.push(300, answer(3, 0x0B, true));
    journal.push(700, answer(0x0B, 0x4B, true));
    journal.push(900, answer(0x4B, 2, false));
    journal.push(950, answer(2, 0, false));
    let latencies: Vec<_> = journal.records().skip(1).map(|record| record.latency_us).collect();
    assert_eq!(latencies, [Some(200), Some(600), Some(800), None]);
}

#[test]
fn a_state_knows_how_long_its_command_waited() {
    let mut journal = journal(&[(100, write(200_000, 2)), (490, state(2))]);
    journal.push_event(900, state(3));
    let latencies: Vec<_> = journal.records().skip(1).map(|record| record.latency_us).collect();
    assert_eq!(latencies, [Some(390), None]);
}

#[test]
fn many_watched_events_do_not_disturb_the_count() {
    // There are more distinct events than in a plant, and far more than the places where one event may be stored.
    let mut journal = Journal::default();
    for n in 0..20 {
        for register in 0..60 {
            journal.push_event(n * 2_000, handshake(200_000 + register));
        }
    }
    let counted = journal.pending().len() + journal.records().filter(|r| r.count > 1).count();
    assert!(counted >= 50, "{counted} of 60 counted");
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Event(u64, u8),
    Tick,
}

proptest! {
    #![proptest_config(crate::property_tests())]

    /// For any events in any rhythm, the records contain every event with its time.
    #[test]
    fn counting_loses_nothing(
        steps in proptest::collection::vec(
            prop_oneof![
                8 => (prop_oneof![Just(500u64), Just(2_000), 0..5_000u64], 0..6u8).prop_map(|(d, e)| Step::Event(d, e)),
                1 => Just(Step::Tick),
            ],
            0..400,
        ),
    ) {
        let events = [sync(BusIndex(0)), sync(BusIndex(1)), handshake(200_012), handshake(200_013), frame(1), state(2)];
        let mut journal = Journal::default();
        let (mut now, mut expected) = (0, Vec::new());
        for step in steps {
            match step {
                Step::Event(distance, which) => {
                    now += distance;
                    journal.push_event(now, events[usize::from(which)]);
                    expected.push((now, which));
                }
                Step::Tick => journal.tick(now),
            }
        }
        let pending = journal.pending();
        let mut found = Vec::new();
        for record in journal.records().chain(pending) {
            let which = events.iter().position(|event| *event == record.event).unwrap() as u8;
            found.extend(record.times().map(|time| (time, which)));
        }
        expected.sort_unstable();
        found.sort_unstable();
        prop_assert_eq!(found, expected);
        let numbers: Vec<_> = journal.records().map(|r| r.seq).collect();
        prop_assert_eq!(numbers, (0..journal.end()).collect::<Vec<_>>());
    }
}

/// Returns the names of a plant with one device.
fn names() -> Names {
    let devices = vec![crate::layout::DeviceFit::unknown(&crate::devices::samples::tables::NODES)];
    Names { plcs: vec!["a".into()], devices, ..Names::default() }
}

/// In JSON Lines a value of a register is a number of its type, as in `commram peek --format json`.
#[test]
fn values_of_signed_registers_have_a_sign() {
    let place = |name: &str| crate::devices::samples::tables::NODES.register(name).unwrap().offset();
    let (plc, live) = (DeviceIndex(0), phases::CYCLIC);
    let origin = Origin { plc, node: PortNumber(2) };
    let (double, short, unsigned) =
        (place("node2.a_RD_BMARRAY[1][0]"), place("node2.i_SW1_RELEASE"), place("node2.w_OPTION_STATUS"));
    let [from, to] = [u32::MAX, 0x8000_0000];
    let how = ChangeDetails { width: crate::layout::Width::Dword, by: By::Firmware, live };
    let handshake =
        |offset| Handshake { origin, offset, request: 0xFFFF, answer: 0x8000, more_answers_follow: false };
    let events: [(Event, &[(&str, i64)]); 7] = [
        (
            State { origin, offset: unsigned, command: 0, from: 2, to: 3, live }.into(),
            &[("from", 2), ("to", 3)],
        ),
        (Changed { plc, offset: double, how, from, to }.into(), &[("from", -1), ("to", i32::MIN.into())]),
        (Register { origin, offset: double, from, to }.into(), &[("from", -1), ("to", i32::MIN.into())]),
        (ChannelWrite { plc, offset: double, width: 4, value: from }.into(), &[("value", -1)]),
        (Force { plc, offset: double, width: 4, value: from }.into(), &[("value", -1)]),
        (handshake(short).into(), &[("request", -1), ("answer", i16::MIN.into())]),
        (handshake(unsigned).into(), &[("request", 0xFFFF), ("answer", 0x8000)]),
    ];
    let mut lines = jsonl::Jsonl::new(names(), catalogue());
    for (event, numbers) in events {
        let mut line = String::new();
        lines.record(&Record::single(1, event), &mut line);
        let line: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert!(line["register"].is_string(), "{line}");
        numbers.iter().for_each(|(field, number)| assert_eq!(line[field], *number, "{line}"));
    }
}

/// A reader knows the valid structures even if the journal has dropped the records of states, and the record of a count
/// that has ended.
#[test]
fn lost_records_do_not_change_the_names_of_overlaid_registers() {
    let (plc, offset) = (DeviceIndex(0), 200_012);
    let mut journal = Journal::new(3);
    let mut expected = Vec::new();
    let phase = |journal: &mut Journal, live| {
        let origin = Origin { plc, node: PortNumber(2) };
        journal.push(1, State { origin, offset: 200_002, command: 200_000, from: 0, to: 3, live });
    };
    for (round, live) in [phases::INIT, phases::CYCLIC, phases::INIT, phases::CYCLIC].into_iter().enumerate()
    {
        phase(&mut journal, live);
        // Register traffic has another ring than states.
        journal.push_event(2, write(offset, round as u32));
        let name = if live == phases::INIT { "node2.b_MA_SL_MODE" } else { "node2.b_CTRLREG_WRC1" };
        expected.push(name);
    }
    // These records push the last states out of the ring. None of these records shows a phase.
    (0..3).for_each(|_| journal.push_event(3, Unforce { plc, offset: 1_000_000 }.into()));
    let read = |from| {
        let mut lines = jsonl::Jsonl::new(names(), catalogue());
        let mut printer = Vec::new();
        for record in journal.read_with_phases(from) {
            let mut line = String::new();
            lines.record(&record, &mut line);
            let line: serde_json::Value = serde_json::from_str(&line).unwrap();
            if line["kind"] == "channel_write" {
                printer.push(line["register"].as_str().unwrap().to_owned());
            }
        }
        printer
    };
    assert!(journal.records().all(|record| !record.event.is::<State>()));
    assert_eq!(read(0), expected[1..]);
    assert_eq!(read(7), expected[3..]);
}
