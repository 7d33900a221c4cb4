//! Events to test with.

use super::{BoardEvent, Command, Event, FaultNews, Kind, Missed, Origin};
use crate::check::{Finding, Rule};
use crate::devices::cansync::bus::Frame;
use crate::fault;
use crate::layout::Live;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

/// Any event of any kind.
pub(crate) fn event() -> impl Strategy<Value = Event> {
    let origin = || any::<(u16, u8)>().prop_map(|(plc, node)| Origin { plc, node });
    let missed =
        prop_oneof![any::<u8>().prop_map(Missed::ReferenceValue), any::<u8>().prop_map(Missed::ActualValue)];
    let why = prop_oneof![Just(Command::Unknown), Just(Command::NotNow), Just(Command::LeftBehind)];
    let news = prop_oneof![
        Just(FaultNews::Added),
        any::<i32>().prop_map(FaultNews::Hit),
        Just(FaultNews::Over),
        Just(FaultNews::Cleared),
    ];
    let fault = (proptest::sample::select(&fault::Kind::ALL[..]), any::<(u16, u16, u8)>(), news);
    let frame = (0..0x800_u16, proptest::collection::vec(any::<u8>(), 0..=8));
    let finding = (
        proptest::sample::select(Rule::ALL),
        proptest::sample::select(vec![Live::Always, Live::Init, Live::Cyclic]),
        any::<(u16, u32, u32, u32)>(),
    );
    prop_oneof![
        finding.prop_map(|(rule, live, (plc, offset, value, late_us))| {
            Event::Finding(Finding { rule, plc, offset, live, value, late_us })
        }),
        any::<u16>().prop_map(|bus| Event::SyncEdge { bus }),
        (any::<u16>(), frame)
            .prop_map(|(bus, (id, data))| Event::Frame { bus, frame: Frame::new(id, &data).unwrap() }),
        (origin(), any::<(u16, u16)>()).prop_map(|(origin, (from, to))| Event::State { origin, from, to }),
        (origin(), any::<(u32, u16, u16)>()).prop_map(|(origin, (offset, request, answer))| {
            Event::Handshake { origin, offset, request, answer }
        }),
        (origin(), any::<(u32, u32, u32)>()).prop_map(|(origin, (offset, from, to))| Event::Register {
            origin,
            offset,
            from,
            to
        }),
        (origin(), missed).prop_map(|(origin, what)| Event::Missed { origin, what }),
        (origin(), any::<u16>(), why).prop_map(|(origin, value, why)| Event::CommandIgnored {
            origin,
            value,
            why
        }),
        (origin(), any::<u8>()).prop_map(|(origin, reason)| Event::InitRefused { origin, reason }),
        (origin(), any::<(u8, u8)>()).prop_map(|(origin, (slave, status))| Event::SlaveStatus {
            origin,
            slave,
            status
        }),
        (origin(), any::<(u16, u16)>()).prop_map(|(origin, (node_kbit_s, bus_kbit_s))| {
            Event::BaudRateMismatch { origin, node_kbit_s, bus_kbit_s }
        }),
        any::<(u16, u32, u8, u32)>().prop_map(|(plc, offset, width, value)| Event::ChannelWrite {
            plc,
            offset,
            width,
            value
        }),
        (any::<u16>(), 1..=12u8, proptest::array::uniform4(0..5u8), any::<u16>()).prop_filter_map(
            "numbers that mean something",
            |(plc, what, bytes, factor)| {
                let numbers = u64::from(u32::from_le_bytes(bytes)) | u64::from(factor) << 32;
                Some(Event::Board { plc, what: BoardEvent::from_words(what, numbers)? })
            }
        ),
        any::<(u16, u32, u8, u32)>().prop_map(|(plc, offset, width, value)| Event::Force {
            plc,
            offset,
            width,
            value
        }),
        any::<(u16, u32)>().prop_map(|(plc, offset)| Event::Unforce { plc, offset }),
        fault.prop_map(|(kind, (id, index, number), news)| {
            Event::Fault { id, kind, target: kind.target(index, number), news }
        }),
    ]
}

#[test]
fn every_kind_is_among_the_samples() {
    let (mut runner, events) = (TestRunner::deterministic(), event());
    let mut drawn = || events.new_tree(&mut runner).unwrap().current().kind();
    let mut missing = Kind::ALL.to_vec();
    for _ in 0..10_000 {
        let kind = drawn();
        missing.retain(|other| *other != kind);
    }
    assert_eq!(missing, []);
}

#[test]
fn kinds_are_found_by_number_and_name() {
    for kind in Kind::ALL {
        assert_eq!(
            (Kind::from_number(*kind as u8), Kind::from_name(kind.name())),
            (Some(*kind), Some(*kind))
        );
    }
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn words_give_the_event_back(event in event()) {
        prop_assert_eq!(Event::from_words(event.words()), Some(event));
    }

    #[test]
    fn words_differ_if_the_events_do(one in event(), other in event()) {
        prop_assert_eq!(one == other, one.words() == other.words());
    }
}
