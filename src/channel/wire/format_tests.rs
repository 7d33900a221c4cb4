//! The bytes of each operation and each reply, as `tests/formats/channel-<version>` keeps them.

use super::*;
use crate::can::Frame;
use crate::devices::samples::tables::phases;
use crate::devices::{self, DriveDetails, DriveState, Interval, ParameterState, Slot};
use crate::door::{DoorSpec, DoorState, GuestState};
use crate::fault::{Draft, Fault, FaultStatus, MAX_FIELDS, Target};
use crate::format_samples::assert_only_added;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{
    By, Change, ChangeDetails, Changed, Entry, Finding, HistoryId, Keep, Names, Origin, PortPhase, Record,
    Unforce,
};
use crate::layout::{Compare, RegisterPhase, Test};
use crate::memory::header::BoardSetting;
use crate::plant::Forced;
use crate::request::{
    BusScene, BusState, Code, DriveEntry, FilePart, InstanceInfo, RateMismatch, Refused, Reply, Station,
    Waited,
};
use core::num::NonZeroU16;
use std::fmt::Write;

fn tcp() -> DoorSpec {
    "slcan-tcp:127.0.0.1:29536".parse().unwrap()
}

/// Returns a fault of each kind, under the name of the kind.
fn faults() -> Vec<(&'static str, Fault)> {
    let fault = |kind: &'static crate::fault::FaultKind, is_given: [bool; MAX_FIELDS]| {
        let mut draft = Draft::new(kind, Target::of_numbers(kind.place(), 1, 2));
        for ((value, field), is_given) in draft.values.iter_mut().zip(kind.fields()).zip(is_given) {
            *value = is_given.then(|| field.range().0);
        }
        (draft.at_us, draft.duration_us) = (7_000, Some(4_000));
        draft.check().ok()
    };
    let combinations =
        || (0..1_u32 << MAX_FIELDS).rev().map(|bits| core::array::from_fn(|n| bits >> n & 1 != 0));
    let of = |kind: &&'static crate::fault::FaultKind| {
        (
            kind.name(),
            combinations().find_map(|given| fault(kind, given)).unwrap_or_else(|| panic!("{}", kind.name())),
        )
    };
    devices::fault_kinds().iter().map(of).collect()
}

pub(super) fn ops() -> Vec<(String, Op)> {
    let (plc, offset, width) = (3, 200_002, Width::Word);
    let test = |compare, is_signed| Test { mask: 0xFF, compare, is_signed, value: 5 };
    let frame = Frame::of_numbers(0x123, 3, 0x33_2211).unwrap();
    let part = FilePart::new(&[1, 2, 3]).unwrap();
    let mut ops = vec![
        Op::Peek { plc: DeviceIndex(plc), offset, width },
        Op::Poke { plc: DeviceIndex(plc), offset, width, value: 5 },
        Op::CompareExchange { plc: DeviceIndex(plc), offset, width, current: 5, new: 4 },
        Op::ReadRange { plc: DeviceIndex(plc), offset, len: 99 },
        Op::Wait { plc: DeviceIndex(plc), offset, width, mask: 0xFF, value: 5, within_us: 9_000 },
        Op::WaitFor { any: true, within_us: 9_000 },
        Op::Advance { us: 2_000 },
        Op::AdvanceToSync { plc: DeviceIndex(plc), node: PortNumber(2) },
        Op::AdvanceToEvent { within_us: 9_000 },
        Op::SetSpeed { permille: 2_500 },
        Op::BackToStart { detached: true },
        Op::Time,
        Op::Journal { from: 77, max: 10 },
        Op::Follow { plc: DeviceIndex(plc), offset, len: 4, keep: Keep::InJournal },
        Op::Follow { plc: DeviceIndex(plc), offset, len: 4, keep: Keep::ForOnlookers },
        Op::IsRecorded { plc: DeviceIndex(plc), offset },
        Op::Changes { from: 77, max: 10 },
        Op::Force { plc: DeviceIndex(plc), offset, width, value: 5 },
        Op::Unforce { plc: DeviceIndex(plc), offset, width },
        Op::Forces,
        Op::FaultList,
        Op::FaultClear { id: None },
        Op::FaultClear { id: NonZeroU16::new(12) },
        Op::FaultHasActed { id: 12 },
        Op::Board { plc: DeviceIndex(plc) },
        Op::SetBoard { plc: DeviceIndex(plc), setting: BoardSetting::Front { word: 1, value: 6 } },
        Op::Findings,
        Op::ClearFindings,
        Op::Buses,
        Op::Scene,
        Op::Drives,
        Op::Drive { drive: 1 },
        Op::SetParameter { drive: 1, number: 47, value: -3 },
        Op::DoorOpen { bus: BusIndex(1), door: tcp() },
        Op::DoorOpen { bus: BusIndex(1), door: "slcan-pty:/dev/pts/4".parse().unwrap() },
        Op::DoorClose { bus: BusIndex(1), door: None },
        Op::BusSend { bus: BusIndex(1), frame: Some(frame) },
        Op::BusSend { bus: BusIndex(1), frame: None },
        Op::TelegramSend { bus: BusIndex(1), is_last: true, part: FilePart::new(&[0xE5]).unwrap() },
        Op::Save,
        Op::Forget { number: 2 },
        Op::ReadSaved { number: 2, from: 65_536 },
        Op::BringSaved { at: 32, part },
        Op::Restore { detached: true },
        Op::BackTo { number: 2, detached: true },
        Op::Back { us: 5_000, detached: true },
        Op::BackUntil { any: true, detached: true },
        Op::Info,
        Op::Stop,
    ];
    ops.extend((1..=9).filter_map(|which| {
        Some(Op::SetBoard {
            plc: DeviceIndex(plc),
            setting: BoardSetting::from_numbers(which, u32::from(!(6..=7).contains(&which)))?,
        })
    }));
    for (compare, is_signed) in Compare::ALL.iter().flat_map(|compare| [(*compare, false), (*compare, true)])
    {
        ops.push(Op::Condition { plc: DeviceIndex(plc), offset, width, test: test(compare, is_signed) });
    }
    // The samples use the number of a kind and its index instead of its name, because names in the program
    // may change.
    let mut places = std::collections::BTreeMap::<u16, usize>::new();
    let mut named = |op: Op| {
        let kind = WireOp::from(&op).kind;
        let place = places.entry(kind).or_default();
        *place += 1;
        (format!("operation {kind}.{place}"), op)
    };
    let mut named: Vec<_> = ops.into_iter().map(&mut named).collect();
    named.extend(faults().into_iter().map(|(name, fault)| (format!("fault {name}"), Op::FaultAdd { fault })));
    named
}

