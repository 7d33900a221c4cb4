//! Tests a program as master of nodes. The test simulates the nodes: p. 52-70.

use super::{Bench, MS};
use crate::devices::cs0015::registers::values::{job, job_error};

const NOT_MASTER: u32 = 255;
const WRONG: u32 = 2;

/// Returns a master with node 5. The master guards the node every 100 ms.
fn master() -> Bench {
    let mut bench = Bench::running("node_id = 1, program = 'attached'");
    // The program sets the flag and makes the device a master in its first cycle.
    bench.registers.flags.CAN_OPEN.store(1);
    assert_eq!(bench.job(job::NMM_SET_NMT_MASTER, &[]).0, job_error::NONE);
    assert_eq!(bench.result(job::NMM_ADD_NODE, &[5, 100, 2]), 0);
    bench
}

#[test]
fn without_a_master_nothing_is_sent() {
    let mut bench = Bench::running("program = 'attached'");
    assert_eq!(bench.job(job::NMM_SET_NMT_MASTER, &[]).0, job_error::STATE, "CAN_OPEN is FALSE");
    for function in
        [job::NMM_SET_PREOPERATIONAL, job::NMM_SET_OPERATIONAL, job::NMM_SET_PREPARED, job::NMM_RESET_NODE]
    {
        assert_eq!(bench.result(function, &[0]), NOT_MASTER, "{function:04X}");
    }
    assert_eq!(bench.result(job::NMM_ADD_NODE, &[5, 100, 3]), 1);
    assert_eq!(bench.result(job::NMM_START_GUARDING, &[5]), WRONG);
    assert_eq!(bench.result(job::NMM_NODE_GUARDING, &[1]), NOT_MASTER);
    assert_eq!(bench.job(job::NMM_GET_NODE_STATE, &[5]).1[..2], [0, NOT_MASTER]);
    assert_eq!(bench.job(job::NMM_RESET_COMM, &[5]).1[..2], [0, NOT_MASTER]);
    assert_eq!(bench.result(job::PDO_SEND_SYNC_OBJ, &[]), 0);
    for function in [job::PDO_INI_SEND_SYNC_OBJ, job::EMC_GET_EMERGENCY, job::SDO_READ, job::SDO_WRITE] {
        assert_eq!(bench.job(function, &[5, 0x1000, 0, 4]).0, job_error::STATE, "{function:04X}");
    }
    bench.run(20 * MS);
    assert_eq!(bench.heard(), []);
}

/// Manual p. 60-65.
#[test]
fn commands_go_to_one_node_or_to_all() {
    let mut bench = master();
    for wrong in [[0, 100, 3], [128, 100, 3], [1, 100, 3], [6, 65_536, 3], [6, 100, 256]] {
        assert_eq!(bench.result(job::NMM_ADD_NODE, &wrong), WRONG, "{wrong:?}");
    }
    for (function, command, state) in [
        (job::NMM_SET_PREOPERATIONAL, 128, 127),
        (job::NMM_SET_OPERATIONAL, 1, 5),
        (job::NMM_SET_PREPARED, 2, 4),
        (job::NMM_RESET_NODE, 129, 0),
    ] {
        assert_eq!(bench.result(function, &[5]), 0);
        bench.run(2 * MS);
        assert_eq!(bench.heard(), [(0, vec![command, 5])]);
        assert_eq!(bench.job(job::NMM_GET_NODE_STATE, &[5]).1[..2], [state, 0]);
        for wrong in [6, 128] {
            assert_eq!(bench.result(function, &[wrong]), WRONG, "{function:04X} {wrong}");
        }
    }
    assert_eq!(bench.job(job::NMM_RESET_COMM, &[5]).1[..2], [0, 0]);
    assert_eq!(bench.job(job::NMM_GET_NODE_STATE, &[1]).1[..2], [127, 0], "the master itself");
    assert_eq!(bench.result(job::NMM_SET_OPERATIONAL, &[1]), 0);
    assert_eq!((bench.stat(), bench.result(job::NMM_SET_PREPARED, &[1])), ("green 2 Hz".to_owned(), WRONG));
    assert_eq!(bench.result(job::NMM_SET_PREOPERATIONAL, &[0]), 0);
    assert_eq!(bench.stat(), "green 0.5 Hz", "the master, too (p. 61)");
    assert_eq!(bench.job(job::NMM_GET_NODE_STATE, &[0]).1[..2], [127, 0]);
    bench.job(job::NMM_ADD_NODE, &[6, 0, 0]);
    assert_eq!(bench.job(job::NMM_GET_NODE_STATE, &[0]).1[..2], [0, 0], "they have no state in common");
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0, vec![130, 5]), (0, vec![128, 0])]);
}

