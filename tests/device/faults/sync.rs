//! Lost and moved SYNC edges.

use super::*;
use crate::rig::{BOTH, Memory};

fn edges(rig: &Rig) -> Vec<u64> {
    let (noted, pending) = (rig.records(), rig.plant.journal().pending());
    let mut times: Vec<u64> = noted
        .chain(&pending)
        .filter(|r| matches!(r.event, Event::SyncEdge { .. }))
        .flat_map(|r| r.times())
        .collect();
    times.sort_unstable();
    times
}

fn is_locked(rig: &Rig) -> bool {
    rig.plant.drives().next().unwrap().is_synchronized()
}

/// D-124, D-07.
#[test]
fn a_lost_edge_unlocks_the_slaves_and_the_interval_of_a_node_is_none() {
    for memory in BOTH {
        let mut rig = running(memory);
        assert!(is_locked(&rig));
        let counter = |rig: &Rig, plc: usize, node: usize| {
            rig.plant.plcs()[plc].segment().header().unwrap().sync_counter[node].load()
        };
        let (master, slave) = (counter(&rig, 0, 1), counter(&rig, 1, 0));
        add(&mut rig, "kind = 'lose_sync'\ncount = 1");
        rig.run_to_sync();
        assert_eq!(counter(&rig, 0, 1), master + 1, "the master makes the edge");
        assert_eq!(counter(&rig, 1, 0), slave, "the slave does not see it");
        rig.slave.b_CTRLREG_WRC1.store(0);
        rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
        rig.send_wrc1();
        assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0);
        assert_eq!(rig.slave.b_CTRLREG_RD_RDC1.load(), 0x05, "no deadline without interval");
        assert!(!is_locked(&rig), "two intervals between edges");
        rig.step(40_000);
        assert!(is_locked(&rig), "locks anew by itself");
        assert_eq!(hits(&rig), [0]);
    }
}

#[test]
fn set_up_mode_shows_the_lost_lock() {
    let mut rig = Rig::of(Memory::Heap, RATES[0], DRIVES);
    rig.set_up();
    rig.step(60_000);
    assert_eq!([0, 1].map(|n| rig.master.a_STAT_SL[n].load()), [0x03, 0x03]);
    add(&mut rig, "kind = 'lose_sync'\nduration_us = 3000");
    rig.step(12_000);
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

#[test]
fn much_jitter_unlocks() {
    let mut rig = running(Memory::Heap);
    let id = add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 250");
    intervals(&mut rig, 10);
    assert!(is_locked(&rig), "early by a quarter of an interval at most");
    rig.plant.clear_fault(id).unwrap();
    add(&mut rig, "kind = 'jitter_sync'\namplitude_us = 260\nduration_us = 20000");
    intervals(&mut rig, 10);
    assert!(!is_locked(&rig));
    rig.step(60_000);
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
