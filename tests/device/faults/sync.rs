//! Lost and moved SYNC edges.

use super::*;
use crate::rig::{BOTH, FASTEST, Memory, NodePlace, RATES};
use commram::devices::cansync;
use commram::devices::cansync::bus::drives;
use commram::devices::cansync::drive::DrivecomState;
use commram::identity::DeviceIndex;

fn edges(rig: &Rig) -> Vec<u64> {
    let (noted, pending) = (rig.records(), rig.plant.journal().pending());
    let mut times: Vec<u64> =
        noted.chain(pending).filter(|r| r.event.is::<SyncEdge>()).flat_map(|r| r.times()).collect();
    times.sort_unstable();
    times
}

fn is_locked(rig: &Rig) -> bool {
    drives(rig.plant.buses()).next().unwrap().is_synchronized()
}

/// The first drive goes on turning by 1000 increments in each millisecond.
fn turns_on(rig: &mut Rig) {
    let position = |rig: &Rig| drives(rig.plant.buses()).next().unwrap().parameter(303).unwrap();
    let before = position(rig);
    rig.step(20_000);
    assert_eq!(position(rig).wrapping_sub(before), 20 * 1000);
}

/// Manual 5.00005.03a p. 135: the slave runs through the next interval; at most its actual value frame is missing.
#[test]
fn one_lost_edge_ends_no_lock() {
    for (rate, memory) in FASTEST.into_iter().flat_map(|rate| BOTH.map(|memory| (rate, memory))) {
        let mut rig = running(memory, rate);
        assert!(is_locked(&rig));
        let counter = |rig: &Rig, at: NodePlace| {
            let segment = rig.plant.devices()[at.plc].segment();
            segment.header().unwrap().sync_counter[at.port.index()].load()
        };
        let (master_at, slave_at) = (rig.master_at, rig.slave_at);
        let (master, slave) = (counter(&rig, master_at), counter(&rig, slave_at));
        let position = |rig: &Rig| drives(rig.plant.buses()).next().unwrap().parameter(303);
        rig.master.a_WR_VALUE[0].store(1000);
        rig.send_wrc1();
        rig.send_wrc1();
        let before = position(&rig);
        add(&mut rig, "kind = 'lose_sync'\ncount = 1");
        rig.send_wrc1();
        assert_eq!(counter(&rig, master_at), master + 3, "the master makes the edge");
        assert_eq!(counter(&rig, slave_at), slave + 2, "the slave does not see it");
        assert_ne!(position(&rig), before, "the drive moves on");
        rig.slave.b_CTRLREG_WRC1.store(0);
        rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
        let frames = rig.frames().len();
        rig.send_wrc1();
        assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0x02, "the interval is run through");
        assert_eq!(
            rig.slave.b_CTRLREG_RD_RDC1.load(),
            0x05,
            "nothing is built that could not go out in time"
        );
        assert!(
            rig.frames()[frames..].iter().all(|(_, frame)| frame.id() != 0x301),
            "nor does the drive send"
        );
        assert!(is_locked(&rig));
        rig.send_wrc1();
        assert_eq!(rig.slave.b_CTRLREG_RD_RDC1.load(), 0x04);
        assert!(rig.last_frame(0x301..=0x301).is_some(), "everything as before");
        assert_eq!(hits(&rig), [0]);
    }
}

/// Manual p. 135: the lock is lost only after a settable time without SYNC, here two and a half intervals.
#[test]
fn edges_lost_in_succession_end_the_lock() {
    for (rate, memory) in FASTEST.into_iter().flat_map(|rate| BOTH.map(|memory| (rate, memory))) {
        let mut rig = running(memory, rate);
        add(&mut rig, "kind = 'lose_sync'\ncount = 2");
        rig.run_to_sync();
        rig.run_to_sync();
        rig.slave.b_CTRLREG_WRC1.store(0);
        rig.master.b_CTRLREG_WRC1.store(0x05);
        rig.step(rate.interval_us / 2 - 1);
        assert!(is_locked(&rig), "two and a half intervals after the last edge, but for 1 us");
        rig.step(1);
        assert!(!is_locked(&rig));
        rig.run_to_sync();
        assert_eq!(
            rig.slave.b_CTRLREG_WRC1.load(),
            0,
            "the second one in succession is no interval for the node"
        );
        rig.step(40_000);
        assert!(is_locked(&rig), "locks again by itself");
    }
}