/// Manual p. 57-59, 28.
#[test]
fn nodes_are_guarded_while_the_program_calls_the_block() {
    let mut bench = master();
    assert_eq!(bench.result(job::NMM_NODE_GUARDING, &[1]), 0);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [], "guarding was not started");
    assert_eq!(bench.result(job::NMM_START_GUARDING, &[6]), WRONG);
    assert_eq!(bench.result(job::NMM_START_GUARDING, &[0]), 0);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [], "the program has not called");
    bench.result(job::NMM_NODE_GUARDING, &[1]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x705, vec![])]);
    bench.send(0x705, &[127]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [], "it was not missing");
    assert_eq!(bench.job(job::NMM_GET_NODE_STATE, &[5]).1[..2], [127, 0]);
    for expected in [0, 0, 5, 5] {
        bench.run(100 * MS);
        assert_eq!(bench.result(job::NMM_NODE_GUARDING, &[1]), expected);
    }
    bench.run(5 * MS);
    let resets = bench.heard().into_iter().filter(|frame| *frame == (0, vec![129, 5])).count();
    assert_eq!((resets, bench.registers.flags.COP_GUARDFAIL_NODEID.load()), (2, 5), "repeatedly");
    bench.send(0x705, &[127]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0, vec![1, 5])], "AUTO_RESTART");
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_NODEID.load(), 0);
    assert_eq!(bench.result(job::NMM_STOP_GUARDING, &[5]), 0);
    bench.run(300 * MS);
    assert_eq!((bench.result(job::NMM_NODE_GUARDING, &[1]), bench.heard()), (0, vec![]));
}

#[test]
fn without_auto_restart_a_returning_node_is_not_started() {
    let mut bench = master();
    bench.result(job::NMM_START_GUARDING, &[5]);
    for expected in [0, 0, 5] {
        assert_eq!(bench.result(job::NMM_NODE_GUARDING, &[0]), expected);
        bench.run(100 * MS);
    }
    bench.heard();
    bench.send(0x705, &[127]);
    bench.run(5 * MS);
    assert_eq!((bench.heard(), bench.result(job::NMM_NODE_GUARDING, &[0])), (vec![], 0));
}

/// Manual p. 66-67.
#[test]
fn a_master_sends_sync_until_its_communication_is_reset() {
    let mut bench = master();
    assert_eq!(bench.result(job::PDO_SEND_SYNC_OBJ, &[]), 0, "it is not ready");
    bench.job(job::PDO_INI_SEND_SYNC_OBJ, &[]);
    assert_eq!(bench.result(job::PDO_SEND_SYNC_OBJ, &[]), 1);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x80, vec![])]);
    bench.job(job::PDO_TX_CONFIG, &[1, 0x390, 1, 0]);
    assert_eq!(bench.result(job::PDO_SEND_SYNC_OBJ, &[]), 0, "not a master any more");
    assert_eq!(bench.result(job::NMM_SET_OPERATIONAL, &[0]), NOT_MASTER);
}

