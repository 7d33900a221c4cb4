//! The access checker: for each rule one case that breaks it, and a similar case that is correct.

mod cases;

use crate::rig::bring_up::Stage;
use crate::rig::{BOTH, FASTEST, Memory, OMEGA_RATES, RATES, Rig, plant_of};
use cases::cases;
use commram::check::rules;
use commram::devices::cansync;
use commram::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use commram::devices::omega_drive_line_2::registers::BAPS;
use commram::identity::DeviceIndex;
use commram::journal::{Entry, Rule};
use commram::layout::{DeviceFit, Owner};
use commram::memory::{Cell8, Width};
use core::mem::offset_of;
use std::collections::BTreeSet;

fn findings(rig: &Rig) -> Vec<Entry> {
    rig.plant.journal().findings().iter().cloned().collect()
}

/// Returns the rule and the register of each finding.
fn names(rig: &Rig) -> Vec<(&'static str, Option<String>)> {
    let of = |entry: &Entry| (entry.last.rule.id(), entry.last.name(rig.fitted(entry.last.plc)));
    findings(rig).iter().map(of).collect()
}

#[test]
fn each_rule_is_broken_by_its_case_alone_and_not_by_the_neighbour() {
    for (rate, memory) in FASTEST.into_iter().flat_map(|rate| BOTH.map(|memory| (rate, memory))) {
        for case in cases(rate.kind) {
            let rule = case.rule;
            let mut rig = Rig::new(memory, rate);
            rig.expect_errors(&[rule]);
            (case.wrong)(&mut rig);
            rig.step(500);
            let found = findings(&rig);
            let [ref entry] = found[..] else { panic!("{rule}, {memory:?}, {rate:?}: {:?}", names(&rig)) };
            assert_eq!(entry.last.rule, rule, "{rate:?}");
            let register = rate.kind.named(case.register);
            assert_eq!(entry.last.name(rig.fitted(entry.last.plc)), Some(register), "{rule}, {rate:?}");
            assert_eq!(entry.last.value, (case.value)(rate), "{rule}, {rate:?}");
            assert_eq!(entry.count, 1, "{rule} is reported once");

            let mut rig = Rig::new(memory, rate);
            (case.right)(&mut rig);
            rig.step(500);
            assert_eq!(names(&rig), [], "the right way beside {rule}, {memory:?}");
        }
    }
}

/// Rules that only a program at a gateway port can break: `tests/cli/doors.rs`, `tests/cli/profibus_door.rs`.
const AT_A_DOOR: [&Rule; 5] = [
    &rules::GUEST_BIT_RATE,
    &rules::GUEST_TELEGRAM,
    &rules::GUEST_TIME,
    &rules::GUEST_EARLY,
    &cansync::rules::FOREIGN_FRAME,
];

/// Rules that need another plant than the plant of a test rig: `tests/device/bm4.rs`, `tests/device/board.rs`.
const IN_OTHER_PLANTS: [&Rule; 2] = [&cansync::rules::NUMBER_TAKEN, &cansync::rules::NO_MASTER];

/// The rules of scripts of device folders: `tests/device/folders.rs`.
const OF_SCRIPTS: [&str; 2] = ["own-rule", "script-stopped"];

/// The rules of serial lines: `tests/device/serial.rs`.
const OF_SERIAL_LINES: [&str; 7] = [
    "serial-settings",
    "serial-format",
    "serial-wires",
    "serial-termination",
    "serial-pull",
    "serial-collision",
    "serial-ring",
];

#[test]
fn every_rule_has_a_case() {
    // Rules of a device that is not in this list are tested next to its firmware.
    let elsewhere = ["cs0015", "can-dp2"]
        .map(|name| commram::devices::find(name).map_or(&[][..], |device| device.emulation.rules));
    let elsewhere = elsewhere.concat();
    let without: Vec<_> = commram::devices::catalogue()
        .rules
        .iter()
        .copied()
        .filter(|rule| {
            !AT_A_DOOR.contains(rule)
                && !IN_OTHER_PLANTS.contains(rule)
                && !elsewhere.contains(rule)
                && !OF_SCRIPTS.contains(&rule.id())
                && !OF_SERIAL_LINES.contains(&rule.id())
                && cases(OMEGA_RATES[0].kind).all(|case| case.rule != *rule)
        })
        .collect();
    let names: Vec<_> = without.iter().map(|rule| rule.id()).collect();
    assert!(
        names.is_empty(),
        "add a case for {names:?} in tests/device/check/cases/, as docs/internals/architecture.md, section \"A rule of the \
         checker\", says"
    );
}

