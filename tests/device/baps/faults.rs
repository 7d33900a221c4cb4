//! A drive that does nothing at the BAPS (`baps_silent`), or does it late (`baps_slow`): D-310.

use super::bench::*;
use crate::rig::Memory;
use commram::identity::DeviceIndex;

/// Configuration with a cycle time t_cycK of 2 ms.
const EVERY_2_MS: u16 = 0x0044;

/// Returns the times of the communications within `us`, checked every 500 us.
fn communications(bench: &mut Bench, us: u64) -> Vec<u64> {
    let mut times = Vec::new();
    for _ in 0..us / 500 {
        let before = bench.events();
        bench.step(500);
        if bench.events() != before {
            times.push(bench.plant.now());
        }
    }
    times
}

fn hits(bench: &Bench) -> Option<u32> {
    bench.plant.faults().next().map(|fault| fault.hits)
}

#[test]
fn a_silent_drive_goes_on_but_exchanges_nothing() {
    Bench::on_both("", |mut bench| {
        bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL]);
        bench.regs.a_WR_VALUE[0].store(1000);
        bench.enable();
        bench.exchange(2);
        let (events, angle) = (bench.events(), bench.p(303));
        bench.fault("baps_silent", &["duration=10ms"]);
        bench.regs.a_WR_VALUE[0].store(0);
        bench.regs.b_COMMAND.store(EXCHANGE);
        bench.step(9500);
        assert_eq!((bench.events(), bench.regs.b_COMMAND.load()), (events, EXCHANGE));
        assert_eq!(bench.p(303).wrapping_sub(angle), 9500, "it turns by its last reference value");
        bench.step(1000);
        assert_eq!(
            (bench.regs.b_COMMAND.load(), bench.p(SPEED_REFERENCE)),
            (0, 0),
            "then it takes the new one"
        );
    });
}

#[test]
fn a_hit_is_a_communication_that_is_left_out_and_the_others_keep_their_times() {
    let mut bench = Bench::new(Memory::Heap, "");
    bench.configure(EVERY_2_MS, &[], &[]);
    let first = communications(&mut bench, 2000)[0];
    bench.fault("baps_silent", &["count=3"]);
    assert_eq!(communications(&mut bench, 12_000), [4, 5, 6].map(|n| first + n * 2000));
    assert_eq!(hits(&bench), None, "it is over");
}

#[test]
fn a_command_waits_and_each_slice_is_a_hit() {
    let mut bench = Bench::new(Memory::Heap, "");
    bench.fault("baps_silent", &["count=4"]);
    bench.step(10_000);
    assert_eq!(hits(&bench), Some(0), "there is nothing to do");
    bench.regs.w_COMMAND_REG.store(SAME_CYCLE);
    bench.regs.b_COMMAND.store(CONFIGURE);
    bench.step(2000);
    assert_eq!((bench.regs.b_COMMAND.load(), hits(&bench)), (CONFIGURE, None), "four slices");
    bench.step(500);
    assert_eq!((bench.regs.b_COMMAND.load(), bench.regs.b_SL_QUIT.load()), (0, 0x02));
}

#[test]
fn a_slow_drive_answers_late_and_its_communications_come_late() {
    let mut bench = Bench::new(Memory::Heap, "");
    // The first slice that begins after this delay is 1500 us late.
    let number = bench.fault("baps_slow", &["delay=1300us"]);
    bench.regs.w_COMMAND_REG.store(EVERY_2_MS);
    bench.regs.b_COMMAND.store(CONFIGURE);
    bench.step(1900);
    assert_eq!((bench.regs.b_COMMAND.load(), hits(&bench)), (CONFIGURE, Some(1)));
    bench.step(100);
    assert_eq!((bench.regs.b_SL_QUIT.load(), hits(&bench)), (0x02, Some(1)));
    let configured = bench.plant.now();
    let late = [1, 2, 3].map(|n| configured + n * 2000 + 1500);
    assert_eq!(communications(&mut bench, 8000), late, "each late, none lost");
    assert_eq!(hits(&bench), Some(5), "the fourth is under way");
    bench.plant.clear_fault(number).unwrap();
    bench.step(1500);
    let times = communications(&mut bench, 6000);
    assert_eq!(times, [5, 6, 7].map(|n| configured + n * 2000), "back in time");
}

