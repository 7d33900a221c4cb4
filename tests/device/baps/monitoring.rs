//! Communication monitoring of the drive that is connected to the BAPS (5.01010.01 p. 22; D-293 to D-295).

use super::bench::*;
use crate::rig::{Memory, OMEGA_RATES};
use commram::devices::cansync::drive::DrivecomState;
use commram::devices::omega_drive_line_2::registers::{CANsync_INIT_BMSTRUCT, DEVICE, NODE2};
use commram::identity::DeviceIndex;
use commram::plant::Power;

const MONITORING: &str = "[plc.drive.monitoring]\ncyclic_data = { time_us = 100000, reaction = 'quick_stop' }\n\
     sync = { time_us = 20000, reaction = 'inhibit', fault = 77 }";

/// Returns a bench with a turning axis, after one exchange.
fn turning(memory: Memory) -> Bench {
    let mut bench = Bench::new(memory, MONITORING);
    bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL]);
    bench.regs.a_WR_VALUE[0].store(1000);
    bench.enable();
    bench.exchange(2);
    assert_eq!(bench.p(SPEED_ACTUAL), 1000);
    bench
}

fn state(bench: &Bench) -> (DrivecomState, u32) {
    (bench.drive().state(), bench.p(308))
}

#[test]
fn a_plc_that_stops_exchanging_stops_the_axis() {
    for memory in [Memory::Heap, Memory::Mapped] {
        let mut bench = turning(memory);
        bench.step(99_000);
        assert_eq!(
            state(&bench),
            (DrivecomState::OperationEnabled, 0),
            "events continue, but no program exchanges"
        );
        bench.step(2_000);
        assert_eq!(state(&bench), (DrivecomState::Fault, 503));
        assert_eq!(bench.p(SPEED_ACTUAL), 0);
    }
}

#[test]
fn an_exchange_in_time_prevents_the_monitoring_error() {
    let mut bench = turning(Memory::Heap);
    for _ in 0..5 {
        bench.step(90_000);
        bench.exchange(1);
    }
    assert_eq!(state(&bench), (DrivecomState::OperationEnabled, 0));
    bench.configure(SAME_CYCLE, &[SPEED_REFERENCE], &[SPEED_ACTUAL]);
    bench.step(200_000);
    assert_eq!(
        state(&bench),
        (DrivecomState::OperationEnabled, 0),
        "a new configuration begins with its first exchange"
    );
}

/// Decision D-166: RESET affects the PLC, not the drive.
#[test]
fn a_plc_in_reset_does_not_exchange() {
    let mut bench = turning(Memory::Heap);
    bench.plant.set_power(DeviceIndex(0), Power::HoldReset);
    bench.step(101_000);
    assert_eq!(state(&bench), (DrivecomState::Fault, 503));
}

#[test]
fn the_drive_notices_that_its_trigger_signal_is_gone() {
    let mut bench = Bench::of_plant(
        Memory::Heap,
        &format!(
            "[[plc]]\nname = 'line'\nnode2 = 'bus'\n[plc.drive]\nlock_time_us = 10000\n{MONITORING}\n\
             [[bus]]\nname = 'bus'"
        ),
    );
    bench.start_sync(OMEGA_RATES[0]);
    bench.opt_init(1, 0);
    bench.step(30_000);
    assert!(bench.drive().is_synchronized());
    let node = bench.plant.devices()[0].segment().view::<CANsync_INIT_BMSTRUCT>(NODE2).unwrap();
    node.w_CPU_CONTROL.store(0x0000);
    bench.step(20_000);
    assert!(!bench.drive().is_synchronized());
    assert_eq!(state(&bench), (DrivecomState::SwitchOnDisabled, 0));
    bench.step(10_000);
    assert_eq!(state(&bench), (DrivecomState::Fault, 77), "whether or not anything is exchanged");
}

/// Manual p. 74 has only 4 and 8 kHz.
#[test]
fn another_pwm_frequency_is_a_finding() {
    let mut bench = Bench::new(Memory::Heap, "");
    assert_eq!(bench.write_word(103, 8), 0);
    assert_eq!(bench.plant.journal().findings().iter().count(), 0);
    bench.step(30_000);
    assert_eq!(bench.write_word(103, 5), 0);
    let findings: Vec<_> = bench.plant.journal().findings().iter().map(|entry| entry.last).collect();
    assert_eq!(findings.len(), 1);
    assert_eq!((findings[0].rule.id(), findings[0].value), ("drive-pwm", 5));
    assert_eq!(findings[0].name(&DEVICE).as_deref(), Some("baps.ud_PAR_VALUE"));
}
