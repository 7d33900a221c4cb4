//! Tests of the kinds of faults of all families: description, checks and documentation.

use super::can_faults::CONTROLLERS;
use crate::devices::{bm4_o_can_06, can_dp2, cs0015, fault_kinds, omega_drive_line_2};
use crate::fault::{
    Draft, Fault, FaultError, FaultKind, FaultSpec, FieldValue, Form, Refusal, Target, TargetKind,
};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::Names;
use crate::layout::DeviceFit;
use proptest::prelude::*;

fn names() -> Names {
    let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let omega = &omega_drive_line_2::registers::DEVICE;
    Names {
        plcs: list(&["line", "saw", "maxx"]),
        buses: list(&["drives", "upper"]),
        devices: [omega, omega, &bm4_o_can_06::registers::DEVICE].map(DeviceFit::unknown).to_vec(),
    }
}

fn resolve(text: &str) -> Result<Fault, FaultError> {
    toml::from_str::<FaultSpec>(text).unwrap().resolve(fault_kinds(), &names())
}

/// For each kind, a description with all its fields, and the text of this fault in a list.
const EACH_KIND: [(&str, &str); 39] = [
    (
        "kind = 'lose_frame'\nbus = 'drives'\nslot = 'WRC1'\nid = 0x101\nmask = 0x70F\nat_us = 5\ncount = 3",
        "lose_frame bus=drives slot=WRC1 id=16#101 mask=16#70F at_us=5 count=3",
    ),
    (
        "kind = 'delay_frame'\nbus = 'upper'\nid = 0x582\ndelay_us = 900",
        "delay_frame bus=upper id=16#582 delay_us=900",
    ),
    ("kind = 'duplicate_frame'\nbus = 'upper'\nslot = 'cc'", "duplicate_frame bus=upper slot=CC"),
    ("kind = 'lose_sync'\nbus = 'drives'\nduration_us = 7", "lose_sync bus=drives duration_us=7"),
    ("kind = 'jitter_sync'\nbus = 'drives'\namplitude_us = 20", "jitter_sync bus=drives amplitude_us=20"),
    ("kind = 'slave_off'\nbus = 'drives'\nslave = 31", "slave_off bus=drives slave=31"),
    (
        "kind = 'slave_late'\nbus = 'drives'\nslave = 0\ndelay_us = 1",
        "slave_late bus=drives slave=0 delay_us=1",
    ),
    ("kind = 'slave_busy'\nbus = 'drives'\nslave = 1\ncount = 9", "slave_busy bus=drives slave=1 count=9"),
    (
        "kind = 'slave_error'\nbus = 'drives'\nslave = 1\nerror = 0xFFFB",
        "slave_error bus=drives slave=1 error=16#FFFB",
    ),
    (
        "kind = 'wrong_offset'\nbus = 'drives'\nslave = 1\nslot = 'CC'\noffset = 12",
        "wrong_offset bus=drives slave=1 slot=CC offset=12",
    ),
    ("kind = 'bus_off'\nplc = 'saw'\nnode = 1", "bus_off plc=saw node=1 count=1"),
    ("kind = 'overrun'\nplc = 'line'\nnode = 2\ncount = 4", "overrun plc=line node=2 count=4"),
    (
        "kind = 'drive_fault'\nbus = 'drives'\nslave = 1\nerror = 17",
        "drive_fault bus=drives slave=1 error=16#0011 count=1",
    ),
    ("kind = 'baps_drive_fault'\nplc = 'saw'\nerror = 17", "baps_drive_fault plc=saw error=16#0011 count=1"),
    ("kind = 'baps_silent'\nplc = 'saw'\nduration_us = 4000000", "baps_silent plc=saw duration_us=4000000"),
    (
        "kind = 'baps_slow'\nplc = 'line'\ndelay_us = 3500000\ncount = 2",
        "baps_slow plc=line delay_us=3500000 count=2",
    ),
    (
        "kind = 'error_frame'\nbus = 'upper'\nid = 0x101\nformat = 'extended'\ncount = 16",
        "error_frame bus=upper id=16#101 format=extended count=16",
    ),
    (
        "kind = 'lost_arbitration'\nbus = 'upper'\nid = 0x18FF0000\nmask = 0x1FFF0000",
        "lost_arbitration bus=upper id=16#18FF0000 mask=16#1FFF0000",
    ),
    (
        "kind = 'lose_telegram'\nbus = 'upper'\nstation = 5\nwhat = 'answer'\nsap = 60\ncount = 2",
        "lose_telegram bus=upper station=5 what=answer sap=60 count=2",
    ),
    (
        "kind = 'delay_telegram'\nbus = 'upper'\ndelay_us = 700\nwhat = 'request'",
        "delay_telegram bus=upper what=request delay_us=700",
    ),
    ("kind = 'repeat_telegram'\nbus = 'upper'\nstation = 0", "repeat_telegram bus=upper station=0"),
    ("kind = 'garble_telegram'\nbus = 'upper'\nsap = 61", "garble_telegram bus=upper sap=61"),
    ("kind = 'wrong_frame_count'\nbus = 'upper'\nstation = 2", "wrong_frame_count bus=upper station=2"),
    ("kind = 'silent_station'\nbus = 'upper'\nstation = 126", "silent_station bus=upper station=126"),
    ("kind = 'noise'\nbus = 'upper'\noctets = 255", "noise bus=upper octets=255 count=1"),
    (
        "kind = 'short_circuit'\nplc = 'saw'\noutput = 15\nduration_us = 7",
        "short_circuit plc=saw output=15 duration_us=7",
    ),
    ("kind = 'wire_break'\nplc = 'saw'\noutput = 0", "wire_break plc=saw output=0"),
    (
        "kind = 'supply'\nplc = 'saw'\nwhat = 'drop'\nduration_us = 9",
        "supply plc=saw what=drop duration_us=9",
    ),
    ("kind = 'temperature'\nplc = 'saw'", "temperature plc=saw"),
    ("kind = 'memory'\nplc = 'saw'", "memory plc=saw count=1"),
    ("kind = 'fatal'\nplc = 'saw'\ncount = 2", "fatal plc=saw count=2"),
    ("kind = 'can_init'\nplc = 'saw'", "can_init plc=saw"),
    (
        "kind = 'lose_character'\nbus = 'upper'\noctet = 0x10\nsender = 'port'\ncount = 1",
        "lose_character bus=upper sender=port octet=16#10 count=1",
    ),
    ("kind = 'garble_character'\nbus = 'upper'\noctet = 2", "garble_character bus=upper octet=16#02"),
    (
        "kind = 'delay_character'\nbus = 'upper'\ndelay_us = 700\nsender = 'partner'",
        "delay_character bus=upper sender=partner delay_us=700",
    ),
    (
        "kind = 'silent_participant'\nbus = 'upper'\nsender = 'partner'",
        "silent_participant bus=upper sender=partner",
    ),
    ("kind = 'line_break'\nbus = 'upper'\nlength_us = 20000", "line_break bus=upper length_us=20000 count=1"),
    (
        "kind = 'silent_drive'\nbus = 'upper'\naddress = 3\nduration_us = 3000000",
        "silent_drive bus=upper address=3 duration_us=3000000",
    ),
    ("kind = 'hang'\nplc = 'saw'", "hang plc=saw"),
];

