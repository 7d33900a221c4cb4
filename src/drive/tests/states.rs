//! SYNC, control word and motion.

use super::*;
use std::num::NonZeroU32;

#[test]
fn bit_15_comes_after_the_lock_time() {
    let mut bench = Bench::new(&DriveConfig { lock_time_us: 10_000, ..demo() });
    bench.edge().edge();
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, true));
    let states: Vec<u16> = (0..6).map(|_| bench.edge().drive.status_word()).collect();
    assert_eq!(states, [0x0037, 0x0037, 0x0037, 0x0037, 0x0037, 0x8037]);
    assert_eq!(bench.drive.actual_value_frame(Channel::One).and_then(|p| p.word(2)), Some(0x8037));
}

/// Manual 5.00005.03a p. 135: the next interval is run through, at most its actual value frame is missing.
#[test]
fn an_interval_whose_edge_is_lost_is_run_through() {
    let mut bench = Bench::synchronized(&demo());
    bench.send(Channel::One, &[7, 0]).lost_edge();
    assert_eq!((bench.p(300), bench.p(301)), (7, 7), "handed over, and the drive moves");
    assert_eq!((bench.drive.status_word(), bench.drive.actual_value_frame(Channel::One)), (0x8037, None));
    bench.send(Channel::One, &[8, 0]).edge();
    assert_eq!((bench.p(300), bench.drive.status_word()), (8, 0x8037));
    assert_eq!(bench.drive.actual_value_frame(Channel::One).and_then(|p| p.word(0)), Some(7));
}

/// P. 135: only a settable time in succession ends the lock; 5.01010.01 p. 22: nothing is exchanged meanwhile.
#[test]
fn a_longer_loss_of_sync_ends_the_lock_and_the_drive_moves_on() {
    let mut bench = Bench::synchronized(&DriveConfig { sync_loss_us: Some(9_000), ..demo() });
    let ramp_per_second = NonZeroU32::new(500_000); // 1000 per interval
    let mut ramp = Bench::synchronized(&DriveConfig { ramp_per_second, ..demo() });
    for bench in [&mut bench, &mut ramp] {
        bench.send(Channel::One, &[5000, 0]).edge();
    }
    bench.lost_edge().send(Channel::One, &[9, 0]).lost_edge();
    assert_eq!((bench.p(300), bench.drive.status_word()), (5000, 0x8037), "locked, but nothing is exchanged");
    bench.drive.pass(bench.now + 2_999);
    assert!(bench.drive.is_synchronized());
    assert_eq!(bench.drive.next_time(), Some(bench.now + 3_000));
    bench.drive.pass(bench.now + 3_000);
    assert_eq!((bench.drive.status_word(), bench.drive.next_time()), (0x0037, None));

    let speeds = [0; 5].map(|_| ramp.lost_edge().p(301));
    assert_eq!(speeds, [2000, 3000, 4000, 5000, 5000], "the motion goes on");
    assert!(!ramp.drive.is_synchronized());
}

#[test]
fn sync_mode_off_ends_the_synchronized_state() {
    let mut bench = Bench::synchronized(&demo());
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, false));
    assert_eq!(bench.drive.status_word(), 0x0037);
}

#[test]
fn reference_values_do_not_reach_a_drive_out_of_step() {
    let mut bench = Bench::new(&DriveConfig { lock_time_us: 6_000, ..demo() });
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, true));
    for _ in 0..4 {
        bench.send(Channel::One, &[7, 0]).edge();
    }
    assert!(bench.drive.is_synchronized());
    bench.edge();
    assert_eq!(bench.p(300), 0, "what came before the lock is forgotten");
    bench.send(Channel::One, &[8, 0]).edge();
    assert_eq!(bench.p(300), 8);
}

#[test]
fn commands_for_others_are_ignored() {
    let mut bench = Bench::synchronized(&demo());
    bench.drive.action_command(&ActionCommand::control_word(!(1 << 3), 0));
    bench.drive.action_command(&ActionCommand::sync_mode(!(1 << 3), false));
    assert_eq!(bench.drive.status_word(), 0x8037);
}

#[test]
fn unknown_commands_mean_nothing() {
    let mut bench = Bench::synchronized(&demo());
    let command = ActionCommand { slave_group: u32::MAX, command: 0x80, data_byte: 0, data_word: 0 };
    bench.drive.action_command(&command);
    assert_eq!(bench.drive.status_word(), 0x8037);
}

#[test]
fn moves_only_in_operation_enabled() {
    let mut bench = Bench::synchronized(&DriveConfig { enable: Enable::ByControlWord, ..demo() });
    bench.send(Channel::One, &[100, 0]).edge();
    assert_eq!((bench.p(300), bench.p(301), bench.drive.status_word()), (100, 0, 0x8050));
    bench.control(0x0006).control(0x0007).control(0x000F).edge();
    assert_eq!((bench.p(301), bench.p(120), bench.p(121)), (100, 0x000F, 0x8037));
    bench.control(0x0007).edge();
    assert_eq!((bench.p(301), bench.drive.state()), (0, State::SwitchedOn));
}

#[test]
fn ramp_brakes_down_to_the_end_of_a_quick_stop() {
    let ramp_per_second = NonZeroU32::new(25_000); // 50 per interval
    let mut bench = Bench::synchronized(&DriveConfig { ramp_per_second, ..demo() });
    bench.send(Channel::One, &[120, 0]).edge();
    assert_eq!(bench.p(301), 50);
    bench.edge().edge();
    assert_eq!(bench.p(301), 120);
    bench.control(0x000B).edge();
    assert_eq!((bench.p(301), bench.drive.state()), (70, State::QuickStopActive));
    bench.edge().edge();
    assert_eq!((bench.p(301), bench.drive.state()), (0, State::SwitchOnDisabled));
}

#[test]
fn fault_stops_the_drive_until_it_is_reset() {
    let mut bench = Bench::synchronized(&demo());
    bench.send(Channel::One, &[120, 0]).edge();
    bench.drive.trip(17);
    assert_eq!(bench.drive.state(), State::FaultReactionActive);
    bench.edge();
    assert_eq!((bench.p(301), bench.drive.status_word()), (0, 0x8018));
    bench.control(0x0080).control(0x0006).control(0x000F).edge();
    assert_eq!(bench.p(301), 120);
    bench.drive.set_warning(true);
    assert_eq!(bench.drive.status_word(), 0x80B7);
}
