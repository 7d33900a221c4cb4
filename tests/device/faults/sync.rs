//! Lost and moved SYNC edges.

use super::*;
use crate::rig::{BOTH, Memory};
use commram::devices::cansync;
use commram::devices::cansync::drive::State;

fn edges(rig: &Rig) -> Vec<u64> {
    let (noted, pending) = (rig.records(), rig.plant.journal().pending());
    let mut times: Vec<u64> =
        noted.chain(&pending).filter(|r| r.event.is::<SyncEdge>()).flat_map(|r| r.times()).collect();
    times.sort_unstable();
    times
}

fn is_locked(rig: &Rig) -> bool {
    rig.plant.drives().next().unwrap().is_synchronized()
}

/// Manual 5.00005.03a p. 135: the next interval is run through, at most its actual value frame is missing.
#[test]
fn one_lost_edge_ends_no_lock() {
    for memory in BOTH {
        let mut rig = running(memory);
        assert!(is_locked(&rig));
        let counter = |rig: &Rig, plc: usize, node: usize| {
            rig.plant.devices()[plc].segment().header().unwrap().sync_counter[node].load()
        };
        let (master, slave) = (counter(&rig, 0, 1), counter(&rig, 1, 0));
        let position = |rig: &Rig| rig.plant.drives().next().unwrap().parameter(303);
        rig.master.a_WR_VALUE[0].store(1000);
        rig.send_wrc1();
        rig.send_wrc1();
        let before = position(&rig);
        add(&mut rig, "kind = 'lose_sync'\ncount = 1");
        rig.send_wrc1();
        assert_eq!(counter(&rig, 0, 1), master + 3, "the master makes the edge");
        assert_eq!(counter(&rig, 1, 0), slave + 2, "the slave does not see it");
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

/// P. 135: only after a settable time without SYNC; two and a half intervals here.
#[test]
fn edges_lost_in_succession_end_the_lock() {
    for memory in BOTH {
        let mut rig = running(memory);
        add(&mut rig, "kind = 'lose_sync'\ncount = 2");
        rig.run_to_sync();
        rig.run_to_sync();
        rig.slave.b_CTRLREG_WRC1.store(0);
        rig.master.b_CTRLREG_WRC1.store(0x05);
        rig.step(999);
        assert!(is_locked(&rig), "4.999 ms after the last edge");
        rig.step(1);
        assert!(!is_locked(&rig));
        rig.run_to_sync();
        assert_eq!(
            rig.slave.b_CTRLREG_WRC1.load(),
            0,
            "the second one in succession is no interval for the node"
        );
        rig.step(40_000);
        assert!(is_locked(&rig), "locks anew by itself");
    }
}

#[test]
fn the_time_without_sync_can_be_set() {
    let drive =
        |n, key| format!("[[bus.drive]]\nname = 'd{n}'\nslave_number = {n}\nlock_time_us = 30000\n{key}\n");
    let drives = drive(1, "sync_loss_us = 9000") + &drive(2, "sync_loss_us = 1");
    let mut rig = Rig::of(Memory::Heap, OMEGA_RATES[0], &drives);
    start(&mut rig);
    add(&mut rig, "kind = 'lose_sync'");
    let locked =
        |rig: &Rig| -> Vec<bool> { rig.plant.drives().map(|drive| drive.is_synchronized()).collect() };
    for (us, expected) in
        [(4_499, [true, true]), (1, [true, false]), (4_499, [true, false]), (1, [false, false])]
    {
        rig.step(us);
        assert_eq!(locked(&rig), expected, "at least two and a quarter intervals");
    }
}

/// P. 134-135: the drives run on when their master is gone, and notice it.
#[test]
fn drives_whose_master_is_restarted_lose_their_lock_in_time() {
    let mut rig = running(Memory::Heap);
    rig.master.a_WR_VALUE[0].store(1000);
    rig.send_wrc1();
    rig.run_to_sync();
    let position = |rig: &Rig| rig.plant.drives().next().unwrap().parameter(303).unwrap();
    rig.master.w_CPU_CONTROL.store(0x0000);
    rig.step(500);
    assert_eq!(rig.plant.next_sync(0, 2), None);
    rig.step(4_499);
    assert!(is_locked(&rig));
    rig.step(1);
    assert!(!is_locked(&rig));
    let before = position(&rig);
    rig.step(20_000);
    assert_eq!(position(&rig).wrapping_sub(before), 20 * 1000, "1000 increments in each millisecond");
}

#[test]
fn set_up_mode_shows_the_lost_lock() {
    let mut rig = Rig::of(Memory::Heap, OMEGA_RATES[0], DRIVES);
    rig.set_up();
    rig.step(60_000);
    assert_eq!([0, 1].map(|n| rig.master.a_STAT_SL[n].load()), [0x03, 0x03]);
    add(&mut rig, "kind = 'lose_sync'\nduration_us = 7000");
    rig.step(20_000);
    assert_eq!([0, 1].map(|n| rig.master.a_STAT_SL[n].load()), [0x01, 0x01], "responding, not synchronized");
}

/// D-125: late and early in turn.
#[test]
fn jitter_moves_edges_about_their_regular_times() {
    let mut rig = running(Memory::Heap);
    let start = rig.plant.now();
    add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 20\ncount = 4");
    intervals(&mut rig, 7);
    let moved: Vec<i64> = edges(&rig)
        .into_iter()
        .filter(|time| *time > start)
        .enumerate()
        .map(|(n, time)| (time - start) as i64 - 2000 * (n as i64 + 1))
        .collect();
    assert_eq!(moved, [0, 20, -20, 20, -20, 0, 0], "the edge that was already due comes in time");
    assert_eq!(hits(&rig), [20, -20, 20, -20]);
    assert!(is_locked(&rig), "a few microseconds do no harm");
}

/// D-125.
#[test]
fn much_jitter_hinders_locking_but_does_not_end_a_lock() {
    let mut rig = running(Memory::Heap);
    add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 260\nduration_us = 20000");
    intervals(&mut rig, 10);
    assert!(is_locked(&rig), "every second edge is in time");
    rig.step(10_000);
    add(&mut rig, "kind = 'lose_sync'\ncount = 3");
    rig.step(10_000);
    assert!(!is_locked(&rig));
    add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 260\nduration_us = 60000");
    rig.step(60_000);
    assert!(!is_locked(&rig));
    rig.step(40_000);
    assert!(is_locked(&rig));
}

#[test]
fn the_largest_jitter_is_a_quarter_of_the_interval() {
    let mut rig = running(Memory::Heap);
    add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 2000\nduration_us = 200000");
    for _ in 0..100 {
        rig.master.b_CTRLREG_WRC1.store(0x05);
        rig.run_to_sync();
    }
    assert!(edges(&rig).windows(2).all(|pair| (500..=3500).contains(&(pair[1] - pair[0]))));
    assert!(hits(&rig).iter().all(|shift| shift.abs() == 500));
}

/// The shift must not grow into a drift.
#[test]
fn edges_return_to_their_regular_times() {
    let mut rig = running(Memory::Heap);
    let start = rig.plant.now();
    let id = add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 33");
    intervals(&mut rig, 5);
    rig.plant.clear_fault(id).unwrap();
    intervals(&mut rig, 3);
    assert_eq!((rig.plant.now() - start) % 2000, 0);
}

/// P. 135; D-293, D-294: the axis of a drive whose master has gone does not turn for ever.
#[test]
fn a_drive_without_sync_reacts_as_it_is_set() {
    let monitoring = "[bus.drive.monitoring.sync]\ntime_us = 100000\nreaction = 'quick_stop'\n";
    let mut rig = Rig::of(Memory::Heap, OMEGA_RATES[0], &format!("{DRIVES}{monitoring}"));
    start(&mut rig);
    rig.master.a_WR_VALUE[0].store(1000);
    rig.send_wrc1();
    rig.run_to_sync();
    rig.master.w_CPU_CONTROL.store(0x0000);
    let drives = |rig: &Rig| -> Vec<_> {
        rig.plant
            .drives()
            .map(|drive| (drive.state(), drive.status_word(), drive.parameter(308).unwrap()))
            .collect()
    };
    rig.step(104_000);
    let moving = (State::OperationEnabled, 0x00B7, 501);
    assert_eq!(drives(&rig), [moving, (State::OperationEnabled, 0x0037, 0)], "the first has no reaction");
    rig.step(3_000);
    assert_eq!(drives(&rig), [moving, (State::Fault, 0x0018, 501)]);
}

/// 5.01010.01 p. 13; D-291.
#[test]
fn a_sync_slot_of_another_rate_is_found_and_hinders_locking() {
    let drive = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n";
    let mut rig = Rig::of(Memory::Heap, OMEGA_RATES[1], drive);
    rig.expect_errors(&[&cansync::rules::DRIVE_SYNC_SLOT]);
    rig.activate();
    rig.step(60_000);
    assert!(is_locked(&rig), "4000 at 250 kbit/s");
    enter_parameter(&rig, DRIVE, 0x05, 167, 2000);
    rig.step(20_000);
    assert_eq!((parameter(&rig, DRIVE).0, is_locked(&rig)), (0x04, false));
    let findings: Vec<_> =
        rig.plant.journal().findings().iter().map(|entry| (entry.last, entry.count)).collect();
    assert_eq!(findings.len(), 1);
    assert_eq!(
        (findings[0].0.rule, findings[0].0.value, findings[0].1),
        (&cansync::rules::DRIVE_SYNC_SLOT, 2000, 1)
    );
    assert_eq!(
        findings[0].0.name(&commram::devices::omega_drive_line_2::registers::DEVICE).as_deref(),
        Some("node2.a_DATA_PARAMETER[1].d_PAR_VALUE")
    );
    enter_parameter(&rig, DRIVE, 0x05, 167, 4000);
    rig.step(80_000);
    assert!(is_locked(&rig));
}
