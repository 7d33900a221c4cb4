//! Process data between a master, a slave node and drives: which station receives which frame, and when.

use crate::rig::bring_up::{Mode, Node, Stage, bring_up_in};
use crate::rig::{BOTH, FASTEST, Memory, RATES, Rig, plant_of};
use commram::devices::cansync;
use commram::devices::cansync::bus::drives;
use commram::devices::cansync::frames::wire;
use commram::devices::cansync::records::{BaudRateMismatch, Missed, OmittedFrame, SyncEdge};
use commram::identity::{BusIndex, DeviceIndex};

const DRIVES: &str = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n\
                      [[bus.drive]]\nname = 'd2'\nslave_number = 2\nlock_time_us = 30000\n";

/// Returns a test rig with active drives: reference value 0 is a doubleword in WRC1, actual value 0 of each slave comes
/// from RDC1.
fn with_drives(memory: Memory, rate: crate::rig::Rate) -> Rig {
    let mut rig = Rig::of(memory, rate, DRIVES);
    rig.activate();
    rig.step(60_000); // until the drives are locked
    rig.configure_wrc1([0x01, 0x03, 0, 0]);
    for slave in &rig.master.a_CFG_RDC_WORD {
        slave.b_CFG_RDC1_WORD0.store(0x01);
        slave.b_CFG_RDC1_WORD1.store(0x03);
    }
    rig.run_to_sync();
    rig
}

/// Tests the slots of frames (manual 5.00005.03a p. 125), and the time at which a reference value takes effect in a
/// drive (5.01010.01 p. 20; D-34).
#[test]
fn a_reference_value_comes_back_as_actual_value_two_intervals_later() {
    for memory in BOTH {
        for rate in RATES {
            let mut rig = with_drives(memory, rate);
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(2);
            rig.master.a_WR_VALUE[0].store(0x1122_3344);
            let seen: Vec<u32> = (0..3)
                .map(|_| {
                    rig.send_wrc1();
                    rig.master.a_RD_BMARRAY[2][0].load()
                })
                .collect();
            assert_eq!(seen, [0, 0, 0x1122_3344]);
            assert_eq!(rig.master.b_STATREG_RDC1.load(), 2);
        }
    }
}

#[test]
fn frames_start_in_their_slots_and_last_as_long_as_their_bits() {
    let of_kind = [(500, 730, 1060), (250, 1430, 2100), (125, 3020, 4310)];
    let slots = of_kind.into_iter().chain([(1000, 350, 520)]).chain(of_kind);
    for (rate, (kbit_s, wrc1, rdc1)) in RATES.into_iter().zip(slots) {
        assert_eq!(rate.kbit_s, kbit_s);
        let mut rig = with_drives(Memory::Heap, rate);
        rig.master.b_CTRLREG_RD_ORDER_RDC1.store(1);
        let sync = rig.plant.now();
        rig.send_wrc1();
        let end = |id: u16| {
            let frames = rig.frames();
            let (time, frame) =
                frames.iter().rev().find(|(_, frame)| frame.id() == id).expect("the frame went out");
            time - u64::from(wire::airtime(frame, u32::from(kbit_s)).delivery_us) - sync
        };
        assert_eq!((end(0x101), end(0x301)), (wrc1, rdc1));
    }
}

/// Manual 5.00005.03a p. 182-187: a slave reads the frames of the other slaves, never its own.
#[test]
fn a_slave_node_overhears_other_slaves_but_not_itself() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = with_drives(memory, rate);
            for slave in [0, 1] {
                rig.slave.a_CFG_RDC_WORD[slave].b_CFG_RDC1_WORD0.store(0x05);
            }
            rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
            rig.master.a_WR_VALUE[0].store(0x0000_7788);
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(1);
            for _ in 0..3 {
                rig.send_wrc1();
            }
            assert_eq!(rig.slave.a_RD_BMARRAY[1][1].load(), 0x7788);
            assert_eq!(rig.slave.a_STATREG_RDC[1].b_STATREG_RDC1.load(), 0x02);
            assert_eq!(rig.slave.b_STATREG_RDC1.load(), 1);

            rig.slave.b_STATREG_RDC1.store(0xFF);
            rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(0);
            rig.send_wrc1();
            assert_eq!(rig.master.b_STATREG_RDC1.load(), 0, "the master has it");
            assert_eq!(rig.slave.b_STATREG_RDC1.load(), 0xFF, "the sender has not");
        }
    }
}

/// Manual 5.00005.03a p. 182: a slave sends its frame only if the frame was released in time and the master requests
/// it.
#[test]
fn an_own_actual_value_needs_release_and_request() {
    for rate in FASTEST {
        let mut rig = with_drives(Memory::Heap, rate);
        rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
        rig.master.b_CTRLREG_RD_ORDER_RDC1.store(1);
        rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
        rig.send_wrc1();
        assert_eq!(rig.slave.b_CTRLREG_RD_RDC1.load(), 0x04, "acknowledged when built, asked for or not");
        assert_eq!(rig.last_frame(0x300..=0x300), None, "not asked for");

        rig.master.b_CTRLREG_RD_ORDER_RDC1.store(0);
        rig.send_wrc1();
        assert_eq!(rig.last_frame(0x300..=0x300), None, "not released");
        let missed = rig
            .records()
            .any(|r| r.event.get().is_some_and(|it: Missed| it.what == OmittedFrame::ActualValue(1)));
        assert!(missed);

        rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
        rig.send_wrc1();
        assert!(rig.last_frame(0x300..=0x300).is_some());
    }
}

