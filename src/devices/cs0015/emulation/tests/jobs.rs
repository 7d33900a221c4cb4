//! Tests orders of a program to the operating system: p. 30-51.

use super::{Bench, MS};
use crate::devices::catalogue;
use crate::devices::cs0015::emulation::board::events::CYCLE;
use crate::devices::cs0015::registers::values::{job, job_error};
use crate::journal::text::Text;
use crate::journal::{Format, Names};

const ATTACHED: &str = "program = 'attached', cycle_us = 5000";

/// Returns a bench with an attached program that has switched CANopen on.
fn canopen() -> Bench {
    let mut bench = Bench::running(ATTACHED);
    assert_eq!(bench.exchange(0, &[1, 32]), [], "CANopen is off");
    bench.registers.flags.CAN_OPEN.store(1);
    bench.run(6 * MS);
    bench
}

fn operational() -> Bench {
    let mut bench = canopen();
    bench.send(0, &[1, 0]);
    bench.run(6 * MS);
    assert_eq!(bench.registers.flags.COP_PREOPERATIONAL.load(), 0);
    bench
}

#[test]
fn an_attached_program_gets_an_event_for_each_cycle() {
    let mut bench = Bench::new(ATTACHED);
    let counts = |bench: &Bench| {
        let slot = &bench.segment.header().unwrap().events[CYCLE];
        (slot.bell.rings(), slot.time_us.load())
    };
    bench.run(200 * MS - 1);
    assert_eq!(counts(&bench), (0, 0), "reset");
    bench.run(1);
    assert_eq!(counts(&bench), (1, 200 * MS));
    bench.run(20 * MS);
    assert_eq!(counts(&bench), (5, 220 * MS));
    bench.command(2);
    let stopped = counts(&bench);
    bench.run(20 * MS);
    assert_eq!(counts(&bench), stopped, "it does not run");
    bench.device.events().unwrap().watched = 1 << CYCLE;
    bench.command(1);
    let events = bench.device.events().unwrap();
    assert_eq!((events.take_stop(), events.take_fired()), (true, 1 << CYCLE));
    assert_eq!((bench.device.event_level(CYCLE), bench.device.event_level(0)), (Some(1), None));
}

#[test]
fn a_node_id_is_in_force_at_once_and_kept() {
    let mut bench = canopen();
    assert_eq!(bench.job(job::NMS_SET_NODEID, &[5]).0, job_error::NONE);
    assert_eq!(bench.registers.flags.NODEID.load(), 5);
    assert_eq!(bench.exchange(0x605, &[0x40, 0xF0, 0x20, 0, 0, 0, 0, 0])[0].1[4], 5);
    for wrong in [0, 31, 0x105] {
        assert_eq!(bench.job(job::NMS_SET_NODEID, &[wrong]).0, job_error::ARGUMENTS, "{wrong}");
    }
    assert_eq!(bench.registers.flags.NODEID.load(), 5);
    bench.power_cycle();
    assert_eq!(bench.registers.flags.NODEID.load(), 5);
}

#[test]
fn a_bit_rate_is_in_force_at_once_and_kept() {
    let mut bench = operational();
    assert_eq!(bench.job(job::CAN_BAUDRATE, &[501]).0, job_error::ARGUMENTS);
    assert_eq!(bench.job(job::CAN_BAUDRATE, &[500]).0, job_error::NONE);
    assert_eq!(bench.registers.flags.CANBAUDRATE.load(), 500);
    assert_eq!(bench.exchange(0x620, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]), [], "the bus has another rate");
    bench.power_cycle();
    assert_eq!(bench.registers.flags.CANBAUDRATE.load(), 500);
    assert_eq!(bench.job(job::CAN_BAUDRATE, &[125]).0, job_error::NONE);
    bench.registers.flags.CAN_OPEN.store(1);
    bench.run(6 * MS);
    assert_eq!(bench.exchange(0x620, &[0x40, 0xF2, 0x20, 0, 0, 0, 0, 0])[0].1[4], 3, "125 kbit/s");
}

