//! SYNC, control word and motion.

use super::*;
use std::num::{NonZeroU16, NonZeroU32};

#[test]
fn bit_15_comes_after_the_lock_time() {
    let mut bench = Bench::new(&DriveConfig { lock_time_us: 10_000, ..demo() });
    bench.edge().edge();
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, true));
    let states: Vec<u16> = (0..6).map(|_| bench.edge().drive.status_word()).collect();
    assert_eq!(states, [0x0037, 0x0037, 0x0037, 0x0037, 0x0037, 0x8037]);
    assert_eq!(bench.drive.actual_value_frame(Channel::One).and_then(|p| p.word(2)), Some(0x8037));
}

/// Manual 5.00005.03a p. 135: if an edge is lost, the drive still runs through the next interval. At most its
/// actual value frame is missing.
#[test]
fn a_drive_runs_through_an_interval_with_a_lost_edge() {
    let mut bench = Bench::synchronized(&demo());
    bench.send(Channel::One, &[7, 0]).lost_edge();
    assert_eq!((bench.p(300), bench.p(301)), (7, 7), "the drive has the value and moves");
    assert_eq!((bench.drive.status_word(), bench.drive.actual_value_frame(Channel::One)), (0x8037, None));
    bench.send(Channel::One, &[8, 0]).edge();
    assert_eq!((bench.p(300), bench.drive.status_word()), (8, 0x8037));
    assert_eq!(bench.drive.actual_value_frame(Channel::One).and_then(|p| p.word(0)), Some(7));
}

/// Manual p. 135: only a longer loss, of adjustable duration, ends the lock. 5.01010.01 p. 22: card and drive exchange
/// no data during the loss.
#[test]
fn a_longer_loss_of_sync_ends_the_lock_but_not_the_motion() {
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
    assert_eq!((bench.drive.status_word(), bench.drive.next_time()), (0x00B7, None));

    let speeds = [0; 5].map(|_| ramp.lost_edge().p(301));
    assert_eq!(speeds, [1625, 2625, 3625, 4625, 5000], "the motion continues");
    assert!(!ramp.drive.is_synchronized());
}

/// Manual p. 135: the loss of SYNC is an error. D-294: if no reaction is configured, it is a warning.
#[test]
fn a_lost_lock_is_reported_until_the_drive_is_synchronized_again() {
    let mut bench = Bench::synchronized(&demo());
    bench.lost_edge().lost_edge();
    assert_eq!((bench.drive.status_word(), bench.p(308)), (0x8037, 0));
    bench.lost_edge();
    assert_eq!((bench.drive.status_word(), bench.p(308)), (0x00B7, 501));
    bench.edge();
    assert_eq!((bench.drive.status_word(), bench.p(308)), (0x8037, 0));
}

#[test]
fn the_reaction_to_a_lost_lock_comes_after_its_time() {
    let ramp_per_second = NonZeroU32::new(500_000); // 1000 per interval
    for (reaction, states) in [
        (
            Reaction::QuickStop,
            [
                (2000, DrivecomState::FaultReactionActive),
                (1000, DrivecomState::FaultReactionActive),
                (0, DrivecomState::Fault),
            ],
        ),
        (
            Reaction::Inhibit,
            [(2000, DrivecomState::Fault), (1000, DrivecomState::Fault), (0, DrivecomState::Fault)],
        ),
    ] {
        let sync = MonitorSettings { time_us: 3_000, reaction, fault: NonZeroU16::new(77) };
        let monitoring = CardMonitoring { sync, ..Default::default() };
        let mut bench = Bench::synchronized(&DriveConfig { ramp_per_second, monitoring, ..demo() });
        bench.send(Channel::One, &[3000, 0]).edge().edge().edge().edge();
        assert_eq!(bench.p(301), 3000);
        let last = bench.now - u64::from(INTERVAL);
        bench.lost_edge().lost_edge();
        bench.drive.pass(last + 5_000);
        assert_eq!(
            (bench.drive.next_time(), bench.drive.state()),
            (Some(last + 8_000), DrivecomState::OperationEnabled)
        );
        bench.lost_edge();
        assert_eq!((bench.p(301), bench.p(308)), (3000, 0), "6 ms");
        for (step, (speed, state)) in states.into_iter().enumerate() {
            bench.lost_edge();
            assert_eq!(
                (bench.p(301), bench.drive.state(), bench.p(308)),
                (speed, state, 77),
                "{reaction:?} {step}"
            );
        }
        bench.control(0x0080).lost_edge();
        assert_eq!(bench.drive.state(), DrivecomState::Fault, "the cause lasts");
        bench.edge().control(0x0000).edge().control(0x0080).edge();
        assert_eq!((bench.drive.state(), bench.p(308)), (DrivecomState::SwitchOnDisabled, 0));
    }
}

/// Decision D-294: "inhibit" takes effect at once, even if the drive is braking for another reason.
#[test]
fn inhibit_ends_the_braking_of_another_fault() {
    let sync = MonitorSettings { reaction: Reaction::Inhibit, ..Default::default() };
    let monitoring = CardMonitoring { sync, ..Default::default() };
    let ramp_per_second = NonZeroU32::new(500_000); // 1000 per interval
    let mut bench = Bench::synchronized(&DriveConfig { ramp_per_second, monitoring, ..demo() });
    bench.send(Channel::One, &[9000, 0]);
    for _ in 0..10 {
        bench.edge();
    }
    bench.drive.trip(17);
    bench.lost_edge();
    assert_eq!((bench.p(301), bench.drive.state()), (8000, DrivecomState::FaultReactionActive));
    bench.lost_edge().lost_edge();
    assert_eq!(
        (bench.drive.state(), bench.p(308)),
        (DrivecomState::Fault, 17),
        "the first fault's number stays"
    );
}

