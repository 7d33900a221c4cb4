//! Data exchange between card and drive.

use super::*;
use crate::devices::ParameterRefusal;

/// Manuals 5.01010.01 p. 14 and 20, 5.00005.03a p. 135: a reference value acts 750 us after the SYNC edge, at every baud rate.
#[test]
fn a_reference_value_acts_750_us_after_the_edge() {
    for (kbit_s, interval, angles) in [
        (1000, 1000, [0, 25_000, 125_000, 200_000, 200_000]),
        (500, 2000, [0, 125_000, 325_000, 400_000, 400_000]),
        (250, 4000, [0, 325_000, 725_000, 800_000, 800_000]),
        (125, 8000, [0, 725_000, 1_525_000, 1_600_000, 1_600_000]),
    ] {
        let cfg = DriveConfig { card_function: CardFunction::Old, lock_time_us: 0, ..demo() };
        let mut drive = Drive::new(&cfg, kbit_s).unwrap();
        drive.action_command(&ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true));
        let shown = [None, Some(100_000_u32), None, Some(0), None].into_iter().zip(0..).map(|(value, k)| {
            if let Some(value) = value {
                drive.reference_frame(Channel::One, &words_of(&[value as u16, (value >> 16) as u16]));
            }
            drive.sync_edge(k * u64::from(interval), interval);
            assert_eq!(drive.parameter(number::ANGLE_ACTUAL), Some(drive.shaft().angle));
            drive.shaft().angle
        });
        assert_eq!(shown.collect::<Vec<_>>(), angles, "{kbit_s} kbit/s");
    }
}

/// The control word belongs to the process data (5.01010.01 p. 14), so it takes effect together with the reference
/// values.
#[test]
fn a_control_word_acts_with_the_reference_values() {
    let mut bench = Bench::synchronized(&demo());
    bench.send(Channel::One, &[1000, 0]).edge();
    bench.control(0x0007);
    assert_eq!(bench.drive.state(), DrivecomState::OperationEnabled, "it waits for the exchange");
    let before = bench.p(number::ANGLE_ACTUAL);
    bench.edge();
    assert_eq!((bench.drive.state(), bench.p(301)), (DrivecomState::SwitchedOn, 0));
    assert_eq!(bench.p(number::ANGLE_ACTUAL) - before, 750, "1000 increments per ms for 750 us");
}

/// Manuals 5.00005.03a p. 135, 5.02066.01a p. 33: only synchronous position reference values need a
/// synchronized drive. Other reference values and operating modes are permitted before the drive is
/// synchronized.
#[test]
fn only_position_reference_values_wait_until_the_drive_is_synchronized() {
    let position = with_zk(|zk| {
        (zk.zk_0, zk.zk_1, zk.zk_5) = (number::ANGLE_REFERENCE, number::OPERATING_MODE, 0x0009);
    });
    let mut speed = Bench::new(&DriveConfig { lock_time_us: 6_000, ..demo() });
    let mut position = Bench::new(&DriveConfig { lock_time_us: 6_000, ..position });
    for bench in [&mut speed, &mut position] {
        bench.edge().sync_mode(true);
        bench.send(Channel::One, &[0x700, 0]).send(Channel::Two, &[1, 0]).edge();
        assert!(!bench.drive.is_synchronized());
    }
    assert_eq!([300, 301, 302].map(|number| speed.p(number)), [0x700, 0x700, 1]);
    let taken = [number::ANGLE_REFERENCE, number::OPERATING_MODE].map(|number| position.p(number));
    assert_eq!(taken, [0, 1]);
    for _ in 0..3 {
        position.send(Channel::One, &[0x700, 0]).edge();
    }
    assert!(position.drive.is_synchronized());
    assert_eq!(position.edge().p(number::ANGLE_REFERENCE), 0, "a value from before the lock is lost");
    assert_eq!(position.send(Channel::One, &[0x800, 0]).edge().p(number::ANGLE_REFERENCE), 0x800);
}

/// The drive becomes locked while a value waits in the card (ZK 24). The value came before the lock, so it is
/// lost.
#[test]
fn a_delayed_position_reference_value_from_before_the_lock_is_lost() {
    let cfg = with_zk(|zk| (zk.zk_0, zk.zk_24) = (number::ANGLE_REFERENCE, 2));
    let mut bench = Bench::new(&DriveConfig { lock_time_us: 2_000, ..cfg });
    bench.sync_mode(true).edge();
    bench.send(Channel::One, &[0x700, 0]).edge();
    assert!(bench.drive.is_synchronized());
    bench.send(Channel::One, &[0x800, 0]);
    let shown = [(); 4].map(|()| bench.edge().p(number::ANGLE_REFERENCE));
    assert_eq!(shown, [0, 0, 0x800, 0x800]);
}

/// Manual 5.00005.03a p. 103, 165-166: a value outside the limits cannot be written. This applies to every write
/// access: frame, parameter job, and local operation.
#[test]
fn every_write_access_respects_the_limits() {
    let own = ParameterSpec { min: Some(-5), max: Some(9), ..ParameterSpec::new(400, ParamFormat::Word) };
    for (number, good, too_low, too_high) in [
        (number::PWM_FREQUENCY, 5, Some(3), 65535),
        (number::OPERATING_MODE, 1, None, 77),
        (number::POSITION_GAIN, 60, Some(0), 1001),
        (400, 0xFFFB, Some(0xFFFA), 10),
    ] {
        let cfg = with_zk(|zk| (zk.zk_1, zk.zk_5) = (number, 0x0009));
        let mut bench = Bench::synchronized(&DriveConfig { parameters: vec![own], ..cfg });
        let initial = bench.p(number);
        for value in too_low.into_iter().chain([too_high]) {
            bench.send(Channel::Two, &[value]).edge();
            assert_eq!(bench.p(number), initial, "P{number} keeps its value when {value} comes");
            let error = if Some(value) == too_low { 0xFFFE } else { 0xFFFD };
            assert_eq!(bench.job(number, Access::WriteWord(value)), ParameterResult::Error(error));
            let by_hand = bench
                .drive
                .set_parameter(number, if number == 400 { value as i16 as i64 } else { value.into() });
            assert!(
                matches!(by_hand, Err(ParameterRefusal::Range { .. })),
                "P{number} = {value}: {by_hand:?}"
            );
        }
        assert_eq!(bench.send(Channel::Two, &[good]).edge().p(number), u32::from(good), "P{number}");
    }
}