#[test]
fn the_time_without_sync_can_be_set() {
    for rate in FASTEST {
        let least = rate.interval_us * 9 / 4;
        let drive = |n, key: &str| {
            format!("[[bus.drive]]\nname = 'd{n}'\nslave_number = {n}\nlock_time_us = 30000\n{key}\n")
        };
        let described = drive(1, &format!("sync_loss_us = {}", 2 * least)) + &drive(2, "sync_loss_us = 1");
        let mut rig = Rig::of(Memory::Heap, rate, &described);
        start(&mut rig);
        add(&mut rig, "kind = 'lose_sync'");
        let locked = |rig: &Rig| -> Vec<bool> {
            drives(rig.plant.buses()).map(|drive| drive.is_synchronized()).collect()
        };
        for (us, expected) in
            [(least - 1, [true, true]), (1, [true, false]), (least - 1, [true, false]), (1, [false, false])]
        {
            rig.step(us);
            assert_eq!(locked(&rig), expected, "at least two and a quarter intervals");
        }
    }
}

/// Manual p. 134-135: the drives continue when their master stops, and notice this.
#[test]
fn drives_of_a_restarted_master_lose_their_lock_in_time() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        rig.master.a_WR_VALUE[0].store(1000);
        rig.send_wrc1();
        rig.run_to_sync();
        rig.master.w_CPU_CONTROL.store(0x0000);
        rig.step(500);
        assert_eq!(rig.next_sync(), None);
        rig.step(rate.interval_us * 5 / 2 - 501);
        assert!(is_locked(&rig));
        rig.step(1);
        assert!(!is_locked(&rig));
        turns_on(&mut rig);
    }
}

/// The drives also continue if a fault has removed the last edge before the stop of the master.
#[test]
fn drives_run_on_after_a_lost_edge() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        rig.master.a_WR_VALUE[0].store(1000);
        rig.send_wrc1();
        rig.send_wrc1();
        add(&mut rig, "kind = 'lose_sync'\ncount = 1");
        rig.step(rate.interval_us);
        assert_eq!(hits(&rig), [0]);
        rig.master.w_CPU_CONTROL.store(0x0000);
        rig.step(10_000);
        turns_on(&mut rig);
    }
}

#[test]
fn set_up_mode_shows_the_lost_lock() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        rig.set_up();
        rig.step(60_000);
        assert_eq!([0, 1].map(|n| rig.master.a_STAT_SL[n].load()), [0x03, 0x03]);
        add(&mut rig, "kind = 'lose_sync'\nduration_us = 7000");
        rig.step(20_000);
        assert_eq!(
            [0, 1].map(|n| rig.master.a_STAT_SL[n].load()),
            [0x01, 0x01],
            "responding, not synchronized"
        );
    }
}

/// Decision D-125: the edges are late and early alternately.
#[test]
fn jitter_moves_edges_about_their_regular_times() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let start = rig.plant.now();
        add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 20\ncount = 4");
        intervals(&mut rig, 7);
        let moved: Vec<i64> = edges(&rig)
            .into_iter()
            .filter(|time| *time > start)
            .enumerate()
            .map(|(n, time)| (time - start) as i64 - rate.interval_us as i64 * (n as i64 + 1))
            .collect();
        assert_eq!(moved, [0, 20, -20, 20, -20, 0, 0], "the edge that was already due comes in time");
        assert_eq!(hits(&rig), [20, -20, 20, -20]);
        assert!(is_locked(&rig), "a few microseconds do no harm");
    }
}

/// Decision D-125.
#[test]
fn much_jitter_hinders_locking_but_does_not_end_a_lock() {
    for rate in FASTEST {
        // Edges are late and early alternately, so their distance differs from an interval by more than a quarter.
        let much = format!("kind = 'jitter_sync'\namplitude_us = {}", rate.interval_us * 13 / 100);
        let mut rig = running(Memory::Heap, rate);
        add(&mut rig, &format!("{much}\nduration_us = 20000"));
        rig.step(20_000);
        assert!(is_locked(&rig), "every second edge is in time");
        rig.step(10_000);
        add(&mut rig, "kind = 'lose_sync'\ncount = 3");
        rig.step(10_000);
        assert!(!is_locked(&rig));
        add(&mut rig, &format!("{much}\nduration_us = 60000"));
        rig.step(60_000);
        assert!(!is_locked(&rig));
        rig.step(40_000);
        assert!(is_locked(&rig));
    }
}