#[test]
fn descriptions_of_every_kind_are_read_and_written_alike() {
    for ((text, written), kind) in EACH_KIND.into_iter().zip(fault_kinds()) {
        let fault = resolve(text).unwrap();
        assert_eq!(fault.kind(), *kind);
        let (index, number) = fault.target().numbers();
        assert_eq!(Target::of_numbers(kind.place(), index, number), fault.target());
        assert_eq!(fault.text(&names()), written);
        let spec = FaultSpec::of(&fault, &names());
        assert_eq!(spec.resolve(fault_kinds(), &names()), Ok(fault), "there and back again");
        assert_eq!(toml::from_str::<FaultSpec>(&toml::to_string(&spec).unwrap()).unwrap(), spec);
        let words: Vec<_> = written.split(' ').skip(1).collect();
        let spec = FaultSpec::from_words(fault_kinds(), kind.name(), &words).unwrap();
        assert_eq!(spec.resolve(fault_kinds(), &names()), Ok(fault), "as words");
    }
    assert_eq!(EACH_KIND.len(), fault_kinds().len());
}

/// Any fault that its kind allows, at any possible target in this installation.
fn any_fault() -> impl Strategy<Value = Fault> {
    let kind = proptest::sample::select(fault_kinds());
    let values = proptest::array::uniform5(proptest::option::of(any::<u64>()));
    let end = (proptest::option::of(1_u64..), proptest::option::of(1_u64..));
    let drawn = (kind, any::<(usize, u8)>(), values, any::<u64>(), end);
    drawn.prop_filter_map(
        "what the kind allows",
        |(kind, (place, number), values, at_us, (count, duration_us))| {
            let within = |form, value: u64| match form {
                Form::Word(words) => value % words.len() as u64,
                Form::Number { least, most } | Form::Hex { least, most, .. } | Form::Time { least, most } => {
                    least + value % (most - least + 1)
                }
                Form::Name | Form::Port => value,
            };
            let field = |name| kind.all_fields().find(|field| field.name() == name).unwrap().form();
            let mut draft = Draft::new(kind, target(kind, place, number));
            for ((field, value), drawn) in kind.fields().iter().zip(&mut draft.values).zip(values) {
                *value = drawn.map(|drawn| within(field.form(), drawn));
            }
            draft.at_us = within(field("at_us"), at_us);
            draft.count = count.map(|count| within(field("count"), count));
            draft.duration_us =
                duration_us.map(|us| within(field("duration_us"), us)).filter(|_| draft.count.is_none());
            draft.check().ok()
        },
    )
}

