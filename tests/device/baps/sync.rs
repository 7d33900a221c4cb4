//! Synchronization to SYNC of the network: example C of the manual (5.00005.03a p. 67-70).

use super::bench::*;
use crate::rig::{Memory, OMEGA_RATES, Rate};
use commram::devices::omega_drive_line_2::registers::{CANsync_INIT_BMSTRUCT, NODE2};
use commram::identity::{DeviceIndex, PortNumber};
use commram::plant::Power;

const LOCK_US: u64 = 10_000;

/// Returns a PLC with node 2 as the master of an empty bus. SYNC runs, and the time is that of an edge.
fn with_sync(rate: Rate, drive: &str) -> Bench {
    let mut bench = Bench::of_plant(
        Memory::Heap,
        &format!(
            "[[plc]]\nname = 'line'\nnode2 = 'bus'\n[plc.drive]\nlock_time_us = {LOCK_US}\n{drive}\n\
             [[bus]]\nname = 'bus'"
        ),
    );
    bench.start_sync(rate);
    bench.opt_init(1, 0);
    to_edge(&mut bench);
    bench
}

fn to_edge(bench: &mut Bench) {
    let edge = bench.plant.next_sync(DeviceIndex(0), PortNumber(2)).expect("SYNC runs");
    bench.plant.advance_to(edge);
}

fn status(bench: &Bench) -> (u16, u16) {
    (bench.regs.w_STATUS_REG.load(), (bench.drive().status_word() & 0x8000) >> 15)
}

#[test]
fn the_status_bits_come_after_the_lock_time() {
    for rate in OMEGA_RATES {
        let slot = rate.interval_us as u32;
        let mut bench = with_sync(rate, "");
        if slot != 2000 {
            assert_eq!(bench.write_word(167, slot as u16), 0);
            to_edge(&mut bench);
        }
        assert_eq!(status(&bench), (0, 0));
        for _ in 0..=LOCK_US.div_ceil(rate.interval_us) {
            to_edge(&mut bench);
        }
        bench.step(500);
        assert_eq!(status(&bench), (1, 1), "{rate:?}");
    }
}

#[test]
fn board_timer_a_as_trigger_signal() {
    // Example B of the manual (p. 64-66): 1 ms, SYNC slot accordingly.
    let mut bench = Bench::new(Memory::Heap, "lock_time_us = 10000");
    bench.opt_init(2, 1000);
    bench.step(20_000);
    assert_eq!(status(&bench), (0, 0), "the SYNC slot is 2 ms");
    assert_eq!(bench.write_word(167, 1000), 0);
    bench.step(12_000);
    assert_eq!(status(&bench), (1, 1));
}

#[test]
fn without_opt_init_there_is_no_trigger_signal() {
    let mut bench = with_sync(OMEGA_RATES[0], "");
    bench.plant.set_power(DeviceIndex(0), Power::Off);
    bench.plant.set_power(DeviceIndex(0), Power::On);
    bench.start_sync(OMEGA_RATES[0]);
    bench.step(50_000);
    assert_eq!(status(&bench), (0, 0));
}

#[test]
fn another_sync_slot_is_not_synchronous() {
    let mut bench = with_sync(OMEGA_RATES[0], "");
    bench.step(20_000);
    assert_eq!(status(&bench), (1, 1));
    assert_eq!(bench.write_word(167, 1000), 0);
    bench.step(20_000);
    assert_eq!(status(&bench), (0, 0));
}

#[test]
fn the_end_of_the_signal_ends_the_lock() {
    let mut bench = with_sync(OMEGA_RATES[0], "");
    bench.step(20_000);
    assert_eq!(status(&bench), (1, 1));
    let node = bench.plant.devices()[0].segment().view::<CANsync_INIT_BMSTRUCT>(NODE2).unwrap();
    node.w_CPU_CONTROL.store(0x0000);
    bench.step(5000);
    assert_eq!(status(&bench), (0, 0));
}

/// Gives a command at an edge. Returns the time from that edge to the answer.
fn answered_after(bench: &mut Bench) -> u64 {
    to_edge(bench);
    let edge = bench.plant.now();
    bench.regs.b_COMMAND.store(EXCHANGE);
    while bench.regs.b_COMMAND.load() != 0 {
        bench.step(10);
        assert!(bench.plant.now() < edge + 10_000, "no answer");
    }
    bench.plant.now() - edge
}

#[test]
fn the_offset_says_when_reference_values_are_taken_over() {
    for (offset, expected) in [(0, 2000), (300, 300), (1250, 1250), (1990, 1990)] {
        for configured_first in [false, true] {
            let mut bench = with_sync(OMEGA_RATES[0], "");
            if configured_first {
                bench.configure(0x0044, &[ADDITIONAL], &[]);
            }
            assert_eq!(bench.write_word(168, offset), 0);
            bench.step(20_000);
            assert_eq!(status(&bench), (1, 1));
            if !configured_first {
                bench.step(130);
                bench.configure(0x0044, &[ADDITIONAL], &[]);
            }
            bench.step(4000);
            assert_eq!(answered_after(&mut bench), expected, "offset {offset}, {configured_first}");
            let events = bench.events();
            bench.step(20_000);
            assert_eq!(bench.events() - events, 10);
        }
    }
}

/// A trigger signal may have another period than the SYNC slot of the drive. Each of its edges then moves the drive's
/// time slices. Slices can then follow each other within less than 0.5 ms, but a ramp still takes its full time.
#[test]
fn a_ramp_takes_its_full_time_for_any_slices() {
    let speed_behind_a_ramp = |period_us: u32| {
        let mut bench = Bench::new(Memory::Heap, "ramp_per_second = 10000");
        bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL]);
        bench.enable();
        bench.opt_init(2, period_us);
        bench.regs.a_WR_VALUE[0].store(8_000);
        bench.exchange(1);
        bench.step(200_000);
        i64::from(bench.p(SPEED_ACTUAL))
    };
    let alone = speed_behind_a_ramp(0);
    assert!((1_500..4_000).contains(&alone), "{alone}: on its way");
    let moved = speed_behind_a_ramp(1_200);
    assert!(
        (moved - alone).abs() <= 20,
        "{moved} instead of {alone}: slices of other lengths count as they are"
    );
}