/// A client that stores through the channel names the register: a write to a firmware register is reported even if its
/// value does not change.
#[test]
fn channel_stores_are_checked_at_ports_of_every_medium() {
    const PLANT: &str = "[[device]]\nkind = 'cs0015'\nname = 'panel'\nbus = 'open'\nnode_id = 5\n\
                         [[device]]\nkind = 'can-dp2'\nname = 'gw'\nprofibus = 'dp'\ncan = 'open'\n\
                         [[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n\
                         [[bus]]\nname = 'dp'\nkind = 'profibus'\nkbit_s = 500\n";
    let mut plant = plant_of(PLANT);
    plant.advance_to(3_000);
    let mut expected = Vec::new();
    for plc in 0..plant.devices().len() {
        let layout = plant.devices()[plc].layout();
        for port in layout.ports {
            let mut registers = DeviceFit::unknown(layout).used_registers(port.area);
            let Some(register) = registers.find(|register| register.owner() == Owner::Firmware) else {
                continue;
            };
            let (offset, width) = (register.offset(), register.address().width());
            let value = plant.load(DeviceIndex::at(plc), offset, width).unwrap();
            plant.store(DeviceIndex::at(plc), offset, width, value).unwrap();
            expected.push((DeviceIndex::at(plc), port.medium, Some(register.to_string())));
        }
    }
    let media: BTreeSet<_> = expected.iter().map(|(_, medium, _)| *medium).collect();
    assert_eq!(media, BTreeSet::from(["can", "profibus"]));
    let found = plant.journal().findings();
    for (plc, medium, name) in expected {
        let fitted = plant.names().fitted(plc);
        let is_it = |entry: &&Entry| {
            (entry.last.rule, entry.last.plc) == (&rules::OWNER, plc) && entry.last.name(fitted) == name
        };
        assert!(found.iter().any(|entry| is_it(&entry)), "{name:?} at {medium}");
    }
}

/// The last initialization data and the next register share a 64-bit word. A value in that register must be reported
/// once, not at every poll.
#[test]
fn an_error_at_the_end_of_the_initialization_data_is_reported_once() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.tolerate_errors(&commram::devices::catalogue().rules);
        rig.bring_up(&[&rig.master_node()], ..=Stage::WaitingForInit);
        rig.master_init.a_SL_TYP[31].store(0xFF);
        (0..10).for_each(|_| rig.step(700));
        let found: Vec<_> = findings(&rig).iter().map(|entry| (entry.last.rule.id(), entry.count)).collect();
        assert_eq!(found, [(rules::RESERVED_VALUE.id(), 1)], "{rate:?}");
    }
}

/// A program passes a structure as VAR_IN_OUT of a function block, which is copied in and out: the copy overwrites
/// values that the firmware has written in the meantime.
#[test]
fn a_structure_that_is_written_back_as_a_whole_is_found() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.expect_errors(&[&rules::OWNER]);
        rig.master.w_CPU_CONTROL.store(0x0001);
        let segment = rig.plant.devices()[rig.master_at.plc].segment();
        let cells =
            segment.view::<[Cell8; size_of::<CANsync_MA_CTRL_BMSTRUCT>()]>(rig.master_at.base).unwrap();
        let copy = cells.each_ref().map(|cell| cell.load());
        rig.step(1000);
        assert_eq!(rig.master.w_OPTION_STATUS.load(), 0x0002);
        cells.iter().zip(copy).for_each(|(cell, byte)| cell.store(byte));
        rig.step(1000);
        let status = rate.kind.named("MASTER.w_OPTION_STATUS");
        assert!(names(&rig).contains(&(rules::OWNER.id(), Some(status))), "{:?}", names(&rig));
    }
}

#[test]
fn a_late_release_is_reported_with_its_delay() {
    for rate in RATES {
        let deadline = u64::from(rate.timing.deadline_WRC.latest);
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.expect_errors(&[&cansync::rules::LATE_REFERENCE]);
        for late in [12, 37, 5] {
            if rig.plant.now() == 0 {
                rig.activate();
            }
            rig.run_to_sync();
            rig.send_wrc1();
            rig.step(deadline + late);
            rig.master.b_CTRLREG_WRC1.store(0x05);
            rig.run_to_sync();
        }
        let found = findings(&rig);
        assert_eq!((found[0].count, found[0].last.late_us, found[0].latest_us), (3, 5, 37));
    }
}