fn target(kind: &FaultKind, place: usize, number: u8) -> Target {
    let names = names();
    let (bus, device) = ((place % names.buses.len()) as u16, (place % names.plcs.len()) as u16);
    match kind.place() {
        TargetKind::Bus => Target::Bus(BusIndex::of_number(bus)),
        TargetKind::Participant => Target::Participant { bus: BusIndex::of_number(bus), number: number % 32 },
        TargetKind::Port => {
            // Faults of ports concern CAN controllers only.
            let ports = names.device(DeviceIndex(device)).ports.iter();
            let ports: Vec<_> = ports.filter(|port| CONTROLLERS.contains(&port.medium)).collect();
            Target::Port {
                device: DeviceIndex(device),
                port: ports[usize::from(number) % ports.len()].number,
            }
        }
        TargetKind::Device => Target::Device(DeviceIndex(device)),
    }
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn any_fault_comes_back_from_its_words(fault in any_fault()) {
        let written = fault.text(&names());
        let words: Vec<_> = written.split(' ').skip(1).collect();
        let spec = FaultSpec::from_words(fault_kinds(), fault.kind().name(), &words).unwrap();
        prop_assert_eq!(spec.resolve(fault_kinds(), &names()), Ok(fault), "{}", written);
    }

    #[test]
    fn any_fault_comes_back_from_a_plant_file(fault in any_fault()) {
        let text = toml::to_string(&FaultSpec::of(&fault, &names())).unwrap();
        prop_assert_eq!(resolve(&text), Ok(fault), "{}", text);
    }
}

#[test]
fn a_port_is_called_by_its_name_or_number() {
    for (node, port, written) in [
        (
            "2",
            Target::Port { device: DeviceIndex(0), port: PortNumber(2) },
            "bus_off plc=line node=2 count=1",
        ),
        (
            "'node2'",
            Target::Port { device: DeviceIndex(0), port: PortNumber(2) },
            "bus_off plc=line node=2 count=1",
        ),
        (
            "'slotM'",
            Target::Port { device: DeviceIndex(2), port: PortNumber(6) },
            "bus_off plc=maxx node=slotM count=1",
        ),
        (
            "1",
            Target::Port { device: DeviceIndex(2), port: PortNumber(1) },
            "bus_off plc=maxx node=slotG count=1",
        ),
    ] {
        let Target::Port { device, .. } = port else { unreachable!() };
        let plc = &names().plcs[device.index()];
        let fault = resolve(&format!("kind = 'bus_off'\nplc = '{plc}'\nnode = {node}")).unwrap();
        assert_eq!((fault.target(), fault.text(&names()).as_str()), (port, written));
    }
}

