//! The list of faults: when they begin and end, which entries are refused, and proof that runs with faults are repeatable.

use super::*;
use crate::rig::{BOTH, FASTEST, Memory};
use commram::fault::{Draft, FaultKind, MAX_AT_US, MAX_FAULTS, Refusal, Target};
use commram::identity::{BusIndex, DeviceIndex, PortNumber};
use commram::memory::Segment;
use commram::plant::{Plant, PlantConfig};

fn kind(name: &str) -> &'static FaultKind {
    fault_kinds().iter().find(|kind| kind.name() == name).unwrap()
}

#[test]
fn a_fault_waits_for_its_time_and_ends_after_its_duration() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let now = rig.plant.now();
        let at = now + 3_333;
        let id = add(&mut rig, &format!("kind = 'slave_off'\nslave = 2\nat_us = {at}\nduration_us = 444"));
        let acting = |rig: &Rig| rig.plant.faults().map(|fault| fault.acting).collect::<Vec<_>>();
        assert_eq!(acting(&rig), [false]);
        rig.plant.advance_to(at - 1);
        assert_eq!(acting(&rig), [false]);
        assert_eq!(rig.plant.next_event(), at);
        rig.plant.advance_to(at);
        assert_eq!(acting(&rig), [true]);
        rig.plant.advance_to(at + 444);
        assert!(acting(&rig).is_empty());
        assert_eq!(news(&rig), [(now, id, News::Added), (at + 444, id, News::Over)]);
    }
}

#[test]
fn numbers_count_up_and_cleared_ones_are_gone() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let ids = [0; 3].map(|_| add(&mut rig, "kind = 'lose_sync'\nat_us = 1000000000"));
        assert_eq!(ids, [1, 2, 3]);
        rig.plant.clear_fault(2).unwrap();
        assert_eq!(rig.plant.clear_fault(2), Err(Refusal::UnknownFault { id: 2 }));
        assert_eq!(rig.plant.faults().map(|fault| fault.id).collect::<Vec<_>>(), [1, 3]);
        assert_eq!(add(&mut rig, "kind = 'lose_sync'"), 4, "a number is not given away again at once");
        assert_eq!(rig.plant.clear_faults(), 3);
        assert_eq!(rig.plant.faults().count(), 0);
        let cleared = news(&rig).iter().filter(|(_, _, news)| *news == News::Cleared).count();
        assert_eq!(cleared, 4);
    }
}

#[test]
fn faults_of_missing_stations_or_with_invalid_values_are_refused() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let lose = Draft::new(kind("lose_sync"), Target::Bus(BusIndex(0)));
        let slave = |bus, number| Draft::new(kind("slave_busy"), Target::Participant { bus, number });
        let node = |device, port| Draft::new(kind("bus_off"), Target::Port { device, port });
        let cases = [
            (Draft { count: Some(0), ..lose }, "count is 0; it must be 1 to 4294967295"),
            (Draft { duration_us: Some(0), ..lose }, "duration_us is 0; it must be 1 to 3600000000 (1 h)"),
            (
                Draft { at_us: MAX_AT_US + 1, ..lose },
                "at_us is 31536000000001; it must be 0 to 31536000000000 (8760 h)",
            ),
            (slave(BusIndex(0), 7), "bus 0 has no slave 7; its slaves are: 0, 1, 2"),
            (slave(BusIndex(0), 200), "slave is 200; it must be 0 to 31"),
            (slave(BusIndex(1), 0), "bus 1 does not exist; the plant has 1, numbered from 0"),
            (
                node(DeviceIndex(0), rate.kind.slave.port),
                &rate.kind.named("SLAVE of PLC 0 is not on a bus; ports on a bus: MASTER"),
            ),
            (node(DeviceIndex(0), PortNumber(9)), "PLC 0 has no port 9; its ports are: "),
            (node(DeviceIndex(2), PortNumber(1)), "PLC 2 does not exist; the plant has 2, numbered from 0"),
        ];
        for (draft, expected) in cases {
            let refusal = draft.check().and_then(|fault| rig.plant.add_fault(fault)).unwrap_err().to_string();
            assert!(refusal.starts_with(expected), "{refusal}\n{expected}");
        }
        assert!(news(&rig).is_empty(), "a refused fault leaves no trace");
        for _ in 0..MAX_FAULTS {
            add(&mut rig, "kind = 'lose_sync'\nat_us = 1000000000");
        }
        let one_more = lose.check().unwrap();
        assert_eq!(rig.plant.add_fault(one_more), Err(Refusal::TooMany));
    }
}