/// The slave's second frame may be released until WRC1 is processed (p. 182; D-26).
#[test]
fn the_second_actual_value_frame_has_a_later_deadline() {
    for rate in FASTEST {
        let deadline = rate.timing.deadline_RDC2;
        let [first, earliest, latest] =
            [deadline.earliest - 200, deadline.earliest, deadline.latest].map(u64::from);
        for (release_at, sent) in [(first, true), (earliest - 1, true), (latest, false)] {
            let mut rig = with_drives(Memory::Heap, rate);
            rig.slave._CFG_RDC_WORD.b_CFG_RDC2_WORD0.store(0x01);
            rig.master.b_CTRLREG_RD_ORDER_RDC2.store(0);
            rig.master.b_CTRLREG_WRC1.store(0x05);
            rig.master.b_CTRLREG_WRC2.store(0x05);
            rig.step(release_at);
            rig.slave.b_CTRLREG_RD_RDC2.store(0x05);
            rig.run_to_sync();
            assert_eq!(rig.last_frame(0x380..=0x380).is_some(), sent, "released {release_at} us after SYNC");
        }
    }
}

/// Decision D-26: the deadline is the end of WRC1 plus 15 us for each word that the slave takes from it, within the
/// limits of the rate; without WRC1 the latest time applies.
#[test]
fn the_second_deadline_follows_reference_value_frame_1() {
    for rate in FASTEST {
        let [earliest, latest] =
            [rate.timing.deadline_RDC2.earliest, rate.timing.deadline_RDC2.latest].map(u64::from);
        // Returns whether frame 2, released `after` microseconds after the edge, is acknowledged, and the end of WRC1.
        let released = |words: usize, has_wrc1: bool, after: u64| {
            let mut rig = with_drives(Memory::Heap, rate);
            let taken = &rig.slave._CFG_WRC_WORD;
            let bytes = [
                &taken.b_CFG_WRC1_WORD0,
                &taken.b_CFG_WRC1_WORD1,
                &taken.b_CFG_WRC1_WORD2,
                &taken.b_CFG_WRC1_WORD3,
            ];
            bytes
                .into_iter()
                .zip([0x01, 0x03, 0x05, 0x07])
                .take(words)
                .for_each(|(cell, byte)| cell.store(byte));
            rig.run_to_sync();
            let edge = rig.plant.now();
            if has_wrc1 {
                rig.master.b_CTRLREG_WRC1.store(0x05);
            }
            rig.step(after);
            rig.slave.b_CTRLREG_RD_RDC2.store(0x05);
            rig.run_to_sync();
            let wrc1 = rig.frames().into_iter().rfind(|(end, frame)| *end > edge && frame.id() == 0x100);
            (rig.slave.b_CTRLREG_RD_RDC2.load() == 0x04, wrc1.map(|(end, _)| end - edge))
        };
        let mut deadlines = Vec::new();
        for words in [1, 4] {
            let (_, wrc1) = released(words, true, 0);
            let due = (wrc1.unwrap() + 15 * words as u64).clamp(earliest, latest);
            assert!(released(words, true, due - 1).0, "{words} words, {due} us");
            assert!(!released(words, true, due).0, "{words} words, {due} us");
            deadlines.push(due);
        }
        assert!(earliest == latest || deadlines[0] < deadlines[1], "{deadlines:?}: nothing else decides");
        assert!(released(4, false, latest - 1).0 && !released(4, false, latest).0);
    }
}

/// Decision D-25: if no slave has the number, no slave answers, independently of the lower bits. The master still sends
/// the reference values.
#[test]
fn an_unused_slave_number_requests_no_answer() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        rig.expect_errors(&[&cansync::rules::SLAVE_NUMBER]);
        rig.activate();
        rig.run_to_sync(); // "SYNC mode: on" has gone out
        for number in [0x20, 0x21, 0x7F, 0x81, 0x82, 0x9F, 0xA1, 0xFF] {
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(number);
            rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
            let before = rig.frames().len();
            rig.send_wrc1();
            let ids: Vec<u16> = rig.frames()[before..].iter().map(|(_, frame)| frame.id()).collect();
            assert_eq!(ids, [0x17F], "16#{number:02X}");
        }
    }
}