#[test]
fn each_mistake_names_the_field_and_a_correct_value() {
    for (text, expected) in [
        (
            "kind = 'explode'",
            "kind = \"explode\": there is no such fault; the kinds are: lose_frame, delay_frame, \
             duplicate_frame, lose_sync, jitter_sync, slave_off, slave_late, slave_busy, slave_error, \
             wrong_offset, bus_off, overrun, drive_fault, baps_drive_fault, baps_silent, baps_slow, \
             error_frame, lost_arbitration, lose_telegram, delay_telegram, repeat_telegram, garble_telegram, \
             wrong_frame_count, silent_station, noise, short_circuit, wire_break, supply, temperature, memory, \
             fatal, can_init, lose_character, garble_character, delay_character, silent_participant, \
             line_break, silent_drive, hang",
        ),
        (
            "kind = 'baps_drive_fault'\nplc = 'saw'\nerror = 0",
            "baps_drive_fault: error is 16#000; it must be 16#001 to 16#FFFF",
        ),
        (
            "kind = 'baps_drive_fault'\nplc = 'saw'\nnode = 1\nerror = 1",
            "baps_drive_fault: node has no meaning; its fields are: plc, error, at_us, count, duration_us",
        ),
        (
            "kind = 'drive_fault'\nbus = 'drives'\nslave = 1",
            "drive_fault: error is missing; give the fault number, 1 to 16#FFFF",
        ),
        (
            "kind = 'baps_silent'\nplc = 'saw'\ndelay_us = 5",
            "baps_silent: delay_us has no meaning; its fields are: plc, at_us, count, duration_us",
        ),
        ("kind = 'baps_slow'\nplc = 'saw'", "baps_slow: delay_us is missing; give it in microseconds"),
        (
            "kind = 'baps_slow'\nplc = 'saw'\ndelay_us = 60000001",
            "baps_slow: delay_us is 60000001; it must be 1 to 60000000 (1 min)",
        ),
        ("kind = 'lose_sync'", "lose_sync: bus is missing; give one of: drives, upper"),
        ("kind = 'lose_sync'\nbus = 'x'", "lose_sync: bus \"x\" does not exist; buses are: drives, upper"),
        ("kind = 'bus_off'\nnode = 1", "bus_off: plc is missing; give one of: line, saw, maxx"),
        (
            "kind = 'bus_off'\nplc = 'x'\nnode = 1",
            "bus_off: PLC \"x\" does not exist; PLCs are: line, saw, maxx",
        ),
        ("kind = 'bus_off'\nplc = 'saw'", "bus_off: node is missing; give 1 (slave) or 2 (master)"),
        ("kind = 'bus_off'\nplc = 'saw'\nnode = 3", "bus_off: node is 3; it must be 1 to 2"),
        (
            "kind = 'bus_off'\nplc = 'saw'\nnode = 'slotG'",
            "bus_off: PLC \"saw\" has no port \"slotG\"; its ports are: node1, node2",
        ),
        (
            "kind = 'bus_off'\nplc = 'maxx'\nnode = 7",
            "bus_off: PLC \"maxx\" has no port 7; its ports are: slotG, slotH, slotJ, slotK, slotL, slotM",
        ),
        (
            "kind = 'overrun'\nplc = 'maxx'",
            "overrun: node is missing; give slotG, slotH, slotJ, slotK, slotL or slotM",
        ),
        ("kind = 'lose_sync'\nbus = 1", "lose_sync: bus = 1; it must be its name"),
        (
            "kind = 'lose_frame'\nbus = 'drives'\nid = '0x101'",
            "lose_frame: id = \"0x101\"; it must be a number, 16#000 to 16#1FFFFFFF",
        ),
        (
            "kind = 'lose_frame'\nbus = 'drives'\nslot = 3",
            "lose_frame: slot = 3; it must be WRC1, RDC1, WRC2, RDC2, CC, RC",
        ),
        (
            "kind = 'slave_late'\nbus = 'drives'\nslave = 1\nus = 5\ndelay_us = 5",
            "slave_late: delay_us is given twice",
        ),
        (
            "kind = 'lose_sync'\nbus = 'drives'\ncolour = 1",
            "lose_sync: unknown field `colour`; its fields are: bus, at_us, count, duration_us",
        ),
        (
            "kind = 'slave_busy'\nbus = 'drives'",
            "slave_busy: slave is missing; give the slave number, 0 to 31",
        ),
        ("kind = 'slave_busy'\nbus = 'drives'\nslave = 32", "slave_busy: slave is 32; it must be 0 to 31"),
        ("kind = 'slave_busy'\nbus = 'drives'\nslave = 256", "slave_busy: slave is 256; it must be 0 to 31"),
        (
            "kind = 'slave_busy'\nbus = 'drives'\nslave = 1\nid = 5",
            "slave_busy: id has no meaning; its fields are: bus, slave, at_us, count, duration_us",
        ),
        (
            "kind = 'slave_off'\nbus = 'drives'\nslave = 1\ncount = 5",
            "slave_off: count has no meaning for slave_off; give duration_us, or clear the fault",
        ),
        (
            "kind = 'slave_error'\nbus = 'drives'\nslave = 1",
            "slave_error: error is missing; give the error number, for example 16#FFFB",
        ),
        (
            "kind = 'slave_error'\nbus = 'drives'\nslave = 1\nerror = 0x10000",
            "slave_error: error is 16#10000; it must be 16#000 to 16#FFFF",
        ),
        ("kind = 'delay_frame'\nbus = 'drives'", "delay_frame: delay_us is missing; give it in microseconds"),
        (
            "kind = 'delay_frame'\nbus = 'drives'\ndelay_us = 0",
            "delay_frame: delay_us is 0; it must be 1 to 1000000 (1 s)",
        ),
        (
            "kind = 'jitter_sync'\nbus = 'drives'\namplitude_us = 2001",
            "jitter_sync: amplitude_us is 2001; it must be 1 to 2000 (2 ms)",
        ),
        (
            "kind = 'lose_frame'\nbus = 'drives'\nid = 0x20000000",
            "lose_frame: id is 16#20000000; it must be 16#000 to 16#1FFFFFFF",
        ),
        (
            "kind = 'error_frame'\nbus = 'drives'\nid = 0x800\nformat = 'standard'",
            "error_frame: id 16#800 has more than 11 bits; give format=extended, or leave format out",
        ),
        (
            "kind = 'lose_frame'\nbus = 'drives'\nmask = 1",
            "lose_frame: id is missing; a mask needs the identifier it is compared with",
        ),
        (
            "kind = 'lose_frame'\nbus = 'drives'\nid = 3\nmask = 1",
            "lose_frame: id 16#003 can never match under the mask 16#001; clear the bits outside the mask",
        ),
        (
            "kind = 'lose_frame'\nbus = 'drives'\nslot = 'WRC3'",
            "lose_frame: slot = \"WRC3\"; it must be WRC1, RDC1, WRC2, RDC2, CC, RC",
        ),
        (
            "kind = 'wrong_offset'\nbus = 'drives'\nslave = 1\nslot = 'WRC1'",
            "wrong_offset: slot = \"WRC1\"; it must be CC, RC",
        ),
        (
            "kind = 'wrong_offset'\nbus = 'drives'\nslave = 1\noffset = 4096",
            "wrong_offset: offset is 4096; it must be 0 to 4095",
        ),
        (
            "kind = 'lose_sync'\nbus = 'drives'\ncount = 1\nduration_us = 1",
            "lose_sync: count and duration_us exclude each other; give one of them",
        ),
        (
            "kind = 'lose_sync'\nbus = 'drives'\nduration_us = 3600000001",
            "lose_sync: duration_us is 3600000001; it must be 1 to 3600000000 (1 h)",
        ),
    ] {
        assert_eq!(resolve(text).unwrap_err().to_string(), expected);
    }
}