/// Manual p. 135; 5.01010.01 p. 17: more losses than ZK 26 permits are an error.
#[test]
fn lost_reference_values_are_reported_until_sync_mode_on() {
    let reference_values = MonitorSettings { reaction: Reaction::Inhibit, ..Default::default() };
    for (monitoring, state) in [
        (CardMonitoring::default(), DrivecomState::OperationEnabled),
        (CardMonitoring { reference_values, ..Default::default() }, DrivecomState::Fault),
    ] {
        let mut bench = Bench::synchronized(&DriveConfig { monitoring, ..with_zk(|zk| zk.zk_26 = 3) });
        bench.send(Channel::One, &[7, 0]).edge();
        for _ in 0..3 {
            bench.edge();
        }
        assert_eq!((bench.p(308), bench.drive.state()), (0, DrivecomState::OperationEnabled));
        bench.edge();
        assert_eq!((bench.p(308), bench.drive.state()), (502, state));
        bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, true));
        bench.edge().control(0x0080).edge();
        assert_eq!(bench.p(308), 0, "{state:?}");
    }
}

/// Manual 5.01010.01 p. 13: P167 must match the baud rate, and P168 must be 0. D-291: with another value of
/// P167 the drive never becomes locked.
#[test]
fn a_sync_slot_of_another_rate_never_locks() {
    for (kbit_s, interval) in [(1000, 1000), (500, 2000), (250, 4000), (125, 8000)] {
        let cfg = DriveConfig { card_function: CardFunction::Old, lock_time_us: 0, ..demo() };
        let mut drive = Drive::new(&cfg, kbit_s).unwrap();
        assert_eq!(drive.parameter(number::SYNC_SLOT), Some(interval));
        drive.action_command(&ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true));
        drive.sync_edge(0, interval);
        assert!(drive.is_synchronized() && drive.take_objections(interval).next().is_none());
        drive.regler.write_element(number::SYNC_OFFSET, 7, ParamFormat::Word, 100).unwrap();
        assert_eq!(drive.take_objections(interval).collect::<Vec<_>>(), [Objection::SyncOffset(100)]);
        drive.regler.write_element(number::SYNC_OFFSET, 7, ParamFormat::Word, 0).unwrap();
        drive.regler.write_element(number::SYNC_SLOT, 7, ParamFormat::Word, 500).unwrap();
        assert_eq!(drive.take_objections(interval).collect::<Vec<_>>(), [Objection::SyncSlot(500)]);
        assert_eq!(drive.take_objections(interval).next(), None, "reported once");
        drive.sync_edge(u64::from(interval), interval);
        assert!(!drive.is_synchronized());
    }
    let refused = Drive::new(&demo(), 1000).unwrap_err().to_string();
    assert!(refused.starts_with("drive drive: card_function 1 does not run at 1000 kbit/s"), "{refused}");
}

#[test]
fn sync_mode_off_ends_the_synchronized_state() {
    let mut bench = Bench::synchronized(&demo());
    bench.drive.action_command(&ActionCommand::sync_mode(1 << 3, false));
    assert_eq!(bench.drive.status_word(), 0x0037);
}

#[test]
fn commands_for_others_are_ignored() {
    let mut bench = Bench::synchronized(&demo());
    bench.drive.action_command(&ActionCommand::control_word(!(1 << 3), 0));
    bench.drive.action_command(&ActionCommand::sync_mode(!(1 << 3), false));
    bench.edge();
    assert_eq!(bench.drive.status_word(), 0x8037);
}

#[test]
fn unknown_commands_have_no_effect() {
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
    bench.control(0x0006).edge().control(0x0007).edge().control(0x000F).edge();
    assert_eq!((bench.p(301), bench.p(120), bench.p(121)), (100, 0x000F, 0x8037));
    bench.control(0x0007).edge();
    assert_eq!((bench.p(301), bench.drive.state()), (0, DrivecomState::SwitchedOn));
}

#[test]
fn ramp_brakes_down_to_the_end_of_a_quick_stop() {
    let ramp_per_second = NonZeroU32::new(25_000); // 50 per interval
    let mut bench = Bench::synchronized(&DriveConfig { ramp_per_second, ..demo() });
    bench.send(Channel::One, &[120, 0]).edge();
    assert_eq!(bench.p(301), 31, "1250 us");
    bench.edge().edge();
    assert_eq!(bench.p(301), 120);
    bench.control(0x000B).edge();
    assert_eq!((bench.p(301), bench.drive.state()), (89, DrivecomState::QuickStopActive));
    bench.edge().edge();
    assert_eq!((bench.p(301), bench.drive.state()), (0, DrivecomState::SwitchOnDisabled));
}

#[test]
fn fault_stops_the_drive_until_it_is_reset() {
    let mut bench = Bench::synchronized(&demo());
    bench.send(Channel::One, &[120, 0]).edge();
    bench.drive.trip(17);
    assert_eq!(bench.drive.state(), DrivecomState::FaultReactionActive);
    bench.edge();
    assert_eq!((bench.p(301), bench.drive.status_word()), (0, 0x8018));
    bench.control(0x0080).edge().control(0x0006).edge().control(0x000F).edge();
    assert_eq!(bench.p(301), 120);
    bench.drive.set_warning(true);
    assert_eq!(bench.drive.status_word(), 0x80B7);
}
