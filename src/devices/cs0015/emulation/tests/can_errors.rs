//! Tests errors of the CAN bus: p. 18-19, 35-36, 44.

use super::*;
use crate::devices::cs0015::registers::values::{job, job_error};
use crate::devices::emulation::can_faults::{self, OVERRUN};
use crate::fault::{Draft, Effect, Target};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};

const PORT: Target = Target::Port { device: DeviceIndex(0), port: PortNumber(1) };

fn bus_off(bench: &mut Bench) {
    let effect = Effect::new(can_faults::Effect::BusOff);
    assert!(bench.bus.faults().unwrap().fire(bench.now, PORT, &effect).is_some());
    bench.run(500);
}

/// Returns a bench with an attached program that has switched CANopen on.
fn attached() -> Bench {
    let mut bench = Bench::running("program = 'attached'");
    bench.registers.flags.CAN_OPEN.store(1);
    bench.run(20 * MS);
    bench
}

fn flags(bench: &Bench) -> (u8, u8) {
    (bench.registers.flags.CAN_BUS_OFF_ERROR.load(), bench.registers.flags.CAN_ERROR.load())
}

/// Reads 1000h.
fn device_type(bench: &mut Bench) -> Vec<(u16, Vec<u8>)> {
    bench.exchange(0x620, &[0x40, 0, 0x10, 0, 0, 0, 0, 0])
}

#[test]
fn only_can_restart_ends_bus_off() {
    let mut bench = attached();
    assert_eq!((flags(&bench), device_type(&mut bench).len()), ((0, 0), 1));
    bus_off(&mut bench);
    bench.run(1000 * MS);
    assert_eq!((flags(&bench), bench.heard()), ((1, 1), vec![]));
    assert_eq!(bench.job(job::CAN_RESTART, &[]).0, job_error::NONE);
    assert_eq!(flags(&bench), (1, 1), "it takes 128 times 11 bits");
    bench.run(20 * MS);
    assert_eq!(flags(&bench), (0, 1), "the program resets the other flag");
    assert_eq!(bench.heard(), [(0xA0, vec![0, 0x82, 0x10, 1, 0, 0, 0, 0])]);
    bench.registers.flags.CAN_ERROR.store(0);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0xA0, vec![0; 8])]);
    assert_eq!(device_type(&mut bench).len(), 1);
}

/// Manual p. 36.
#[test]
fn the_error_handler_counts_errors_and_ends_bus_off() {
    let mut bench = attached();
    for count in 1..3 {
        bus_off(&mut bench);
        assert_eq!(bench.job(job::CAN_ERRORHANDLER, &[0]).1[0], count);
        bench.run(20 * MS);
        assert_eq!(flags(&bench), (0, 1));
    }
    assert_eq!(bench.job(job::CAN_ERRORHANDLER, &[1]).1[0], 0);
    let mut built_in = Bench::running("");
    bus_off(&mut built_in);
    built_in.run(30 * MS);
    assert_eq!(flags(&built_in), (0, 1), "a built-in program calls it, too");
}

#[test]
fn a_lost_frame_has_a_flag() {
    let mut bench = attached();
    let overrun = Draft { count: Some(1), ..Draft::new(&OVERRUN, PORT) }.check().unwrap();
    bench.faults.add(bench.now, overrun, Owner::Bus(BusIndex(0)), &mut bench.journal).unwrap();
    bench.run(MS);
    assert_eq!(device_type(&mut bench), [(0xA0, vec![0, 0x82, 0x10, 1, 0, 0, 0, 0])]);
    let flags = &bench.registers.flags;
    assert_eq!((flags.CAN_RX_OVERRUN_ERROR.load(), flags.CAN_ERROR.load()), (1, 1));
    assert_eq!(device_type(&mut bench).len(), 1);
}

/// Manual p. 18, D-452.
#[test]
fn a_controller_that_cannot_be_initialised_is_not_at_its_bus() {
    let mut bench = Bench::running("program = 'attached', boot_up = '700'");
    let id = bench.fault("can_init", &[]);
    bench.power_cycle();
    bench.registers.flags.CAN_OPEN.store(1);
    bench.run(20 * MS);
    let flags = |bench: &Bench| {
        [&bench.registers.flags.CAN_INIT_ERROR, &bench.registers.flags.CAN_ERROR].map(|it| it.load())
    };
    assert_eq!((flags(&bench), bench.heard()), ([1, 1], vec![]));
    bench.registers.flags.CAN_INIT_ERROR.store(0);
    bench.job(job::CAN_RESTART, &[]);
    assert_eq!(flags(&bench), [1, 1], "nor now");
    bench.clear_fault(id);
    bench.registers.flags.CAN_INIT_ERROR.store(0);
    bench.job(job::CAN_RESTART, &[]);
    bench.run(5 * MS);
    assert_eq!(flags(&bench), [0, 1]);
    assert_eq!(bench.heard()[0], (0x720, vec![0]), "the frames sent meanwhile");
    assert_eq!(device_type(&mut bench).len(), 1);
}