/// Manual p. 47-51.
#[test]
fn pdos_are_configured_and_repeated() {
    let mut bench = operational();
    assert_eq!(bench.job(job::PDO_TX_CONFIG, &[3, 0x390, 1, 0]).0, job_error::NONE);
    assert_eq!(bench.job(job::PDO_RX_CONFIG, &[1, 0x220, 255]).0, job_error::NONE);
    assert_eq!(bench.registers.flags.COP_PREOPERATIONAL.load(), 1, "the communication was reset");
    bench.send(0, &[1, 0]);
    bench.run(6 * MS);
    assert_eq!(bench.exchange(0x80, &[]), [(0x390, vec![0; 8])]);
    assert_eq!(bench.job(job::PDO_TX_REFRESH, &[2]).0, job_error::NONE);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x2A0, vec![0; 8])]);
    // The PDO has an identifier of the predefined connection set. Such an identifier still changes with the
    // Node-ID.
    bench.job(job::NMS_SET_NODEID, &[7]);
    bench.send(0x207, &[1, 2, 3, 4, 5, 6, 7, 8]);
    bench.run(5 * MS);
    assert_eq!(bench.registers.received(0), [1, 2, 3, 4, 5, 6, 7, 8]);
    for (function, wrong) in [
        (job::PDO_TX_CONFIG, [0, 0x390, 1, 0]),
        (job::PDO_TX_CONFIG, [9, 0x390, 1, 0]),
        (job::PDO_TX_CONFIG, [1, 0x800, 1, 0]),
        (job::PDO_TX_CONFIG, [1, 0x390, 254, 0]),
        (job::PDO_TX_CONFIG, [1, 0x390, 255, 0x10000]),
        (job::PDO_RX_CONFIG, [1, 0x390, 241, 0]),
        (job::PDO_TX_REFRESH, [9, 0, 0, 0]),
        (job::NMS_GUARDING_CONFIG, [0x10000, 3, 0, 0]),
        (job::NMS_GUARDING_CONFIG, [100, 256, 0, 0]),
    ] {
        assert_eq!(bench.job(function, &wrong).0, job_error::ARGUMENTS, "{function:04X} {wrong:?}");
    }
    assert_eq!(bench.registers.flags.COP_PREOPERATIONAL.load(), 0, "nothing was done");
}

#[test]
fn a_running_program_sets_the_supervision_of_its_master() {
    let mut bench = operational();
    assert_eq!(bench.job(job::NMS_GUARDING_CONFIG, &[100, 3, 0]).0, job_error::NONE);
    bench.ask(0x720);
    bench.run(290 * MS);
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 0);
    bench.run(15 * MS);
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 1);
}

#[test]
fn orders_are_carried_out_in_the_order_in_which_they_were_given() {
    let mut bench = canopen();
    bench.registers.jobs.d_ORDERS.store(u32::MAX);
    for (place, number) in [(7, 1), (2, 2), (15, 3), (0, 4)] {
        bench.order(place, job::NMS_SET_NODEID, &[number]);
    }
    bench.run(MS);
    assert_eq!(bench.registers.flags.NODEID.load(), 4);
    let controls: Vec<_> = bench.registers.jobs.a_CONTROL.iter().map(|control| control.load()).collect();
    assert_eq!(controls, [4, 0, 4, 0, 0, 0, 0, 4, 0, 0, 0, 0, 0, 0, 0, 4]);
}

#[test]
fn an_unknown_function_is_refused_and_reported() {
    let mut bench = canopen();
    for (function, text) in [(0_u16, "none"), (0x01FF, "16#01FF"), (0xFF01, "16#FF01")] {
        assert_eq!(bench.job(function, &[]).0, job_error::FUNCTION);
        let record = bench.journal.records().next_back().unwrap();
        let mut line = String::new();
        Text::new(Names::default(), catalogue()).record(&record, &mut line);
        assert!(line.contains(&format!("job refused: {text}: no such function")), "{line}");
    }
}

/// The operating system carries out the functions only while the program runs.
#[test]
fn orders_of_a_stopped_program_are_not_carried_out() {
    let mut bench = canopen();
    bench.command(2);
    bench.order(0, job::NMS_SET_NODEID, &[5]);
    bench.run(20 * MS);
    assert_eq!((bench.registers.flags.NODEID.load(), bench.registers.jobs.a_CONTROL[0].load()), (32, 5));
    bench.command(1);
    assert_eq!((bench.registers.flags.NODEID.load(), bench.registers.jobs.a_CONTROL[0].load()), (5, 4));
    bench.order(0, job::NMS_SET_NODEID, &[6]);
    bench.power_cycle();
    assert_eq!((bench.registers.flags.NODEID.load(), bench.registers.jobs.a_CONTROL[0].load()), (5, 0));
}