/// Returns each kind together with each of its fields and a value that is possible for this field.
fn each_field() -> impl Iterator<Item = (&'static FaultKind, usize)> {
    fault_kinds().iter().flat_map(|kind| (0..kind.fields().len()).map(|index| (*kind, index)))
}

#[test]
fn every_range_ends_at_the_limit_of_its_kind() {
    for (kind, index) in each_field() {
        let field = &kind.fields()[index];
        let (least, most) = field.range();
        let check = |value: u64| {
            let mut draft = Draft::new(kind, Target::of_numbers(kind.place(), 0, 1));
            for (value, field) in draft.values.iter_mut().zip(kind.fields()) {
                *value = Some(field.range().0);
            }
            draft.values[index] = Some(value);
            draft.check()
        };
        for value in [least, most] {
            let result = check(value);
            assert!(
                matches!(result, Ok(_) | Err(Refusal::Disagree(_))),
                "{kind:?} {field} {value}: {result:?}"
            );
        }
        for value in [least.checked_sub(1), Some(most + 1), Some(u64::MAX)].into_iter().flatten() {
            assert_eq!(check(value), Err(Refusal::Range { field, value, least, most }), "{kind:?}");
        }
    }
}

#[test]
fn every_kind_has_an_example_and_a_description() {
    for kind in fault_kinds() {
        assert!(!kind.about().is_empty() && !kind.about().ends_with('.'), "{kind:?}");
        let words: Vec<_> = kind.example().split(' ').collect();
        let spec = FaultSpec::from_words(fault_kinds(), kind.name(), &words).unwrap();
        let one = Names { plcs: vec!["line".into()], buses: vec!["drives".into()], devices: names().devices };
        spec.resolve(fault_kinds(), &one).unwrap();
    }
}

