use super::*;
use crate::journal::Names;

fn names() -> Names {
    let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    Names { plcs: list(&["line", "saw"]), buses: list(&["drives", "upper"]), ..Names::default() }
}

fn resolve(text: &str) -> Result<Fault, FaultError> {
    toml::from_str::<FaultSpec>(text).unwrap().resolve(&names())
}

/// One description of each kind with all its fields, and how it is written in a list.
const EACH_KIND: [(&str, &str); 16] = [
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
];

#[test]
fn descriptions_of_every_kind_are_read_and_written_alike() {
    for ((text, written), kind) in EACH_KIND.into_iter().zip(Kind::ALL) {
        let fault = resolve(text).unwrap();
        assert_eq!(fault.kind(), kind);
        let (index, number) = fault.target().numbers();
        assert_eq!(kind.target(index, number), fault.target());
        let spec = FaultSpec::of(&fault, &names());
        assert_eq!(spec.to_string(), written);
        assert_eq!(spec.resolve(&names()), Ok(fault), "there and back again");
        assert_eq!(toml::from_str::<FaultSpec>(&toml::to_string(&spec).unwrap()).unwrap(), spec);
    }
}

#[test]
fn each_mistake_names_the_field_and_what_would_be_right() {
    for (text, expected) in [
        (
            "kind = 'explode'",
            "kind = \"explode\": there is no such fault; the kinds are: lose_frame, delay_frame, \
             duplicate_frame, lose_sync, jitter_sync, slave_off, slave_late, slave_busy, slave_error, \
             wrong_offset, bus_off, overrun, drive_fault, baps_drive_fault, baps_silent, baps_slow",
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
            "baps_slow: delay_us is 60000001; it must be 1 to 60000000",
        ),
        ("kind = 'lose_sync'", "lose_sync: bus is missing; give one of: drives, upper"),
        ("kind = 'lose_sync'\nbus = 'x'", "lose_sync: bus \"x\" does not exist; buses are: drives, upper"),
        ("kind = 'bus_off'\nnode = 1", "bus_off: plc is missing; give one of: line, saw"),
        ("kind = 'bus_off'\nplc = 'x'\nnode = 1", "bus_off: PLC \"x\" does not exist; PLCs are: line, saw"),
        ("kind = 'bus_off'\nplc = 'saw'", "bus_off: node is missing; give 1 (slave) or 2 (master)"),
        ("kind = 'bus_off'\nplc = 'saw'\nnode = 3", "bus_off: node is 3; it must be 1 to 2"),
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
            "delay_frame: delay_us is 0; it must be 1 to 1000000",
        ),
        (
            "kind = 'jitter_sync'\nbus = 'drives'\namplitude_us = 2001",
            "jitter_sync: amplitude_us is 2001; it must be 1 to 2000",
        ),
        (
            "kind = 'lose_frame'\nbus = 'drives'\nid = 0x800",
            "lose_frame: id is 16#800; it must be 16#000 to 16#7FF",
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
            "lose_sync: duration_us is 3600000001; it must be 1 to 3600000000",
        ),
    ] {
        assert_eq!(resolve(text).unwrap_err().to_string(), expected);
    }
}

#[test]
fn the_only_bus_or_plc_need_not_be_named() {
    let one = Names { plcs: vec!["line".into()], buses: vec!["drives".into()], ..Names::default() };
    for kind in ["kind = 'lose_sync'", "kind = 'overrun'\nnode = 2"] {
        assert!(toml::from_str::<FaultSpec>(kind).unwrap().resolve(&one).is_ok());
    }
}

#[test]
fn refusals_get_names() {
    let named = |refusal| FaultError::refused(Kind::SlaveBusy, refusal, &names()).to_string();
    assert_eq!(
        named(Refusal::NoSlave { bus: 1, slave: 7, present: 1 << 3 | 1 << 31 }),
        "slave_busy: bus \"upper\" has no slave 7; its slaves are: 3, 31"
    );
    assert_eq!(
        named(Refusal::NoSlave { bus: 0, slave: 7, present: 0 }),
        "slave_busy: bus \"drives\" has no slave 7; its slaves are: none"
    );
    assert_eq!(
        named(Refusal::NoNode { plc: 1, node: 1 }),
        "slave_busy: node1 of PLC \"saw\" is not on a bus; name a node, 1 or 2, that is"
    );
    assert_eq!(named(Refusal::TooMany), "slave_busy: there are 256 faults already; clear one first");
}

#[test]
fn codes_and_names_lead_back() {
    for kind in Kind::ALL {
        assert_eq!((Kind::from_code(kind as u8), Kind::from_name(kind.name())), (Some(kind), Some(kind)));
    }
    for field in Field::ALL {
        assert_eq!(Field::from_code(field as u8), Some(field));
    }
    assert_eq!((Kind::from_code(0), Kind::from_name("x"), Field::from_code(0)), (None, None, None));
}
