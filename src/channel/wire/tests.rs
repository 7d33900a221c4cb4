use super::*;
use crate::can::Frame;
use crate::devices;
use crate::devices::samples::tables::phases;
use crate::devices::{DriveDetails, DriveState, Interval, ParameterState, Slot};
use crate::door::{DoorSpec, DoorState, GuestState};
use crate::fault::{
    Draft, Fault, FaultStatus, MAX_AT_US, MAX_DURATION_US, MAX_FIELDS, MAX_PARTICIPANT, Target,
};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{By, Change, ChangeDetails, Changed, HistoryId, Keep, Names};
use crate::layout::{Compare, DeviceFit, Fit, RegisterPhase, Role, Test};
use crate::memory::header::BoardSetting;
use crate::plant::Forced;
use crate::request::testing::TestHost;
use crate::request::{
    BusScene, BusState, Code, DriveEntry, FilePart, InstanceInfo, RateMismatch, Refused, Reply, Station,
    Waited,
};
use core::num::NonZeroU16;
use proptest::prelude::*;
use std::net::{Ipv4Addr, SocketAddrV4};

fn width() -> impl Strategy<Value = Width> {
    prop_oneof![Just(Width::Byte), Just(Width::Word), Just(Width::Dword)]
}

fn op() -> impl Strategy<Value = Op> {
    let register = || (any::<u16>(), any::<u32>(), width());
    prop_oneof![
        register().prop_map(|(plc, offset, width)| Op::Peek { plc: DeviceIndex(plc), offset, width }),
        (register(), any::<u32>()).prop_map(|((plc, offset, width), value)| Op::Poke {
            plc: DeviceIndex(plc),
            offset,
            width,
            value
        }),
        (register(), any::<u32>(), any::<u32>()).prop_map(|((plc, offset, width), current, new)| {
            Op::CompareExchange { plc: DeviceIndex(plc), offset, width, current, new }
        }),
        any::<(u16, u32, u32)>().prop_map(|(plc, offset, len)| Op::ReadRange {
            plc: DeviceIndex(plc),
            offset,
            len
        }),
        (register(), any::<(u32, u32, u64)>()).prop_map(
            |((plc, offset, width), (mask, value, within_us))| {
                Op::Wait { plc: DeviceIndex(plc), offset, width, mask, value, within_us }
            }
        ),
        (register(), any::<(u32, u32, bool)>(), 0..Compare::ALL.len()).prop_map(
            |((plc, offset, width), (mask, value, is_signed), compare)| {
                let test = Test { mask, compare: Compare::ALL[compare], is_signed, value };
                Op::Condition { plc: DeviceIndex(plc), offset, width, test }
            }
        ),
        any::<(bool, u64)>().prop_map(|(any, within_us)| Op::WaitFor { any, within_us }),
        any::<u64>().prop_map(|us| Op::Advance { us }),
        any::<(u16, u8)>()
            .prop_map(|(plc, node)| Op::AdvanceToSync { plc: DeviceIndex(plc), node: PortNumber(node) }),
        any::<u64>().prop_map(|within_us| Op::AdvanceToEvent { within_us }),
        any::<u32>().prop_map(|permille| Op::SetSpeed { permille }),
        any::<bool>().prop_map(|detached| Op::BackToStart { detached }),
        Just(Op::Time),
        any::<(u64, u32)>().prop_map(|(from, max)| Op::Journal { from, max }),
        (register(), any::<u32>()).prop_map(|((plc, offset, width), value)| Op::Force {
            plc: DeviceIndex(plc),
            offset,
            width,
            value
        }),
        register().prop_map(|(plc, offset, width)| Op::Unforce { plc: DeviceIndex(plc), offset, width }),
        Just(Op::Forces),
        fault().prop_map(|fault| Op::FaultAdd { fault }),
        Just(Op::FaultList),
        any::<u16>().prop_map(|id| Op::FaultClear { id: NonZeroU16::new(id) }),
        any::<u16>().prop_map(|id| Op::FaultHasActed { id }),
        any::<u16>().prop_map(|plc| Op::Board { plc: DeviceIndex(plc) }),
        (any::<u16>(), 1..=7u32, 0..40u32).prop_filter_map("a setting", |(plc, which, value)| {
            Some(Op::SetBoard { plc: DeviceIndex(plc), setting: BoardSetting::from_numbers(which, value)? })
        }),
        (any::<(u16, u32, u32)>(), any::<bool>()).prop_map(|((plc, offset, len), looks_on)| {
            let keep = if looks_on { Keep::ForOnlookers } else { Keep::InJournal };
            Op::Follow { plc: DeviceIndex(plc), offset, len, keep }
        }),
        any::<(u16, u32)>().prop_map(|(plc, offset)| Op::IsRecorded { plc: DeviceIndex(plc), offset }),
        any::<(u64, u32)>().prop_map(|(from, max)| Op::Changes { from, max }),
        Just(Op::Buses),
        Just(Op::Scene),
        Just(Op::Drives),
        any::<u16>().prop_map(|drive| Op::Drive { drive }),
        any::<(u16, u16, i64)>().prop_map(|(drive, number, value)| Op::SetParameter { drive, number, value }),
        (any::<u16>(), door()).prop_map(|(bus, door)| Op::DoorOpen { bus: BusIndex::of_number(bus), door }),
        (any::<u16>(), proptest::option::of(door()))
            .prop_map(|(bus, door)| Op::DoorClose { bus: BusIndex::of_number(bus), door }),
        (any::<u16>(), proptest::option::of(frame()))
            .prop_map(|(bus, frame)| Op::BusSend { bus: BusIndex::of_number(bus), frame }),
        (any::<u16>(), any::<bool>(), proptest::collection::vec(any::<u8>(), 0..=16)).prop_map(
            |(bus, is_last, part)| {
                let part = FilePart::new(&part).unwrap();
                Op::TelegramSend { bus: BusIndex::of_number(bus), is_last, part }
            }
        ),
        Just(Op::Findings),
        Just(Op::ClearFindings),
        Just(Op::Save),
        any::<u32>().prop_map(|number| Op::Forget { number }),
        any::<(u32, u32)>().prop_map(|(number, from)| Op::ReadSaved { number, from }),
        (any::<u32>(), proptest::collection::vec(any::<u8>(), 0..=16))
            .prop_map(|(at, part)| Op::BringSaved { at, part: FilePart::new(&part).unwrap() }),
        any::<bool>().prop_map(|detached| Op::Restore { detached }),
        any::<(u32, bool)>().prop_map(|(number, detached)| Op::BackTo { number, detached }),
        any::<(u64, bool)>().prop_map(|(us, detached)| Op::Back { us, detached }),
        any::<(bool, bool)>().prop_map(|(any, detached)| Op::BackUntil { any, detached }),
        Just(Op::Info),
        Just(Op::Stop),
    ]
}