#[test]
fn fields_that_can_hold_anything_are_those_that_say_where() {
    let spec = FaultSpec::from_words(fault_kinds(), "bus_off", &["plc=2", "node=2"]).unwrap();
    let expected = [("plc", FieldValue::Text("2".into())), ("node", FieldValue::Number(2))];
    assert_eq!(spec.fields, expected.map(|(name, given)| (name.to_owned(), given)));
}

/// The rows of the page for users contain every kind, and every field with its range, letter for letter.
#[test]
fn the_documentation_lists_exactly_these_kinds_and_fields() {
    let page = include_str!("../../../docs/reference/faults.md");
    let rows: Vec<_> = page.lines().filter(|line| line.starts_with("| `")).collect();
    let expected: Vec<_> = fault_kinds().iter().flat_map(|kind| rows_of(kind)).collect();
    let (_, table) = page.split_once("## All kinds").unwrap();
    let table: Vec<_> =
        table.lines().filter(|line| line.starts_with("| `") || line.starts_with("| |")).collect();
    assert_eq!(table, expected, "{rows:?}");
}

/// Returns the rows of a kind in the table, one for each of its fields.
fn rows_of(kind: &'static FaultKind) -> Vec<String> {
    let acts_on = match kind.place() {
        TargetKind::Bus => "a bus",
        TargetKind::Participant => "a slave",
        TargetKind::Port => "a port",
        TargetKind::Device => "a PLC",
    };
    let ends = match (kind.happens_once(), kind.has_hits()) {
        (true, _) => "once",
        (false, true) => "",
        (false, false) => "not by `count`",
    };
    let mut rows = vec![format!("| `{}` | {acts_on} | {}. | {ends} |", kind.name(), kind.about())];
    let field = |field: &crate::fault::Field| {
        format!("| | `{}` | {} | {} |", field.name(), field.about(), field.range_text())
    };
    rows.extend(kind.fields().iter().map(field));
    rows
}

/// The gateway has three ports, and one of them is a port to CAN; the controller has one port (decision D-343).
#[test]
fn the_only_can_controller_of_a_device_needs_no_name() {
    let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let devices = [&can_dp2::registers::DEVICE, &cs0015::registers::DEVICE];
    let devices = devices.map(DeviceFit::unknown).to_vec();
    let names = Names { plcs: list(&["gw", "panel"]), buses: list(&["open"]), devices };
    let resolve = |text: &str| toml::from_str::<FaultSpec>(text).unwrap().resolve(fault_kinds(), &names);
    for kind in ["bus_off", "overrun"] {
        for device in ["gw", "panel"] {
            let short = resolve(&format!("kind = '{kind}'\ndevice = '{device}'")).unwrap();
            let whole = resolve(&format!("kind = '{kind}'\nplc = '{device}'\nnode = 'can'")).unwrap();
            assert_eq!(short, whole);
        }
    }
}
