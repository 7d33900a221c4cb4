//! RESET of the board, which does not affect the drive, and power-off, which does (D-166).

use super::bench::*;
use crate::rig::Memory;
use commram::devices::cansync::drive::DrivecomState;
use commram::identity::DeviceIndex;
use commram::plant::Power;

/// The drive turns with P300 = 1000, P302 is 5, and a service data job is in progress.
fn turning(drive: &str, test: impl Fn(Bench)) {
    Bench::on_both(drive, |mut bench| {
        bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL]);
        bench.regs.a_WR_VALUE[0].store(1000);
        bench.enable();
        assert_eq!(bench.write_doubleword(ADDITIONAL, 5), 0);
        bench.regs.b_MA_SEMAPHORE.store(1);
        bench.step(500);
        test(bench);
    });
}

fn values(bench: &Bench) -> (u32, u32, u32, DrivecomState) {
    (bench.p(SPEED_REFERENCE), bench.p(SPEED_ACTUAL), bench.p(ADDITIONAL), bench.drive().state())
}

const TURNING: (u32, u32, u32, DrivecomState) = (1000, 1000, 5, DrivecomState::OperationEnabled);
const POWERED_ON: (u32, u32, u32, DrivecomState) = (0, 0, 0, DrivecomState::SwitchOnDisabled);

#[test]
fn reset_restarts_the_interface_while_the_drive_turns() {
    turning("", |mut bench| {
        let events = bench.events();
        bench.plant.set_power(DeviceIndex(0), Power::HoldReset);
        let angle = bench.p(303);
        bench.regs.b_COMMAND.store(CONFIGURE);
        bench.step(5000);
        assert_eq!(values(&bench), TURNING);
        assert_eq!(bench.p(303).wrapping_sub(angle), 5000, "it goes on while RESET is held");
        assert_eq!(bench.regs.b_COMMAND.load(), CONFIGURE, "the interface does not answer");

        bench.plant.set_power(DeviceIndex(0), Power::ReleaseReset);
        assert_eq!((bench.regs.b_COMMAND.load(), bench.regs.w_STATUSWORD.load()), (0, 0));
        bench.step(5000);
        assert_eq!((values(&bench), bench.events()), (TURNING, events));
        assert_eq!(bench.regs.b_SL_SEMAPHORE.load(), 0, "the job is forgotten");
        assert_eq!(bench.command(EXCHANGE, 500), 0x81);
        assert_eq!(values(&bench), TURNING, "a control word without configuration does not count");

        assert_eq!(bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL]), 0x02);
        bench.step(500);
        assert_eq!((bench.regs.a_RD_VALUE[0].load(), bench.regs.w_STATUSWORD.load()), (1000, 0x0037));
        bench.regs.w_CONTROLWORD.store(0);
        bench.exchange(2);
        assert_eq!(bench.drive().state(), DrivecomState::SwitchOnDisabled, "it obeys again");
    });
}

#[test]
fn the_drive_restarts_after_loss_of_supply() {
    turning("", |mut bench| {
        bench.plant.set_power(DeviceIndex(0), Power::Off);
        bench.step(5000);
        assert_eq!(values(&bench), POWERED_ON);
        bench.plant.set_power(DeviceIndex(0), Power::On);
        bench.step(5000);
        assert_eq!((values(&bench), bench.regs.b_SL_SEMAPHORE.load()), (POWERED_ON, 0));
        assert_eq!(bench.command(EXCHANGE, 500), 0x81);
    });
}

#[test]
fn the_supply_may_fail_while_reset_is_held() {
    turning("", |mut bench| {
        bench.plant.set_power(DeviceIndex(0), Power::HoldReset);
        bench.step(1000);
        bench.plant.set_power(DeviceIndex(0), Power::Off);
        assert_eq!(values(&bench), POWERED_ON);
        bench.plant.set_power(DeviceIndex(0), Power::On);
        bench.plant.set_power(DeviceIndex(0), Power::ReleaseReset);
        assert_eq!(bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL]), 0x02);
        assert_eq!(values(&bench), POWERED_ON);
    });
}

#[test]
fn a_drive_fails_under_reset_but_not_without_supply() {
    turning("ramp_per_second = 100000", |mut bench| {
        bench.plant.set_power(DeviceIndex(0), Power::HoldReset);
        bench.trip(17);
        assert_eq!((bench.drive().state(), bench.p(308)), (DrivecomState::FaultReactionActive, 17));
        bench.step(20_000);
        assert_eq!(
            (bench.drive().state(), bench.p(SPEED_ACTUAL)),
            (DrivecomState::Fault, 0),
            "it brakes by itself"
        );
        bench.plant.set_power(DeviceIndex(0), Power::Off);
        bench.trip(18);
        assert_eq!(bench.p(308), 0);
    });
}

/// Written parameters keep their values, including the parameters of the drive itself.
#[test]
fn written_parameters_survive_reset_alone() {
    let mut bench = Bench::new(Memory::Heap, "");
    assert_eq!(bench.write_word(167, 1000), 0);
    bench.plant.set_power(DeviceIndex(0), Power::HoldReset);
    bench.plant.set_power(DeviceIndex(0), Power::ReleaseReset);
    assert_eq!(bench.read(167), (0, 0, 1000));
    bench.plant.set_power(DeviceIndex(0), Power::Off);
    bench.plant.set_power(DeviceIndex(0), Power::On);
    assert_eq!(bench.read(167), (0, 0, 2000));
}

/// The board generates the trigger signal, so RESET ends the signal and the lock.
#[test]
fn reset_ends_the_trigger_signal() {
    let mut bench = Bench::new(Memory::Heap, "lock_time_us = 10000");
    bench.opt_init(2, 2000);
    bench.step(20_000);
    assert!(bench.drive().is_synchronized());
    bench.plant.set_power(DeviceIndex(0), Power::HoldReset);
    bench.step(10_000);
    assert!(!bench.drive().is_synchronized());
    bench.plant.set_power(DeviceIndex(0), Power::ReleaseReset);
    bench.step(20_000);
    assert_eq!((bench.drive().is_synchronized(), bench.regs.w_STATUS_REG.load()), (false, 0));
    bench.opt_init(2, 2000);
    bench.step(20_000);
    assert_eq!((bench.drive().is_synchronized(), bench.regs.w_STATUS_REG.load()), (true, 1));
}