fn door() -> impl Strategy<Value = DoorSpec> {
    (1..=3_u16, any::<(u32, u16)>(), any::<Option<u32>>()).prop_map(|(number, (ip, port), pty)| {
        DoorSpec::of_number(number, SocketAddrV4::new(Ipv4Addr::from_bits(ip), port), pty).unwrap()
    })
}

fn frame() -> impl Strategy<Value = Frame> {
    (any::<u32>(), 0..=8_u8, any::<u64>())
        .prop_filter_map("a frame", |(id, length, data)| Frame::of_numbers(id, length, data))
}

fn bus_scene() -> impl Strategy<Value = BusScene> {
    let slot = (".*", any::<u32>()).prop_map(|(name, start_us)| Slot { name, start_us });
    let interval = (any::<u32>(), proptest::collection::vec(slot, 0..3));
    let interval = interval.prop_map(|(us, slots)| Interval { us, slots });
    let ports = proptest::collection::vec(".*", 0..3);
    let bus = (".*", ".*", any::<u32>(), proptest::option::of(interval), ports);
    bus.prop_map(|(name, kind, bit_s, interval, ports)| BusScene { name, kind, bit_s, interval, ports })
}

fn buses() -> impl Strategy<Value = Vec<BusState>> {
    let guest = (any::<(u8, bool, Option<u32>, bool, u64, u64)>(), door()).prop_map(
        |((guest, open, bit_s, seat, dropped, refused), door)| GuestState {
            guest,
            door,
            open,
            bit_s,
            seat,
            dropped,
            refused,
        },
    );
    let door = (door(), proptest::collection::vec(guest, 0..3), any::<u64>())
        .prop_map(|(door, guests, refused)| DoorState { door, guests, refused });
    let station = (".*", ".*", any::<(Option<u8>, u16, u16)>()).prop_map(
        |(name, state, (address, transmit_errors, receive_errors))| Station {
            name,
            address,
            state,
            transmit_errors,
            receive_errors,
        },
    );
    let load = any::<Option<u16>>();
    let stranger = (".*", any::<u32>()).prop_map(|(name, bit_s)| RateMismatch { name, bit_s });
    let lists = (
        proptest::collection::vec(door, 0..3),
        proptest::collection::vec(station, 0..3),
        proptest::collection::vec(stranger, 0..3),
    );
    let ports = proptest::collection::vec(".*", 0..3);
    let bus = (".*", ".*", any::<u32>(), load, ports, lists);
    let bus = bus.prop_map(|(name, kind, bit_s, load_permille, ports, (doors, stations, strangers))| {
        BusState { name, kind, bit_s, load_permille, ports, doors, stations, strangers }
    });
    proptest::collection::vec(bus, 0..3)
}

