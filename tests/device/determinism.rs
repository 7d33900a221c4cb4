//! The same plant and the same register writes at the same emulated times give the same journal.

use crate::rig::{BOTH, Memory, RATES, Rig};
use commram::check::rules;
use commram::script::Bench;

const DRIVES: &str = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n\
                      [[bus.drive]]\nname = 'd2'\nslave_number = 2\nramp_per_second = 100000\n";

/// Runs handshakes and process data, with a restart in the middle. `slice_us` is the largest step in which the clock
/// advances; it must have no effect on the result.
fn run(memory: Memory, rate: crate::rig::Rate, slice_us: u64, value: u32) -> (u64, u64) {
    let mut rig = Rig::of(memory, rate, DRIVES);
    let pass = |rig: &mut Rig, us: u64| {
        let end = rig.plant.now() + us;
        while rig.plant.now() < end {
            rig.step(slice_us.min(end - rig.plant.now()));
        }
    };
    rig.set_up();
    pass(&mut rig, 60_000);
    rig.configure_wrc1([0x01, 0x03, 0x05, 0x07]);
    rig.master.b_MAX_SL_NR.store(2);
    rig.master.b_CTRLREG_RD_ORDER_RDC1.store(0x80);
    rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x01);
    rig.master.w_CPU_CONTROL.store(0x0040);
    rig.slave.w_CPU_CONTROL.store(0x0040);
    for round in 0..40u32 {
        rig.master.a_WR_VALUE[0].store(value.wrapping_mul(round));
        rig.master.b_CTRLREG_WRC1.store(0x05);
        rig.slave.a_RD_VALUE_SEND[0].store(round);
        rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
        pass(&mut rig, rate.interval_us - 137);
    }
    rig.master.w_CPU_CONTROL.store(0x0000);
    pass(&mut rig, 10_000);
    let journal = rig.plant.journal();
    (journal.hash(), journal.written())
}

#[test]
fn equal_runs_have_equal_journals_on_both_memories_in_any_slices() {
    for rate in RATES {
        let (hash, written) = run(Memory::Heap, rate, u64::MAX, 3);
        assert!(written > 200, "{written} records: the run did not get going");
        for memory in BOTH {
            for slice_us in [u64::MAX, 1000, 333] {
                assert_eq!(
                    run(memory, rate, slice_us, 3),
                    (hash, written),
                    "{memory:?}, slices of {slice_us} us"
                );
            }
        }
        assert_ne!(run(Memory::Heap, rate, u64::MAX, 4).0, hash, "other values, other journal");
    }
}

/// A controller takes the return of its supply in a processor cycle, and not at the beginning of a step.
#[test]
fn a_supply_that_returns_is_noticed_at_the_same_time_in_any_slices() {
    const PLANT: &str = "[[device]]\nkind = 'cs0015'\nname = 'panel'\nbus = 'open'\nnode_id = 32\nkbit_s = 125\n\
                         [[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\n";
    let run = |steps: &[&str]| {
        let mut bench = Bench::plant(PLANT).unwrap();
        bench.step("300744us").unwrap();
        bench.fault("supply plc=panel what=drop duration=10ms").unwrap();
        steps.iter().for_each(|step| bench.step(*step).unwrap());
        let lines = bench.last_entries(10).unwrap();
        (bench.journal_hash(), lines.into_iter().map(|line| line.text).collect::<Vec<_>>())
    };
    let (hash, lines) = run(&["11045us"]);
    assert!(lines.iter().any(|line| line.contains("0.311000") && line.ends_with(" on")), "{lines:#?}");
    assert_eq!(run(&["10045us", "1000us"]), (hash, lines));
}

/// A program may write `w_CANsync_STATUS`, which the firmware refreshes in every processor cycle (manual 5.00005.03a p.
/// 150): the time at which the firmware replaces the program's value does not depend on the length of the steps.
#[test]
fn a_store_to_the_status_is_replaced_at_the_same_time_in_any_slices() {
    let run = |slice_us: u64, is_set_up: bool, value: u16| {
        let mut rig = Rig::of(Memory::Heap, RATES[0], DRIVES);
        if is_set_up {
            rig.set_up();
        }
        rig.tolerate_errors(&[&rules::OWNER]);
        rig.step(5_000);
        rig.master.w_CANsync_STATUS.store(value);
        rig.slave.w_CANsync_STATUS.store(value);
        (0..6_000 / slice_us).for_each(|_| rig.step(slice_us));
        rig.plant.journal().hash()
    };
    for (is_set_up, value) in [(false, 0x229B), (false, 0x0080), (true, 0x229B), (true, 0x0000)] {
        let whole = run(6_000, is_set_up, value);
        for slice_us in [100, 500, 750] {
            assert_eq!(run(slice_us, is_set_up, value), whole, "{is_set_up}, 16#{value:04X}, {slice_us} us");
        }
    }
}

/// Hashes of the journals. Debug and release builds have the same journals on every machine.
/// Renew them after a change of the firmware's behaviour or of the journal's records.
const KEPT: &str = include_str!("journals.txt");

#[test]
fn journals_are_those_that_are_kept() {
    let found: Vec<_> = RATES
        .iter()
        .map(|rate| {
            let (hash, written) = run(Memory::Heap, *rate, u64::MAX, 3);
            format!("{rate:?}: {written} records, 16#{hash:016X}\n")
        })
        .collect();
    assert_eq!(
        found.concat(),
        KEPT,
        "the left ones belong into tests/device/journals.txt, if the change is meant"
    );
}