/// The drive recalculates a parameter (16#FFFA, 5.00005.03a p. 166) after every kind of write.
#[test]
fn a_reference_value_for_the_pwm_frequency_makes_the_drive_recalculate() {
    let mut bench = Bench::synchronized(&with_zk(|zk| (zk.zk_1, zk.zk_5) = (number::PWM_FREQUENCY, 0x0009)));
    bench.send(Channel::Two, &[8]).edge();
    let read = |bench: &mut Bench| bench.job(number::PWM_FREQUENCY, Access::Read);
    assert_eq!((bench.p(number::PWM_FREQUENCY), read(&mut bench)), (8, ParameterResult::Error(0xFFFA)));
    bench.send(Channel::Two, &[4]).edge();
    assert_eq!(bench.p(number::PWM_FREQUENCY), 8, "not available now");
    for _ in 0..9 {
        bench.edge();
    }
    assert_eq!(read(&mut bench), ParameterResult::Word(8), "20 ms");
}

/// Manual 5.01010.01 p. 22: without a SYNC signal, card and drive do not communicate. The control word waits
/// in the card, and a parameter job is answered with BUSY (p. 26-27). The drive runs through the first
/// interval without an edge (5.00005.03a p. 135).
#[test]
fn nothing_passes_between_card_and_drive_without_sync() {
    let mut bench = Bench::new(&demo());
    bench.control(0x0007);
    assert_eq!(bench.job(300, Access::Read), ParameterResult::Busy, "no edge yet");
    assert_eq!(bench.job(300, Access::WriteDoubleword(5)), ParameterResult::Busy);
    assert_eq!((bench.p(300), bench.drive.state()), (0, DrivecomState::OperationEnabled));

    let mut bench = Bench::synchronized(&demo());
    bench.control(0x0007).lost_edge();
    assert_eq!(bench.drive.state(), DrivecomState::SwitchedOn, "run through");
    assert_eq!(bench.job(300, Access::WriteDoubleword(5)), ParameterResult::Done);
    bench.lost_edge();
    for _ in 0..4 {
        bench.control(0x000F).send(Channel::One, &[9, 0]).lost_edge();
        assert_eq!(bench.job(300, Access::Read), ParameterResult::Busy);
        assert_eq!(bench.job(300, Access::WriteDoubleword(6)), ParameterResult::Busy);
        assert_eq!((bench.p(300), bench.drive.state()), (5, DrivecomState::SwitchedOn));
    }
    bench.edge();
    assert_eq!(bench.drive.state(), DrivecomState::OperationEnabled, "it has waited");
    assert_eq!(bench.job(300, Access::WriteDoubleword(6)), ParameterResult::Done);
}

/// Manual 5.01010.01 p. 17: too many lost reference values stop the communication between card and drive.
#[test]
fn nothing_passes_between_card_and_drive_after_too_many_losses() {
    let mut bench = Bench::synchronized(&with_zk(|zk| zk.zk_26 = 1));
    bench.send(Channel::One, &[7, 0]).edge().edge().edge();
    assert!(bench.drive.is_exchange_stopped());
    bench.control(0x0007).edge();
    assert_eq!(bench.drive.state(), DrivecomState::OperationEnabled);
    for access in [Access::Read, Access::WriteDoubleword(5)] {
        assert_eq!(bench.job(300, access), ParameterResult::Busy);
    }
    assert_eq!(bench.p(300), 7);
    bench.sync_mode(true).edge();
    assert_eq!(bench.drive.state(), DrivecomState::SwitchedOn);
    assert_eq!(bench.job(300, Access::Read), ParameterResult::Doubleword(7));
}

/// Manual 5.01010.01 p. 30: bit 15 of the status word belongs to the card. So a master sees in this bit that
/// the drive has lost SYNC (p. 21), while the drive's part of the word does not change.
#[test]
fn the_card_answers_the_status_word_also_without_sync() {
    let mut bench = Bench::new(&demo());
    assert_eq!(bench.job(number::STATUS_WORD, Access::Read), ParameterResult::Busy, "none has come yet");
    let mut bench = Bench::synchronized(&demo());
    bench.lost_edge().lost_edge();
    assert_eq!(bench.job(number::STATUS_WORD, Access::Read), ParameterResult::Word(0x8037), "still locked");
    bench.lost_edge();
    assert_eq!(bench.drive.status_word(), 0x00B7, "the drive reports the loss");
    assert_eq!(bench.job(number::STATUS_WORD, Access::Read), ParameterResult::Word(0x0037));
    assert_eq!(bench.job(number::STATUS_WORD, Access::WriteWord(0)), ParameterResult::Busy);
}

/// The card itself answers jobs that do not need the drive.
#[test]
fn a_job_for_a_sub_slave_is_refused_also_without_sync() {
    let mut bench = Bench::new(&demo());
    let job = ParameterJob::new(302, Access::Read).unwrap().with_sub_slave(1);
    assert_eq!(bench.drive.parameter_job(&job).result(), ParameterResult::Error(0xFFFB));
}