fn drive_state() -> impl Strategy<Value = DriveState> {
    let connection = any::<(Option<u8>, Option<u16>, u64, bool)>();
    (".*", connection, any::<(u16, bool, i32, i32, u32)>()).prop_map(
        |(state, (number, kbit_s, lost_references, is_stopped), it)| DriveState {
            number,
            kbit_s,
            state,
            status_word: it.0,
            is_synchronized: it.1,
            speed_reference: it.2,
            speed_actual: it.3,
            fault: it.4,
            lost_references,
            is_stopped,
        },
    )
}

fn drive_entry() -> impl Strategy<Value = DriveEntry> {
    (".*", any::<Option<String>>(), drive_state()).prop_map(|(name, bus, state)| DriveEntry {
        name,
        bus,
        state,
    })
}

fn parameter() -> impl Strategy<Value = ParameterState> {
    (".*", ".*", any::<(u16, u8, i64, i64, i64, bool)>()).prop_map(|(name, unit, it)| ParameterState {
        number: it.0,
        name,
        unit,
        bytes: it.1,
        value: it.2,
        min: it.3,
        max: it.4,
        read_only: it.5,
    })
}

fn error() -> impl Strategy<Value = Refused> {
    let waited = any::<(u64, u32)>().prop_map(|(time_us, value)| Waited { time_us, value });
    (any::<u16>().prop_map(Code), ".*", waited).prop_map(|(code, text, waited)| Refused {
        code,
        text,
        waited: (code == Code::NOT_IN_TIME).then_some(waited),
    })
}

fn forced() -> impl Strategy<Value = Forced> {
    (any::<u16>(), any::<u32>(), width(), any::<u32>()).prop_map(|(plc, offset, width, value)| Forced {
        plc: DeviceIndex(plc),
        offset,
        width,
        value,
    })
}

/// Strategy for any fault that its kind allows.
fn fault() -> impl Strategy<Value = Fault> {
    let kind = proptest::sample::select(devices::fault_kinds());
    let end = (any::<bool>(), 1..=MAX_DURATION_US);
    (kind, any::<[(bool, u64); MAX_FIELDS]>(), any::<u16>(), 0..=MAX_PARTICIPANT, 0..=MAX_AT_US, end)
        .prop_filter_map("values that agree", |(kind, values, index, number, at_us, (by_hits, end))| {
            let mut draft = Draft::new(kind, Target::of_numbers(kind.place(), index, number));
            for (value, (field, (is_given, any))) in
                draft.values.iter_mut().zip(kind.fields().iter().zip(values))
            {
                let (least, most) = field.range();
                *value = is_given.then(|| least + any % (most - least + 1));
            }
            draft.at_us = at_us;
            *(if by_hits { &mut draft.count } else { &mut draft.duration_us }) = Some(end.into());
            draft.check().ok()
        })
}

fn faults() -> impl Strategy<Value = Vec<FaultStatus>> {
    let status = (any::<(u16, bool, u32)>(), fault()).prop_map(|((id, acting, hits), fault)| FaultStatus {
        id,
        fault,
        acting,
        hits,
    });
    proptest::collection::vec(status, 0..5)
}

fn information() -> impl Strategy<Value = InstanceInfo> {
    let names = || proptest::collection::vec(".*", 0..4);
    let fit =
        proptest::sample::select(vec![Fit::Unknown, Fit::Empty, Fit::As(Role::Master), Fit::As(Role::Slave)]);
    let device = (proptest::sample::select(devices::all()), fit)
        .prop_map(|(known, fit)| DeviceFit::unknown(known.layout).with(PortNumber(1), fit));
    let devices = proptest::collection::vec(device, 0..4);
    let names = (names(), names(), devices).prop_map(|(plcs, buses, devices)| Names { plcs, buses, devices });
    let numbers = any::<(u32, u64, u32, u32, u32)>();
    (any::<bool>(), numbers, (".*", ".*"), names).prop_map(|(is_stepped, numbers, (name, version), names)| {
        let (speed, time_us, generation, pid, abi_version) = numbers;
        let waits_for = is_stepped.then(|| version.clone());
        InstanceInfo {
            name,
            is_stepped,
            speed,
            time_us,
            generation,
            pid,
            abi_version,
            version,
            waits_for,
            names,
        }
    })
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let by = proptest::sample::select(vec![By::Firmware, By::Program, By::Channel, By::Force]);
    let live = proptest::sample::select(vec![RegisterPhase::ALWAYS, phases::INIT, phases::CYCLIC]);
    let how = (width(), by, live).prop_map(|(width, by, live)| ChangeDetails { width, by, live });
    let change =
        (any::<(u64, u64)>(), any::<(u16, u32, u32, u32)>(), how).prop_map(|(numbers, words, how)| {
            let ((seq, time_us), (plc, offset, from, to)) = (numbers, words);
            Change { seq, time_us, what: Changed { plc: DeviceIndex(plc), offset, how, from, to } }
        });
    proptest::collection::vec(change, 0..5)
}