fn buses() -> Vec<BusState> {
    let guest = GuestState {
        guest: 1,
        door: tcp(),
        open: true,
        bit_s: Some(500_000),
        seat: true,
        dropped: 2,
        refused: 3,
    };
    let station = Station {
        name: "drive1".into(),
        address: Some(3),
        state: "active".into(),
        transmit_errors: 4,
        receive_errors: 5,
    };
    vec![BusState {
        name: "can1".into(),
        kind: "CAN".into(),
        bit_s: 500_000,
        load_permille: Some(120),
        ports: vec!["line 1".into()],
        doors: vec![DoorState { door: tcp(), guests: vec![guest], refused: 6 }],
        stations: vec![station],
        strangers: vec![RateMismatch { name: "x".into(), bit_s: 250_000 }],
    }]
}

fn drive() -> DriveState {
    DriveState {
        number: Some(3),
        kbit_s: Some(500),
        state: "ready".into(),
        status_word: 0x37,
        is_synchronized: true,
        speed_reference: -5,
        speed_actual: 6,
        fault: 7,
        lost_references: 8,
        is_stopped: true,
    }
}

pub(super) fn replies() -> Vec<(&'static str, Reply)> {
    let turn = HistoryId { number: 2, begin: 5 };
    let event = Unforce { plc: DeviceIndex(1), offset: 200_002 }.into();
    let record = Record {
        seq: 9,
        time_us: 1_000,
        event,
        count: 2,
        period_us: 3,
        latency_us: Some(4),
        octets: Some([1, 2].into()),
        phases: Some(
            [PortPhase { port: Origin { plc: DeviceIndex(1), node: PortNumber(2) }, live: phases::CYCLIC }]
                .into(),
        ),
    };
    let how = ChangeDetails { width: Width::Word, by: By::Channel, live: phases::CYCLIC };
    let changed = Changed { plc: DeviceIndex(1), offset: 200_002, how, from: 3, to: 4 };
    let finding = Finding {
        rule: devices::catalogue().rules[0],
        plc: DeviceIndex(1),
        offset: 200_002,
        live: RegisterPhase::ALWAYS,
        value: 6,
        late_us: 0,
    };
    let entry = Entry {
        last: finding,
        is_single: true,
        count: 2,
        first_us: 10,
        last_us: 20,
        latest_us: 0,
        note: None,
    };
    let parameter = ParameterState {
        number: 47,
        name: "Speed".into(),
        unit: "rpm".into(),
        bytes: 2,
        value: -3,
        min: -9,
        max: 9,
        read_only: false,
    };
    // The names contain no devices, because devices are identified by the hash of their registers.
    let names = Names { plcs: vec!["line".into()], buses: vec!["can1".into()], devices: Vec::new() };
    let info = InstanceInfo {
        name: "default".into(),
        is_stepped: true,
        speed: 1_000,
        time_us: 9,
        generation: 2,
        pid: 42,
        abi_version: 3,
        version: "0.1.0".into(),
        waits_for: Some("a task".into()),
        names,
    };
    let slot = Slot { name: "SYNC".into(), start_us: 10 };
    let scene = BusScene {
        name: "can1".into(),
        kind: "CAN".into(),
        bit_s: 500_000,
        interval: Some(Interval { us: 2_000, slots: vec![slot] }),
        ports: vec!["line 1".into()],
    };
    let waited = Waited { time_us: 9_000, value: 5 };
    let error = |code, waited| Reply::Error(Refused { code, text: "no".into(), waited });
    let (_, fault) = faults().remove(0);
    vec![
        ("Value", Reply::Value(5)),
        ("Written", Reply::Written),
        ("Exchanged", Reply::Exchanged { ok: true, found: 5 }),
        ("Bytes", Reply::Bytes(vec![1, 2, 3])),
        ("Waited", Reply::Waited(waited)),
        ("Time", Reply::Time(9_000)),
        ("Journal", Reply::Journal { records: vec![record], end: 10, turn }),
        (
            "Changes",
            Reply::Changes { changes: vec![Change { seq: 9, time_us: 1_000, what: changed }], end: 10, turn },
        ),
        (
            "Forces",
            Reply::Forces(vec![Forced {
                plc: DeviceIndex(1),
                offset: 200_002,
                width: Width::Word,
                value: 5,
            }]),
        ),
        ("FaultAdded", Reply::FaultAdded { id: 12 }),
        ("Faults", Reply::Faults(vec![FaultStatus { id: 12, fault, acting: true, hits: 3 }])),
        ("FaultsCleared", Reply::FaultsCleared { count: 2 }),
        ("Board", Reply::Board(zerocopy::transmute!([1_u32, 2, 3, 4, 5, 6, 7, 8, 9, 10]))),
        ("Findings", Reply::Findings(vec![entry])),
        ("Cleared", Reply::Cleared),
        ("Buses", Reply::Buses(buses())),
        (
            "Drives",
            Reply::Drives(vec![DriveEntry {
                name: "drive1".into(),
                bus: Some("can1".into()),
                state: drive(),
            }]),
        ),
        (
            "Drive",
            Reply::Drive(Box::new(DriveDetails {
                state: drive(),
                parameters: vec![parameter],
                card: vec![(1, 2)],
            })),
        ),
        ("Scene", Reply::Scene(vec![scene])),
        ("DoorOpened", Reply::DoorOpened(tcp())),
        ("DoorsClosed", Reply::DoorsClosed { count: 2 }),
        ("Info", Reply::Info(Box::new(info))),
        ("Stopping", Reply::Stopping),
        ("Error", error(Code::UNMAPPED, None)),
        ("Error in time", error(Code::NOT_IN_TIME, Some(waited))),
    ]
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |text, byte| text + &format!("{byte:02X}"))
}