#[test]
fn faults_of_the_plant_file_begin_at_their_time() {
    let text = "[[plc]]\nname = 'p'\nnode2 = 'b'\n[[bus]]\nname = 'b'\n[[bus.drive]]\nname = 'd'\nslave_number = 3\n\
                [[fault]]\nkind = 'slave_off'\nslave = 3\n\
                [[fault]]\nkind = 'lose_frame'\nbus = 'b'\nslot = 'WRC1'\nat_us = 5000\n";
    let config = PlantConfig::parse("faults", text).unwrap();
    let mut plant =
        Plant::new(&config, |_plc, device| Ok::<_, crate::rig::RigError>(Segment::of(device))).unwrap();
    let acting = |plant: &Plant| plant.faults().map(|fault| (fault.id, fault.acting)).collect::<Vec<_>>();
    assert_eq!(acting(&plant), [(1, true), (2, false)]);
    plant.advance_to(5_000);
    assert_eq!(acting(&plant), [(1, true), (2, true)]);
}

#[test]
fn mistakes_in_the_plant_file_are_named() {
    let plant = "[[plc]]\nname = 'p'\nnode2 = 'b'\n[[bus]]\nname = 'b'\n[[bus.drive]]\nname = 'd'\nslave_number = 3\n";
    for (fault, expected) in [
        (
            "kind = 'slave_busy'\nslave = 4",
            "[[fault]] 2: slave_busy: bus \"b\" has no slave 4; its slaves are: 3",
        ),
        ("kind = 'bus_off'\nnode = 1", "[[fault]] 2: bus_off: node1 of PLC \"p\" is not on a bus"),
        ("kind = 'lose_sync'\nbus = 'x'", "[[fault]] 2: lose_sync: bus \"x\" does not exist; buses are: b"),
        ("kind = 'lose_sync'\ncolour = 1", "unknown field `colour`"),
        ("slave = 4", "missing field `kind`"),
    ] {
        let text = format!("{plant}[[fault]]\nkind = 'lose_sync'\n[[fault]]\n{fault}\n");
        let message = PlantConfig::parse("test.toml", &text).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}\n{expected}");
        assert!(message.starts_with("test.toml: "), "{message}");
    }
    let text = format!("{plant}\n[[fault]]\nkind = 'slave_busy'\nslave = 4\n");
    let message = PlantConfig::parse("test.toml", &text).unwrap_err().to_string();
    assert!(message.starts_with("test.toml: line 10: [[fault]] 1: slave_busy: "), "{message}");
}

/// Runs a plant with several faults of every kind. The run is the same on both memories and with steps of any length.
fn run(memory: Memory, rate: Rate, slice_us: u64, count: u32) -> (u64, u64) {
    let mut rig = running(memory, rate);
    let now = rig.plant.now();
    for text in [
        "kind = 'lose_frame'\nslot = 'RDC1'\ncount = 2".to_owned(),
        format!(
            "kind = 'delay_frame'\nslot = 'WRC1'\ndelay_us = 777\nat_us = {}\ncount = {count}",
            now + 7_000
        ),
        format!("kind = 'duplicate_frame'\nslot = 'CC'\ndelay_us = 50\nat_us = {}", now + 3_001),
        format!("kind = 'lose_sync'\nat_us = {}\ncount = 2", now + 20_000),
        format!("kind = 'jitter_sync'\namplitude_us = 40\nat_us = {}\nduration_us = 9000", now + 4_000),
        format!("kind = 'slave_off'\nslave = 2\nat_us = {}\nduration_us = 5555", now + 6_000),
        "kind = 'slave_late'\nslave = 1\ndelay_us = 333\ncount = 3".to_owned(),
        "kind = 'slave_busy'\nslave = 0\ncount = 3".to_owned(),
        format!("kind = 'slave_error'\nslave = 1\nerror = 0xFFFA\nat_us = {}\ncount = 1", now + 15_000),
        "kind = 'wrong_offset'\nslave = 0\ncount = 1".to_owned(),
        format!("kind = 'overrun'\nplc = 'a'\nnode = 'MASTER'\nat_us = {}", now + 12_345),
        format!("kind = 'bus_off'\nplc = 'b'\nnode = 'SLAVE'\nat_us = {}", now + 30_000),
    ] {
        add(&mut rig, &text);
    }
    for round in 0..30 {
        rig.master.b_CTRLREG_WRC1.store(0x05);
        enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
        if round == 20 {
            rig.slave.w_CPU_CONTROL.store(0x00C0);
        }
        let end = rig.plant.now() + rate.scaled(1_937);
        while rig.plant.now() < end {
            rig.step(slice_us.min(end - rig.plant.now()));
        }
    }
    (rig.plant.journal().hash(), rig.plant.journal().written())
}

#[test]
fn runs_with_faults_are_repeatable() {
    for rate in FASTEST {
        let first = run(Memory::Heap, rate, u64::MAX, 3);
        for memory in BOTH {
            for slice_us in [u64::MAX, 1000, 333] {
                assert_eq!(run(memory, rate, slice_us, 3), first, "{memory:?}, slices of {slice_us} us");
            }
        }
        assert_ne!(run(Memory::Heap, rate, u64::MAX, 4).0, first.0, "another fault, another journal");
    }
}