fn reply() -> impl Strategy<Value = Reply> {
    prop_oneof![
        any::<u32>().prop_map(Reply::Value),
        Just(Reply::Written),
        any::<(bool, u32)>().prop_map(|(ok, found)| Reply::Exchanged { ok, found }),
        proptest::collection::vec(any::<u8>(), 0..100).prop_map(Reply::Bytes),
        any::<(u64, u32)>().prop_map(|(time_us, value)| Reply::Waited(Waited { time_us, value })),
        any::<u64>().prop_map(Reply::Time),
        any::<u16>().prop_map(|id| Reply::FaultAdded { id }),
        faults().prop_map(Reply::Faults),
        any::<u16>().prop_map(|count| Reply::FaultsCleared { count }),
        any::<[u32; 10]>().prop_map(|numbers| Reply::Board(zerocopy::transmute!(numbers))),
        Just(Reply::Cleared),
        buses().prop_map(Reply::Buses),
        proptest::collection::vec(bus_scene(), 0..3).prop_map(Reply::Scene),
        proptest::collection::vec(drive_entry(), 0..3).prop_map(Reply::Drives),
        (drive_state(), proptest::collection::vec(parameter(), 0..3), any::<Vec<(u8, u16)>>()).prop_map(
            |(state, parameters, card)| Reply::Drive(Box::new(DriveDetails { state, parameters, card }))
        ),
        door().prop_map(Reply::DoorOpened),
        any::<u16>().prop_map(|count| Reply::DoorsClosed { count }),
        information().prop_map(|information| Reply::Info(Box::new(information))),
        proptest::collection::vec(forced(), 0..5).prop_map(Reply::Forces),
        (changes(), any::<u64>()).prop_map(|(changes, end)| {
            Reply::Changes { changes, end, turn: HistoryId { number: 3, begin: 7 } }
        }),
        Just(Reply::Stopping),
        error().prop_map(Reply::Error),
    ]
}

/// Longest time that an operation of a fuzzer may take, in microseconds. Longer operations would only wait.
const FUZZED_US: u64 = 20_000;

/// Returns an operation with the same encoding, or none.
fn operation(wire: WireOp) -> Option<Op> {
    let op = Op::try_from(wire).ok()?;
    assert_eq!(WireOp::from(&op), wire);
    Some(op)
}

/// Requests of arbitrary operations. Valid operations are executed on two PLCs, and one of the PLCs has a bus.
#[test]
fn fuzz_channel_requests() {
    crate::fuzz("channel_requests", |bytes| {
        let mut host = TestHost::new(true);
        let wires = bytes.as_chunks::<32>().0.iter().map(|bytes| WireOp::read_from_bytes(bytes).unwrap());
        let ops: Vec<_> = wires
            .take(64)
            .map(|wire| operation(WireOp { time_us: wire.time_us % FUZZED_US, ..wire }))
            .collect();
        for request in ops.split(Option::is_none) {
            let ops: Vec<_> = request.iter().flatten().cloned().collect();
            let mut buffer = ReplyBuffer::default();
            // The server handles replies that are too long.
            let _fits = host.request(&ops).iter().all(|reply| buffer.push(reply).is_ok());
        }
    });
}