/// Manual p. 68.
#[test]
fn emergencies_of_its_nodes_wait_for_the_program() {
    let mut bench = master();
    assert_eq!(bench.result(job::EMC_GET_EMERGENCY, &[]), 0);
    bench.send(0x85, &[0x00, 0x81, 0x10, 1, 2, 3, 4, 5]);
    bench.send(0x86, &[0x00, 0x81, 0x10, 1, 2, 3, 4, 5]);
    bench.send(0x85, &[0; 8]);
    bench.run(5 * MS);
    assert_eq!(bench.job(job::EMC_GET_EMERGENCY, &[]).1[..4], [1, 5, 0x8100, 0x10]);
    assert_eq!(bench.answer_data(), [1, 2, 3, 4, 5]);
    assert_eq!(bench.job(job::EMC_GET_EMERGENCY, &[]).1[..4], [1, 5, 0, 0], "node 6 was not added");
    assert_eq!(bench.result(job::EMC_GET_EMERGENCY, &[]), 0);
}

/// Manual p. 69-70.
#[test]
fn entries_of_a_node_are_read_and_written() {
    let mut bench = master();
    bench.order(0, job::SDO_READ, &[5, 0x1000, 0, 4]);
    bench.order_with(1, job::SDO_WRITE, &[5, 0x2000, 1, 2], &[0x34, 0x12]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x605, vec![0x40, 0, 0x10, 0, 0, 0, 0, 0])], "one at a time");
    assert!(!bench.is_answered(0) && !bench.is_answered(1));
    bench.send(0x585, &[0x43, 0, 0x10, 0, 1, 2, 3, 4]);
    bench.run(5 * MS);
    assert!(bench.is_answered(0));
    assert_eq!((bench.registers.jobs.a_RESULT[0][0].load(), bench.answer_data()), (1, vec![1, 2, 3, 4]));
    assert_eq!(bench.heard(), [(0x605, vec![0x2B, 0, 0x20, 1, 0x34, 0x12, 0, 0])]);
    bench.send(0x585, &[0x80, 0, 0x20, 1, 0x30, 0, 9, 6]);
    bench.run(5 * MS);
    assert!(bench.is_answered(1));
    let results = [0, 1].map(|number: usize| bench.registers.jobs.a_RESULT[1][number].load());
    assert_eq!(results, [0, 0x0609_0030], "aborted");
    for wrong in [[0, 0, 0, 0], [5, 0x1_0000, 0, 0], [5, 0, 256, 0], [5, 0, 0, 257]] {
        assert_eq!(bench.job(job::SDO_READ, &wrong).0, job_error::ARGUMENTS, "{wrong:?}");
    }
    assert_eq!(bench.job(job::SDO_WRITE, &[5, 0, 0, 1]).0, job_error::ARGUMENTS, "there are no data");
    assert_eq!(bench.job(job::SDO_READ, &[6, 0, 0, 4]).0, job_error::STATE, "it was not added");
}

#[test]
fn a_node_that_does_not_answer_is_given_up() {
    let mut bench = master();
    bench.order(0, job::SDO_READ, &[5, 0x1000, 0, 4]);
    bench.run(999 * MS);
    assert!(!bench.is_answered(0));
    bench.run(5 * MS);
    assert!(bench.is_answered(0));
    assert_eq!(bench.registers.jobs.a_RESULT[0][1].load(), 0x0504_0000);
    assert_eq!(bench.heard().last(), Some(&(0x605, vec![0x80, 0, 0x10, 0, 0, 0, 4, 5])));
}

#[test]
fn a_program_can_withdraw_an_order() {
    let mut bench = master();
    bench.order(0, job::SDO_READ, &[5, 0x1000, 0, 4]);
    bench.order(1, job::SDO_READ, &[5, 0x1001, 0, 1]);
    bench.run(5 * MS);
    bench.heard();
    bench.registers.jobs.a_CONTROL[0].store(0);
    bench.run(5 * MS);
    let requests = bench.heard();
    assert_eq!(requests[0], (0x605, vec![0x80, 0, 0x10, 0, 0, 0, 4, 5]));
    assert_eq!(requests[1], (0x605, vec![0x40, 1, 0x10, 0, 0, 0, 0, 0]), "the next order is processed");
    bench.send(0x585, &[0x4F, 1, 0x10, 0, 0, 0, 0, 0]);
    bench.run(5 * MS);
    assert!(bench.is_answered(1) && !bench.is_answered(0));
}
