//! Tests the direct use of CAN by a program: p. 22-23, 32-34.

use super::{Bench, MS};
use crate::devices::cs0015::registers::values::{job, job_error};

const ATTACHED: &str = "program = 'attached'";

/// Calls `CAN_RECEIVE`; returns AVAILABLE, OVERFLOW, DATA.
fn receive(bench: &mut Bench, id: u32) -> (u32, u32, Vec<u8>) {
    let (error, results) = bench.job(job::CAN_RECEIVE, &[0, 0, id]);
    assert_eq!(error, job_error::NONE);
    assert_eq!((results[0] as usize, results[1]), (bench.answer_data().len(), 0));
    (results[2], results[3], bench.answer_data())
}

/// Manual p. 28: after power-on the device takes part in the bus, but not as a CANopen node.
#[test]
fn messages_wait_for_the_program() {
    let mut bench = Bench::running(ATTACHED);
    assert_eq!(bench.job(job::CAN_RECEIVE, &[0, 0, 0x111]).0, job_error::STATE, "it was not registered");
    assert_eq!(bench.job(job::CAN_RECEIVE, &[1, 0, 2048]).0, job_error::ARGUMENTS);
    assert_eq!(bench.result(job::CAN_RECEIVE, &[1, 0, 0x111]), 0);
    for number in 0..31 {
        bench.send(0x111, &[number, 7]);
    }
    bench.send(0x112, &[1]);
    bench.run(60 * MS);
    let flags = &bench.registers.flags;
    let overrun = (flags.CAN_RX_OVERRUN_ERROR.load(), flags.CAN_ERROR.load());
    assert_eq!(overrun, (1, 1), "the last one is lost (p. 18, D-478)");
    assert_eq!(receive(&mut bench, 0x111), (30, 1, vec![0, 7]));
    assert_eq!(receive(&mut bench, 0x111), (29, 1, vec![1, 7]));
    assert_eq!(bench.job(job::CAN_RECEIVE, &[0, 1, 0x111]).1[2..4], [0, 0], "cleared");
    bench.send(0x111, &[]);
    bench.run(5 * MS);
    assert_eq!(receive(&mut bench, 0x111), (1, 0, vec![]));
    assert_eq!(receive(&mut bench, 0x111), (0, 0, vec![]));
    bench.power_cycle();
    assert_eq!(bench.job(job::CAN_RECEIVE, &[0, 0, 0x111]).0, job_error::STATE, "forgotten");
}

/// Manual p. 42: a program can also use the jobs for CAN messages while CANopen runs. Section 11.1: a reset
/// by the master removes the registered identifiers.
#[test]
fn with_canopen_messages_wait_until_the_master_resets_the_node() {
    let mut bench = Bench::running("");
    bench.job(job::CAN_RECEIVE, &[1, 0, 0x111]);
    bench.send(0x111, &[1]);
    bench.run(5 * MS);
    assert_eq!(receive(&mut bench, 0x111), (1, 0, vec![1]));
    bench.send(0, &[130, 32]);
    bench.run(5 * MS);
    assert_eq!(bench.job(job::CAN_RECEIVE, &[0, 0, 0x111]).0, job_error::STATE);
}

#[test]
fn a_message_is_taken_when_the_controller_is_free() {
    let mut bench = Bench::running(ATTACHED);
    let (arguments, data) = ([0x222, 0, 3], [1, 2, 3, 4]);
    for place in 0..2 {
        bench.order_with(place, job::CAN_TRANSMIT, &arguments, &data);
    }
    bench.run(MS);
    let results = [0, 1].map(|place: usize| bench.registers.jobs.a_RESULT[place][0].load());
    assert_eq!(results, [1, 0], "the second order must be repeated");
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x222, vec![1, 2, 3])]);
    bench.order_with(0, job::CAN_TRANSMIT, &[2047, 0, 8], &[9; 8]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(2047, vec![9; 8])]);
    for (wrong, data) in [([2048, 0, 0], &[][..]), ([1, 0, 9], &[0; 9]), ([1, 0, 5], &[0; 4])] {
        bench.order_with(0, job::CAN_TRANSMIT, &wrong, data);
        bench.run(MS);
        assert_eq!(bench.registers.jobs.a_ERROR[0].load(), job_error::ARGUMENTS, "{wrong:?}");
    }
}