#[test]
fn fuzz_channel_replies() {
    crate::fuzz("channel_replies", |bytes| {
        let (bytes, _) = bytes.as_chunks::<16>();
        let blocks: Vec<Block> = bytes.iter().map(|bytes| Block::read_from_bytes(bytes).unwrap()).collect();
        let mut replies = Vec::new();
        if decode(&blocks, &mut replies).is_ok() {
            let mut buffer = ReplyBuffer::default();
            let _fits = replies.iter().all(|reply| buffer.push(reply).is_ok());
        }
    });
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn operations_come_back_as_they_were(op in op()) {
        prop_assert_eq!(Op::try_from(WireOp::from(&op)), Ok(op));
    }

    #[test]
    fn operations_come_back_from_json(op in op()) {
        let text = serde_json::to_string(&op).unwrap();
        prop_assert_eq!(serde_json::from_str::<Op>(&text).unwrap(), op, "{}", text);
    }

    #[test]
    fn any_bytes_decode_to_an_operation_that_encodes_the_same_or_to_an_error(bytes in any::<[u8; 32]>()) {
        let _ = operation(WireOp::read_from_bytes(&bytes).unwrap());
    }

    #[test]
    fn nearly_valid_operations_do_not_panic(op in op(), at in 0_usize..32, byte in any::<u8>()) {
        let mut wire = WireOp::from(&op);
        wire.as_mut_bytes()[at] = byte;
        let _ = operation(wire);
    }

    #[test]
    fn replies_come_back_as_they_were(sent in proptest::collection::vec(reply(), 0..8)) {
        let mut buffer = ReplyBuffer::default();
        for reply in &sent {
            buffer.push(reply).unwrap();
        }
        let mut received = Vec::new();
        decode(buffer.blocks(), &mut received).unwrap();
        prop_assert_eq!(received, sent);
    }

    #[test]
    fn any_blocks_decode_without_panic(bytes in proptest::collection::vec(any::<[u8; 16]>(), 0..40)) {
        let blocks: Vec<Block> = bytes.iter().map(|b| Block::read_from_bytes(b).unwrap()).collect();
        let _ = decode(&blocks, &mut Vec::new());
    }

    /// A reply that lacks its last block, or any number of bytes of its data, is refused.
    #[test]
    fn replies_cut_short_are_refused(sent in reply(), cut in any::<prop::sample::Index>()) {
        let mut buffer = ReplyBuffer::default();
        buffer.push(&sent).unwrap();
        let mut blocks = buffer.blocks().to_vec();
        if blocks.len() > 1 {
            blocks.truncate(1 + cut.index(blocks.len() - 1));
            let error = decode(&blocks, &mut Vec::new()).unwrap_err();
            prop_assert_eq!(error, DecodeError { index: 0, block: 0 });
        }
    }

    #[test]
    fn nearly_valid_replies_do_not_panic(sent in reply(), at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut buffer = ReplyBuffer::default();
        buffer.push(&sent).unwrap();
        let mut blocks = buffer.blocks().to_vec();
        let at = at.index(blocks.len() * 16);
        blocks.as_mut_slice().as_mut_bytes()[at] = byte;
        let _ = decode(&blocks, &mut Vec::new());
    }
}

#[test]
fn fields_without_meaning_are_named() {
    let peek = WireOp::from(&Op::Peek { plc: DeviceIndex(0), offset: 200_000, width: Width::Word });
    let bad = |wire: WireOp| Op::try_from(wire).unwrap_err().to_string();
    assert_eq!(bad(WireOp { kind: 99, ..peek }), "the kind is 16#63");
    assert_eq!(bad(WireOp { width: 3, ..peek }), "the width is 16#3");
    assert_eq!(bad(WireOp { reserved: 1, ..peek }), "an unused field is 16#1");
    assert_eq!(bad(WireOp { time_us: 1, ..peek }), "an unused field is 16#1");
    let sync = WireOp::from(&Op::AdvanceToSync { plc: DeviceIndex(0), node: PortNumber(1) });
    assert_eq!(bad(WireOp { node: 256, ..sync }), "the node is 16#100");
}

#[test]
fn a_reply_too_long_still_has_room_to_say_so() {
    let mut buffer = ReplyBuffer::default();
    let full = Reply::Bytes(vec![1; MAX_RANGE as usize]);
    for _ in 0..4 {
        buffer.push(&full).unwrap();
    }
    let before = buffer.blocks().len();
    let refused = buffer.push(&full).unwrap_err();
    assert_eq!((refused.code, buffer.blocks().len()), (Code::REPLY_TOO_LONG, before));
    buffer.error(&Refused { text: "x".repeat(10_000), ..refused });
    assert!(buffer.blocks().len() <= MAX_REPLY_BLOCKS);
    let mut replies = Vec::new();
    decode(buffer.blocks(), &mut replies).unwrap();
    assert_eq!(replies.len(), 5);
    assert!(matches!(&replies[4], Reply::Error(refused) if refused.text.len() == 1020));
}

#[test]
fn the_largest_request_of_small_operations_fits_its_reply() {
    let mut buffer = ReplyBuffer::default();
    for _ in 0..MAX_OPS {
        buffer.push(&Reply::Waited(Waited { time_us: u64::MAX, value: u32::MAX })).unwrap();
    }
}
