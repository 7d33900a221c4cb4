//! Service data: the two semaphores and every error detail.

use super::bench::*;
use crate::rig::Memory;
use commram::devices::omega_drive_line_2::Plc;
use commram::identity::DeviceIndex;
use commram::plant::Power;

#[test]
fn read_and_write() {
    Bench::on_both("", |mut bench| {
        assert_eq!(bench.read(167), (0, 0, 2000));
        assert_eq!(bench.write_word(167, 500), 0);
        assert_eq!(bench.read(167), (0, 0, 500));
        assert_eq!(bench.write_doubleword(302, 0x1234_5678), 0);
        assert_eq!(bench.read(302), (0, 1, 0x1234_5678));
        assert_eq!(bench.read(121), (0, 0, 0x0050));
    });
}

#[test]
fn every_error_detail() {
    Bench::on_both("", |mut bench| {
        assert_eq!(bench.job(3, 302, 7, (1, 0)), -1, "no such job");
        assert_eq!(bench.write_word(103, 3), -2);
        assert_eq!(bench.write_word(103, 9), -3);
        assert_eq!(bench.write_doubleword(SPEED_ACTUAL, 1), -4);
        assert_eq!(bench.job(2, 103, 5, (0, 4)), -4, "only the value can be written");
        assert_eq!(bench.read(999).0, -5);
        assert_eq!(bench.write_word(999, 0), -5);
        assert_eq!(bench.job(1, 103, 1, (0, 0)), -5, "no such element");
        assert_eq!(bench.write_doubleword(103, 4), -7);
        assert_eq!(bench.write_word(103, 8), 0);
        assert_eq!(bench.read(103).0, -6, "being recalculated");
        assert_eq!(bench.write_word(103, 8), -6);
        bench.step(20_000);
        assert_eq!(bench.read(103), (0, 0, 8));
        bench.regs.b_JOB.store(2);
        bench.regs.us_NUMBER.store(2);
        assert_eq!(bench.run_job(), -8);
    });
}

#[test]
fn minimum_and_maximum() {
    Bench::on_both("", |mut bench| {
        for (number, element, value) in
            [(103, 5, 4), (103, 6, 8), (300, 5, 0x8000_0000), (300, 6, 0x7FFF_FFFF), (302, 6, u32::MAX)]
        {
            assert_eq!(bench.job(1, number, element, (0, 0)), 0);
            assert_eq!(bench.regs.ud_PAR_VALUE.load(), value, "{number}.{element}");
        }
    });
}

#[test]
fn the_result_comes_after_the_service_time_and_stays_until_it_is_read() {
    Bench::on_both("service_time_us = 10000", |mut bench| {
        bench.regs.b_JOB.store(1);
        bench.regs.u_PAR_NR.store(167);
        bench.regs.us_PAR_ELEMENT.store(7);
        bench.regs.b_MA_SEMAPHORE.store(1);
        bench.step(500);
        // Values that the PLC writes now belong to the next job.
        bench.regs.u_PAR_NR.store(999);
        bench.step(9500);
        assert_eq!(bench.regs.b_SL_SEMAPHORE.load(), 0);
        bench.step(500);
        assert_eq!((bench.regs.b_SL_SEMAPHORE.load(), bench.regs.ud_PAR_VALUE.load()), (1, 2000));
        bench.step(1_000_000);
        assert_eq!((bench.regs.b_SL_SEMAPHORE.load(), bench.regs.ud_PAR_VALUE.load()), (1, 2000));
        bench.regs.b_MA_SEMAPHORE.store(0);
        bench.step(500);
        assert_eq!(bench.regs.b_SL_SEMAPHORE.load(), 0);
        assert_eq!(
            bench.plant.devices()[0].as_a::<Plc>().unwrap().baps().next_time(),
            u64::MAX,
            "no time slices without need"
        );
    });
}

#[test]
fn a_job_that_the_plc_gives_up_is_not_carried_out() {
    Bench::on_both("service_time_us = 10000", |mut bench| {
        let regs = bench.regs.clone();
        for (register, value) in
            [(&regs.b_JOB, 2), (&regs.us_PAR_ELEMENT, 7), (&regs.us_NUMBER, 1), (&regs.b_PAR_FORMAT, 1)]
        {
            register.store(value);
        }
        regs.u_PAR_NR.store(302);
        regs.ud_PAR_VALUE.store(5);
        regs.b_MA_SEMAPHORE.store(1);
        bench.step(9000);
        regs.b_MA_SEMAPHORE.store(0);
        bench.step(20_000);
        assert_eq!((bench.p(302), regs.b_SL_SEMAPHORE.load()), (0, 0));
        // The cancelled job does not disturb the next job.
        regs.b_MA_SEMAPHORE.store(1);
        bench.step(10_500);
        assert_eq!((bench.p(302), regs.b_SL_SEMAPHORE.load()), (5, 1));
    });
}

#[test]
fn other_values_of_the_master_semaphore_are_no_job() {
    let mut bench = Bench::new(Memory::Heap, "");
    bench.regs.b_MA_SEMAPHORE.store(2);
    bench.step(10_000);
    assert_eq!(bench.regs.b_SL_SEMAPHORE.load(), 0);
}

#[test]
fn parameters_of_the_plant_file() {
    Bench::on_both(
        "parameters = [{ number = 400, format = 'word', initial = 7, max = 9, settle_us = 5000 }]",
        |mut bench| {
            assert_eq!(bench.read(400), (0, 0, 7));
            assert_eq!(bench.write_word(400, 9), 0);
            assert_eq!(bench.read(400).0, -6);
            assert_eq!(bench.read(400), (0, 0, 9));
        },
    );
}

/// The drive has these parameters again after power-off (D-166).
#[test]
fn own_parameters_of_the_drive_in_the_plant_file() {
    let drive = "parameters = [{ number = 167, format = 'word', initial = 1000 }]";
    Bench::on_both(drive, |mut bench| {
        assert_eq!(bench.read(167), (0, 0, 1000));
        assert_eq!(bench.write_word(167, 500), 0);
        bench.plant.set_power(DeviceIndex(0), Power::Off);
        bench.plant.set_power(DeviceIndex(0), Power::On);
        assert_eq!(bench.read(167), (0, 0, 1000));
    });
}