/// If the bytes of any operation or reply change, the names of the types need a new version. A new operation
/// or reply needs no new version: an emulator that does not know an operation refuses it with code 13.
#[test]
fn the_bytes_of_operations_and_replies_change_with_the_version_only() {
    let mut lines = String::new();
    for (name, op) in ops() {
        let wire = WireOp::from(&op);
        assert_eq!(Op::try_from(wire), Ok(op), "{name}");
        let text = serde_json::to_string(&op).unwrap();
        assert_eq!(serde_json::from_str::<Op>(&text).unwrap(), op, "{text}");
        writeln!(lines, "{name}: {}", hex(wire.as_bytes())).unwrap();
    }
    for (name, reply) in replies() {
        let mut buffer = ReplyBuffer::default();
        buffer.push(&reply).unwrap();
        let mut read = Vec::new();
        decode(buffer.blocks(), &mut read).unwrap();
        assert_eq!(read, [reply], "{name}");
        writeln!(lines, "{name}: {}", hex(buffer.blocks().as_bytes())).unwrap();
    }
    for kind in &devices::catalogue().kinds {
        writeln!(lines, "event {}: {}", kind.name(), kind.number()).unwrap();
    }
    for rule in &devices::catalogue().rules {
        writeln!(lines, "rule {}: {}", rule.id(), rule.number()).unwrap();
    }
    assert_only_added(&format!("channel-{WIRE_VERSION}"), "WIRE_VERSION", &lines);
}

/// The names are what iceoryx2 compares.
#[test]
fn the_type_names_carry_the_version() {
    // SAFETY: the two functions return a constant.
    let names = unsafe { [WireOp::type_name(), Block::type_name()] };
    assert_eq!(names, ["WireOp", "Block"].map(|name| format!("commram.channel.{name}.v{WIRE_VERSION}")));
}