#[test]
fn communications_that_fall_due_meanwhile_become_one() {
    let mut bench = Bench::new(Memory::Heap, "");
    bench.configure(SAME_CYCLE, &[], &[]);
    bench.fault("baps_slow", &["delay=3ms"]);
    // Each communication is 3 ms late. The regular time of the next communication is 500 us after the delayed one.
    assert_eq!(communications(&mut bench, 14_000).len(), 4);
}

#[test]
fn each_step_of_a_job_is_late() {
    let mut bench = Bench::new(Memory::Heap, "service_time_us = 2000");
    bench.fault("baps_slow", &["delay=5ms"]);
    bench.regs.b_JOB.store(1);
    bench.regs.u_PAR_NR.store(167);
    bench.regs.us_PAR_ELEMENT.store(7);
    bench.regs.b_MA_SEMAPHORE.store(1);
    bench.step(500 + 5000 + 2000 + 4500);
    assert_eq!(bench.regs.b_SL_SEMAPHORE.load(), 0);
    bench.step(500);
    assert_eq!((bench.regs.b_SL_SEMAPHORE.load(), bench.regs.ud_PAR_VALUE.load()), (1, 2000));
    bench.regs.b_MA_SEMAPHORE.store(0);
    bench.step(5000);
    assert_eq!(bench.regs.b_SL_SEMAPHORE.load(), 1);
    bench.step(500);
    assert_eq!((bench.regs.b_SL_SEMAPHORE.load(), hits(&bench)), (0, Some(3)));
}

/// A request that the PLC withdraws while the drive is late is not executed, and the next request is late again.
#[test]
fn a_withdrawn_request_is_forgotten() {
    let mut bench = Bench::new(Memory::Heap, "");
    bench.fault("baps_slow", &["delay=5ms"]);
    bench.regs.w_COMMAND_REG.store(SAME_CYCLE);
    bench.regs.b_COMMAND.store(CONFIGURE);
    bench.step(3000);
    bench.regs.b_COMMAND.store(0);
    bench.step(20_000);
    assert_eq!((bench.regs.b_SL_QUIT.load(), hits(&bench)), (0x00, Some(1)));
    bench.regs.b_COMMAND.store(CONFIGURE);
    bench.step(5000);
    assert_eq!(bench.regs.b_COMMAND.load(), CONFIGURE);
    bench.step(500);
    assert_eq!((bench.regs.b_SL_QUIT.load(), hits(&bench)), (0x02, Some(2)));
}

#[test]
fn a_silent_drive_is_not_slow_and_the_longest_delay_counts() {
    let mut bench = Bench::new(Memory::Heap, "");
    bench.fault("baps_slow", &["delay=1ms"]);
    bench.fault("baps_slow", &["delay=2ms"]);
    let silent = bench.fault("baps_silent", &[]);
    bench.regs.w_COMMAND_REG.store(SAME_CYCLE);
    bench.regs.b_COMMAND.store(CONFIGURE);
    bench.step(5000);
    let all = |bench: &Bench| bench.plant.faults().map(|fault| fault.hits).collect::<Vec<_>>();
    assert_eq!(all(&bench), [0, 0, 10]);
    bench.plant.clear_fault(silent).unwrap();
    bench.step(2000);
    assert_eq!((bench.regs.b_COMMAND.load(), all(&bench)), (CONFIGURE, vec![1, 1]));
    bench.step(500);
    assert_eq!(bench.regs.b_SL_QUIT.load(), 0x02);
}

/// RESET of the board ends the late action of the drive.
#[test]
fn reset_discards_late_answers() {
    use commram::plant::Power;
    let mut bench = Bench::new(Memory::Heap, "");
    bench.fault("baps_slow", &["delay=5ms"]);
    bench.regs.w_COMMAND_REG.store(SAME_CYCLE);
    bench.regs.b_COMMAND.store(CONFIGURE);
    bench.step(3000);
    bench.plant.set_power(DeviceIndex(0), Power::HoldReset);
    bench.plant.set_power(DeviceIndex(0), Power::ReleaseReset);
    bench.step(20_000);
    assert_eq!((bench.regs.b_SL_QUIT.load(), hits(&bench)), (0x00, Some(1)));
}

/// Without a program that uses the BAPS there are no slices; a fault of the drive still begins and ends.
#[test]
fn an_unused_drive_can_have_a_fault() {
    let mut bench = Bench::new(Memory::Heap, "");
    bench.step(5_000);
    bench.trip(17);
    bench.step(5_000);
    assert_eq!((bench.drive().status_word() & 0x004F, bench.p(308)), (0x0008, 17));
}