/// Decision D-25: `b_MAX_SL_NR` above 31 counts as 31.
#[test]
fn automatic_requests_end_at_slave_31() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        rig.expect_errors(&[&cansync::rules::SLAVE_NUMBER]);
        rig.activate();
        rig.master.b_MAX_SL_NR.store(200);
        rig.master.b_CTRLREG_RD_ORDER_RDC1.store(0x80);
        rig.run_to_sync();
        for _ in 0..70 {
            rig.send_wrc1();
        }
        let frames = rig.frames();
        let asked: Vec<u16> =
            frames.iter().map(|(_, frame)| frame.id()).filter(|id| id & 0x780 == 0x100).collect();
        let first = asked[0];
        let expected: Vec<u16> = (0..70).map(|n| 0x100 + (first - 0x100 + n) % 32).collect();
        assert_eq!(asked, expected);
    }
}

/// A node or a drive at another baud rate than the bus receives nothing and disturbs no other station.
#[test]
fn a_station_at_another_baud_rate_receives_nothing() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        rig.expect_errors(&[&cansync::rules::DRIVE_BAUD_RATE, &cansync::rules::BUS_BAUD_RATE]);
        rig.rate = rate.slower();
        rig.initialize_master();
        rig.rate = rate;
        rig.initialize_slave();
        rig.master.w_CPU_CONTROL.store(0x0020);
        rig.step(500);
        rig.slave.w_CPU_CONTROL.store(0x0020);
        rig.step(100_000);
        assert_eq!(rig.master.a_STAT_SL[0].load(), 0, "the bus is slower than the slave node");
        assert_eq!(rig.master.a_STAT_SL[1].load(), 0, "so are the drives");
        assert!(rig.records().any(|r| r.event.is::<BaudRateMismatch>()));
    }
}

/// Decision D-12: the lower bus gets its edges at the same microsecond as the upper one.
#[test]
fn a_cluster_forwards_the_sync_signal() {
    for rate in FASTEST {
        let (kind, drive) =
            (rate.kind, "[[bus.drive]]\nname = 'd'\nslave_number = 0\nlock_time_us = 10000\n");
        let mut plant = plant_of(
            &[
                kind.plc("top", 0, None, Some("upper")),
                kind.plc("middle", 3, Some("upper"), Some("lower")),
                rate.bus("upper", ""),
                rate.bus("lower", drive),
            ]
            .concat(),
        );
        let (master, slave) = (kind.master, kind.slave);
        for (plc, at, mode) in [(0, master, Mode::Master), (1, slave, Mode::Slave), (1, master, Mode::SyncIn)]
        {
            let node = Node::at(plant.devices()[plc].segment(), at.base, rate.timing, mode);
            bring_up_in(&mut plant, &[&node], ..=Stage::SetUp);
        }
        plant.advance_to(plant.now() + 50_000);
        let edges = |bus| -> Vec<u64> {
            let edge = |r: &commram::journal::Record| r.event == SyncEdge { bus }.into();
            let (noted, pending) = (plant.journal().records(), plant.journal().pending());
            noted.chain(pending).filter(edge).flat_map(|r| r.times()).collect()
        };
        let (upper, lower) = (edges(BusIndex(0)), edges(BusIndex(1)));
        assert!(lower.len() > 20 && upper.ends_with(&lower), "{upper:?} {lower:?}");
        assert_eq!(
            plant.next_sync(DeviceIndex(1), master.port),
            plant.next_sync(DeviceIndex(0), master.port),
            "asked at either master"
        );
        assert!(drives(plant.buses()).all(|drive| drive.is_synchronized()));
    }
}

/// The load of the bus counts each frame with the time of its own bits and of the intermission that must follow it.
#[test]
fn the_load_of_a_bus_is_the_time_of_its_frames() {
    for rate in FASTEST {
        let mut rig = with_drives(Memory::Heap, rate);
        assert_eq!(rig.plant.bus_load(BusIndex(9), 1000), None, "there is no such bus");
        let span_us = 20 * rate.interval_us;
        let begin = rig.plant.now();
        for _ in 0..20 {
            rig.send_wrc1();
        }
        rig.step(begin + span_us - rig.plant.now());
        let taken: u64 = rig
            .frames()
            .iter()
            .filter(|(end, _)| *end > begin)
            .map(|(_, frame)| u64::from(wire::airtime(frame, rate.kbit_s.into()).occupation_us))
            .sum();
        let load = u64::from(rig.plant.bus_load(BusIndex(0), span_us).unwrap());
        let expected = taken * 1000 / span_us;
        assert!(expected > 100, "{expected}");
        // The journal has whole microseconds; the load is calculated from nanoseconds.
        assert!(load.abs_diff(expected) <= 10, "{load}, {expected}");
        // A journal that continues from a snapshot has no records from the time before the snapshot.
        let snapshot = rig.plant.snapshot();
        rig.plant.restore(&snapshot).unwrap();
        let begin = rig.plant.now();
        (0..3).for_each(|_| rig.send_wrc1());
        let passed_us = rig.plant.now() - begin;
        assert!(rig.plant.bus_load(BusIndex(0), passed_us) > Some(0));
        assert_eq!(rig.plant.bus_load(BusIndex(0), passed_us + 1), None, "the earlier frames are unknown");
    }
    let idle = Rig::new(Memory::Heap, RATES[0]);
    assert_eq!(idle.plant.bus_load(BusIndex(0), 1000), None, "no time has passed");
}
