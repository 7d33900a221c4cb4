use super::super::testing::{Edge, Packet, catalogue};
use super::*;
use crate::identity::{BusIndex, DeviceIndex};
use crate::journal::coded::EventCodec;
use crate::journal::{By, ChangeDetails, Event};
use crate::layout::RegisterPhase;

fn record(seq: u64, time_us: u64, event: impl Into<Event>) -> Record {
    Record { seq, ..Record::single(time_us, event.into()) }
}

fn changed(offset: u32, from: u32, to: u32) -> Changed {
    let how = ChangeDetails { width: Width::Byte, by: By::Program, live: RegisterPhase::ALWAYS };
    Changed { plc: DeviceIndex(0), offset, how, from, to }
}

fn waves(records: &[Record]) -> Waves {
    let names = Names { plcs: vec!["line".into()], buses: vec!["a bus[1]".into()], ..Names::default() };
    Waves::of(records, &Selection::default(), names, catalogue())
}

#[test]
fn counted_events_appear_at_all_their_times_and_repetitions_are_no_changes() {
    let edges = Record { count: 3, period_us: 10, ..record(0, 120, Edge { bus: BusIndex(0) }) };
    let packets = [105, 115, 125].map(|time| record(time, time, Packet { bus: BusIndex(0), data: 7 }));
    let [first, second, third] = packets;
    let waves = waves(&[first, second, edges, third]);
    assert_eq!(waves.edges(), [100, 110, 120]);
    let times = |name: &str| {
        let path = vec!["a_bus_1".to_owned(), name.to_owned()];
        let signal = waves.paths[&path];
        let changes = waves.changes.iter().filter(|change| change.signal == signal);
        changes.map(|change| change.time_us).collect::<Vec<_>>()
    };
    assert_eq!(
        (times("frame_end"), times("data"), times("frame")),
        (vec![105, 115, 125], vec![105], vec![105])
    );
}

#[test]
fn data_are_left_aligned_and_missing_bytes_are_unknown() {
    let frame = crate::can::Frame::standard(1, crate::can::Payload::new(&[0xAB, 0xCD]).unwrap());
    let (value, known) = (0xABCD_0000_0000_0000, 0xFFFF_0000_0000_0000);
    assert_eq!(Content::data(&frame), Content::Bits { width: 64, value, known });
    let remote = crate::can::Frame::remote(crate::can::StandardId::ZERO, 8).unwrap();
    assert_eq!(Content::data(&remote), Content::Bits { width: 64, value: 0, known: 0 });
}

#[test]
fn of_a_register_that_is_recorded_only_the_changes_count() {
    let write = |offset, value| ChannelWrite { plc: DeviceIndex(0), offset, width: 1, value };
    let waves = waves(&[
        record(0, 5, write(1, 9)),
        record(1, 6, changed(1, 0, 5)),
        record(2, 7, changed(1, 5, 4)),
        record(3, 8, write(2, 3)),
    ]);
    assert_eq!(
        waves.register(DeviceIndex(0), 1, Width::Byte),
        Past { values: vec![(6, 5), (7, 4)], is_recorded: true }
    );
    assert_eq!(
        waves.register(DeviceIndex(0), 2, Width::Byte),
        Past { values: vec![(8, 3)], is_recorded: false }
    );
    assert_eq!(waves.register(DeviceIndex(1), 1, Width::Byte), Past::default());
}

#[test]
fn a_forced_register_keeps_its_value_until_a_write_after_the_end_of_the_force() {
    let plc = DeviceIndex(0);
    let write = |value| ChannelWrite { plc, offset: 4, width: 2, value };
    let force = |offset, width, value| Force { plc, offset, width, value };
    let records = [
        record(0, 5, force(4, 2, 0x55)),
        record(1, 6, write(0x1234)),
        record(2, 7, Unforce { plc, offset: 4 }),
        record(3, 8, write(0x0102)),
        record(4, 9, force(5, 1, 0x77)),
        record(5, 10, write(0x1234)),
    ];
    let past = |waves: Waves| waves.register(plc, 4, Width::Word).values;
    assert_eq!(past(waves(&records)), [(5, 0x55), (8, 0x0102), (10, 0x7734)]);
    // Without its record a force still holds off the writes.
    let selection = Selection { kinds: vec![ChannelWrite::KIND], ..Selection::default() };
    let names = Names { plcs: vec!["line".into()], ..Names::default() };
    let selected = Waves::of(&records, &selection, names, catalogue());
    assert_eq!(past(selected), [(6, 0x55), (8, 0x0102), (10, 0x7734)]);
}

#[test]
fn a_part_of_a_recorded_register_has_its_changes() {
    let how = ChangeDetails { width: Width::Dword, by: By::Channel, live: RegisterPhase::ALWAYS };
    let change = |from, to| Changed { plc: DeviceIndex(0), offset: 4, how, from, to };
    let waves = waves(&[
        record(0, 5, change(0, 0x0100)),
        record(1, 6, change(0x0100, 0x0101)),
        record(2, 7, change(0x0101, 0x0201)),
    ]);
    let part = waves.register(DeviceIndex(0), 5, Width::Byte);
    assert_eq!(part, Past { values: vec![(5, 1), (7, 2)], is_recorded: true });
    let first = waves.register(DeviceIndex(0), 4, Width::Byte);
    assert_eq!(first, Past { values: vec![(5, 0), (6, 1)], is_recorded: true }, "same place, narrower");
    assert_eq!(waves.register(DeviceIndex(0), 8, Width::Byte), Past::default());
    assert_eq!(change(0x0100, 0x0101).part(DeviceIndex(0), 5, Width::Byte), None);
    assert_eq!(
        change(0, 0x0100).part(DeviceIndex(0), 5, Width::Byte).map(|it| (it.offset, it.from, it.to)),
        Some((5, 0, 1))
    );
}

#[test]
fn an_access_of_another_width_at_the_same_place_is_not_mixed_in() {
    let write = |width, value| ChannelWrite { plc: DeviceIndex(0), offset: 4, width, value };
    let waves =
        waves(&[record(0, 5, write(2, 7)), record(1, 6, write(4, 0x0001_0009)), record(2, 7, write(2, 8))]);
    let values = |width| waves.register(DeviceIndex(0), 4, width).values;
    assert_eq!(values(Width::Word), [(5, 7), (7, 8)]);
    assert_eq!(values(Width::Dword), [(6, 0x0001_0009)]);
}

#[test]
fn words_have_neither_blanks_nor_brackets() {
    assert_eq!(word(" a_STAT[1][2] is\t5\u{1} "), "a_STAT_1_2_is_5_");
}