#[test]
fn the_largest_jitter_is_a_quarter_of_the_interval() {
    for rate in FASTEST {
        let interval = rate.interval_us;
        let mut rig = running(Memory::Heap, rate);
        add(
            &mut rig,
            &format!("kind = 'jitter_sync'\namplitude_us = {interval}\nduration_us = {}", 100 * interval),
        );
        for _ in 0..100 {
            rig.master.b_CTRLREG_WRC1.store(0x05);
            rig.run_to_sync();
        }
        assert!(
            edges(&rig)
                .windows(2)
                .all(|pair| (interval / 4..=interval * 7 / 4).contains(&(pair[1] - pair[0])))
        );
        assert!(hits(&rig).iter().all(|shift| shift.abs() == interval as i32 / 4));
    }
}

/// Each edge is shifted by itself. The shifts must not add up.
#[test]
fn edges_return_to_their_regular_times() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let start = rig.plant.now();
        let id = add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 33");
        intervals(&mut rig, 5);
        rig.plant.clear_fault(id).unwrap();
        intervals(&mut rig, 3);
        assert_eq!((rig.plant.now() - start) % rate.interval_us, 0);
    }
}

/// Manual p. 135; D-293, D-294: the axis of a drive that has lost its master stops turning.
#[test]
fn a_drive_without_sync_reacts_as_it_is_set() {
    for rate in FASTEST {
        let monitoring = "[bus.drive.monitoring.sync]\ntime_us = 100000\nreaction = 'quick_stop'\n";
        let mut rig = Rig::of(Memory::Heap, rate, &format!("{DRIVES}{monitoring}"));
        start(&mut rig);
        rig.master.a_WR_VALUE[0].store(1000);
        rig.send_wrc1();
        rig.run_to_sync();
        rig.master.w_CPU_CONTROL.store(0x0000);
        let recorded = |rig: &Rig| -> Vec<_> {
            drives(rig.plant.buses())
                .map(|drive| (drive.state(), drive.status_word(), drive.parameter(308).unwrap()))
                .collect()
        };
        // The lock is lost two and a half intervals after the last edge.
        rig.step(100_000 + 2 * rate.interval_us);
        let moving = (DrivecomState::OperationEnabled, 0x00B7, 501);
        assert_eq!(
            recorded(&rig),
            [moving, (DrivecomState::OperationEnabled, 0x0037, 0)],
            "the first has no reaction"
        );
        rig.step(3_000);
        assert_eq!(recorded(&rig), [moving, (DrivecomState::Fault, 0x0018, 501)]);
    }
}

/// 5.01010.01 p. 13; D-291.
#[test]
fn a_sync_slot_of_another_rate_is_found_and_hinders_locking() {
    for rate in RATES {
        let drive = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n";
        let other = rate.interval_us as u32 / 2;
        let mut rig = Rig::of(Memory::Heap, rate, drive);
        rig.expect_errors(&[&cansync::rules::DRIVE_SYNC_SLOT]);
        rig.activate();
        rig.step(60_000);
        assert!(is_locked(&rig), "as its slot is set at power-on");
        enter_parameter(&rig, DRIVE, 0x05, 167, other);
        rig.step(20_000);
        assert_eq!((parameter(&rig, DRIVE).0, is_locked(&rig)), (0x04, false));
        let findings: Vec<_> =
            rig.plant.journal().findings().iter().map(|entry| (entry.last, entry.count)).collect();
        assert_eq!(findings.len(), 1);
        assert_eq!(
            (findings[0].0.rule, findings[0].0.value, findings[0].1),
            (&cansync::rules::DRIVE_SYNC_SLOT, other, 1)
        );
        let port = rate.kind.layout.ports.iter().find(|port| port.number == rig.master_at.port).unwrap().name;
        let name = format!("{port}.a_DATA_PARAMETER[1].d_PAR_VALUE");
        assert_eq!(findings[0].0.name(rig.plant.names().device(DeviceIndex(0))), Some(name));
        enter_parameter(&rig, DRIVE, 0x05, 167, rate.interval_us as u32);
        rig.step(80_000);
        assert!(is_locked(&rig));
    }
}