/// Decision D-142: A program that always releases one interval ahead is not late. A program that releases only now and
/// then is not late either.
#[test]
fn working_ahead_and_pausing_are_not_late() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.activate();
        for _ in 0..5 {
            rig.step(rate.interval_us / 2);
            rig.master.b_CTRLREG_WRC1.store(0x05);
            rig.run_to_sync();
        }
        for _ in 0..3 {
            rig.run_to_sync();
            rig.run_to_sync();
            rig.step(u64::from(rate.timing.deadline_WRC.latest) + 210);
            rig.master.b_CTRLREG_WRC1.store(0x05);
            rig.run_to_sync();
            rig.run_to_sync();
        }
        assert_eq!(names(&rig), []);
    }
}

/// A finding has the emulated time of the write, independently of the steps in which the test advances the clock after
/// the write.
#[test]
fn the_time_is_that_of_the_write() {
    for rate in FASTEST {
        for slice in [1, 77, 5000] {
            let mut rig = Rig::new(Memory::Mapped, rate);
            rig.expect_errors(&[&rules::OWNER]);
            rig.activate();
            rig.step(333);
            let at = rig.plant.now();
            rig.slave.w_OMEGA_NR.store(1);
            for _ in 0..5000 / slice {
                rig.step(slice);
            }
            rig.slave.w_OMEGA_NR.store(2);
            let again = rig.plant.now();
            rig.plant.processor_cycle();
            let found = findings(&rig);
            assert_eq!((found[0].first_us, found[0].last_us, found[0].count), (at, again, 2));
        }
    }
}

/// A store of the present value does not change the RAM, so the checker does not see it. A write through the channel
/// counts even if it does not change the value.
#[test]
fn through_the_channel_every_write_is_seen() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.expect_errors(&[&rules::OWNER]);
        rig.activate();
        let status = rate.kind.master.base + offset_of!(CANsync_MA_CTRL_BMSTRUCT, w_OPTION_STATUS) as u32;
        for _ in 0..3 {
            rig.plant.note_channel_write(DeviceIndex(0), status, 2, 0x0080);
        }
        rig.plant.devices()[0].segment().store(status, Width::Word, 0x0043).unwrap();
        rig.plant.note_channel_write(DeviceIndex(0), status, 2, 0x0043);
        rig.step(100);
        let found = findings(&rig);
        assert_eq!(
            (found.len(), found[0].count, found[0].last.value),
            (1, 4, 0x0043),
            "not found a second time"
        );
    }
}

#[test]
fn through_the_channel_every_write_to_the_baps_is_seen() {
    let mut rig = Rig::new(Memory::Heap, OMEGA_RATES[0]);
    rig.expect_errors(&[&rules::OWNER]);
    rig.activate();
    let status = BAPS + 2;
    for times in [1, 2] {
        rig.plant.devices()[0].segment().store(status, Width::Word, 0x0008).unwrap();
        rig.plant.note_channel_write(DeviceIndex(0), status, 2, 0x0008);
        assert_eq!(names(&rig), [(rules::OWNER.id(), Some("baps.w_STATUS_REG".to_owned()))]);
        assert_eq!(findings(&rig)[0].count, times);
    }
}

#[test]
fn findings_can_be_forgotten() {
    for rate in FASTEST {
        let mut rig = Rig::new(Memory::Heap, rate);
        rig.expect_errors(&[&rules::OWNER]);
        for value in [5, 6] {
            rig.plant.clear_findings();
            rig.slave.w_OMEGA_NR.store(value);
            rig.step(100);
            let found = findings(&rig);
            assert_eq!((found.len(), found[0].count, found[0].last.value), (1, 1, u32::from(value)));
        }
    }
}

/// Findings are events like all others: equal runs have equal findings, and other findings give the run another hash.
#[test]
fn findings_belong_to_the_run() {
    for rate in FASTEST {
        let run = |memory, value| {
            let mut rig = Rig::new(memory, rate);
            rig.expect_errors(&[&rules::OWNER]);
            rig.activate();
            rig.slave.w_OMEGA_NR.store(value);
            rig.step(3000);
            rig.plant.journal().hash()
        };
        assert_eq!(run(Memory::Heap, 5), run(Memory::Mapped, 5));
        assert_ne!(run(Memory::Heap, 5), run(Memory::Heap, 6));
    }
}
