//! Tests a master of I/O modules. The test simulates the modules: p. 71-85.

use super::{Bench, MS};
use crate::devices::cr201x::Model;
use crate::devices::cs0015::registers::values::{job, job_error};

const DONE: u32 = 1;
const NOT_YET: u32 = 2;

/// Returns a master of node 3 after `COP_MSTR_BOOTUP`. The test has simulated the answers of the node.
fn booted() -> Bench {
    let mut bench = Bench::running("node_id = 32, program = 'attached'");
    bench.order(0, job::COP_MSTR_BOOTUP, &[3, 500, 9]);
    bench.run(5 * MS);
    assert_eq!(bench.registers.flags.CAN_OPEN.load(), 1);
    let heard = bench.heard();
    assert_eq!(heard, [(0, vec![128, 0]), (0x701, vec![]), (0x702, vec![]), (0x703, vec![])]);
    bench.run(1990 * MS);
    assert!(!bench.is_answered(0), "it takes more than 2 s");
    bench.run(20 * MS);
    assert!(bench.is_answered(0));
    assert_eq!(bench.registers.jobs.a_RESULT[0][0].load(), DONE);
    bench.heard();
    bench
}

#[test]
fn the_boot_up_takes_two_seconds() {
    let mut bench = Bench::running("node_id = 32, program = 'attached'");
    bench.order(0, job::COP_MSTR_BOOTUP, &[3, 500, 9]);
    bench.run(500);
    assert_eq!(bench.registers.flags.CAN_OPEN.load(), 1);
    bench.run(2_000 * MS - 1_000);
    assert!(!bench.is_answered(0));
    bench.run(500);
    assert!(bench.is_answered(0));
}

/// Answers the SDOs of a configuration for module 3, with these values, until the order is answered.
fn configure(bench: &mut Bench, values: &mut [u8]) -> Vec<(u16, u8, bool)> {
    let mut asked = Vec::new();
    for _ in 0..40 {
        bench.run(2 * MS);
        let requests: Vec<_> = bench.heard().into_iter().filter(|(id, _)| *id == 0x603).collect();
        for (_, data) in requests {
            let (index, sub, is_write) = (u16::from_le_bytes([data[1], data[2]]), data[3], data[0] == 0x2F);
            asked.push((index, sub, is_write));
            let mut answer = [0x60, data[1], data[2], sub, 0, 0, 0, 0];
            let value = values.get_mut(usize::from(sub).wrapping_sub(1));
            match (value, is_write) {
                (Some(value), true) => *value = data[4],
                (Some(value), false) => (answer[0], answer[4]) = (0x4F, *value),
                (None, _) => {}
            }
            bench.send(0x583, &answer);
        }
        if bench.is_answered(0) {
            break;
        }
    }
    asked
}

/// Positions of a module's words.
fn word(bench: &Bench, number: u32) -> u32 {
    bench.segment.load(8192 + 2 * number, crate::layout::Width::Word).unwrap()
}

fn set_word(bench: &Bench, number: u32, value: u32) {
    bench.segment.store(8192 + 2 * number, crate::layout::Width::Word, value).unwrap();
}

#[test]
fn functions_for_modules_need_a_master() {
    let mut bench = Bench::running("program = 'attached'");
    for (function, arguments) in [
        (job::COP_MSTR_MAIN, &[3, 50, 1, 0][..]),
        (job::SLAVE_CR2010_WORK, &[1, 3]),
        (job::SLAVE_CR2011_WORK, &[1, 3]),
    ] {
        assert_eq!(bench.job(function, arguments).0, job_error::STATE, "{function:04X}");
    }
    for (function, arguments) in [
        (job::COP_MSTR_BOOTUP, &[0, 100, 3][..]),
        (job::COP_MSTR_BOOTUP, &[3, 65_536, 3]),
        (job::COP_MSTR_MAIN, &[0, 0, 0, 0]),
        (job::COP_MSTR_MAIN, &[3, 0, 2, 0]),
        (job::SLAVE_CR2010_CONFIG, &[33, 100, 1, 0]),
        (job::SLAVE_CR2010_WORK, &[0, 33]),
        (job::SLAVE_CR2011_WORK, &[2, 3]),
    ] {
        assert_eq!(bench.job(function, arguments).0, job_error::ARGUMENTS, "{function:04X} {arguments:?}");
    }
    assert_eq!(bench.job(0x0407, &[]).0, job_error::FUNCTION);
}

/// Manual p. 77-80: the master configures and starts a CR2010, and exchanges its words.
#[test]
fn a_cr2010_is_configured_and_its_words_are_exchanged() {
    let mut bench = booted();
    assert_eq!(bench.job(job::SLAVE_CR2010_CONFIG, &[4, 100, 1, 0]).0, job_error::ARGUMENTS, "no channels");
    let kinds = [1, 2, 0, 3, 0, 4, 0, 2];
    bench.order_with(0, job::SLAVE_CR2010_CONFIG, &[4, 100, 1, 0], &kinds);
    bench.run(MS);
    assert_eq!(bench.registers.jobs.a_ERROR[0].load(), job_error::STATE, "it was not added");
    bench.order_with(0, job::SLAVE_CR2010_CONFIG, &[3, 150, 1, 1], &kinds);
    let mut values = [0; 8];
    let asked = configure(&mut bench, &mut values);
    let expected = (1..=8).map(|sub| (0x2000, sub, true)).chain([(0x2001, 0, true)]);
    let expected: Vec<_> = expected.chain((1..=8).map(|sub| (0x2000, sub, false))).collect();
    assert_eq!((asked, values), (expected, kinds));
    assert_eq!((bench.registers.jobs.a_RESULT[0][0].load(), bench.answer_data()), (DONE, kinds.to_vec()));

    assert_eq!(bench.result(job::SLAVE_CR2010_WORK, &[1, 3]), 0, "it is not Operational");
    assert_eq!(bench.result(job::NMM_SET_OPERATIONAL, &[0]), 0);
    assert_eq!(bench.result(job::SLAVE_CR2011_WORK, &[1, 3]), 0, "it is a CR2010");
    bench.send(0x183, &[0b0000_0001]);
    bench.send(0x283, &[0, 0, 0x34, 0x12, 0, 0, 0, 0]);
    bench.run(5 * MS);
    bench.heard();
    set_word(&bench, 1031, 0xFFFF);
    set_word(&bench, 1035, 0x1234);
    set_word(&bench, 1037, 0xFFFE);
    assert_eq!(bench.result(job::SLAVE_CR2010_WORK, &[0, 3]), 1);
    assert_eq!([word(&bench, 1030), word(&bench, 1033), word(&bench, 1032)], [1, 0x1234, 0]);
    bench.run(5 * MS);
    let sent = [(0x203, vec![0b0000_0010]), (0x303, vec![0, 0, 0, 0, 0x34, 0x12, 0, 0])];
    assert_eq!(bench.heard(), sent, "bit 0 of a digital output's word");
    bench.result(job::SLAVE_CR2010_WORK, &[0, 3]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [], "nothing has changed");
    bench.result(job::NMM_SET_PREOPERATIONAL, &[3]);
    assert_eq!(bench.result(job::SLAVE_CR2010_WORK, &[0, 3]), 0);
    bench.result(job::NMM_SET_OPERATIONAL, &[3]);
    bench.heard();
    bench.result(job::SLAVE_CR2010_WORK, &[0, 3]);
    bench.run(5 * MS);
    assert_eq!(
        bench.heard().into_iter().filter(|(id, _)| *id != 0).collect::<Vec<_>>(),
        sent,
        "the module has restarted"
    );
}

/// Manual p. 81-85.
#[test]
fn a_cr2011_has_signed_setpoints_and_reports_its_current() {
    let mut bench = booted();
    bench.order_with(0, job::SLAVE_CR2011_CONFIG, &[3, 100, 1, 0], &[0; 4]);
    let asked = configure(&mut bench, &mut [4, 5, 2, 0]);
    assert_eq!(asked, [1, 2, 3, 4].map(|sub| (0x2000, sub, false)));
    assert_eq!(bench.answer_data(), [4, 5, 2, 0]);
    assert_eq!(Model::Cr2011.values(), 4);
    bench.result(job::NMM_SET_OPERATIONAL, &[0]);
    bench.heard();
    bench.send(0x283, &[0, 0, 0xF4, 1, 0, 0, 0, 0]);
    bench.run(5 * MS);
    set_word(&bench, 1030, 100);
    set_word(&bench, 1031, 7);
    set_word(&bench, 1032, 0xFE0C);
    set_word(&bench, 1035, 1);
    assert_eq!(bench.result(job::SLAVE_CR2011_WORK, &[0, 3]), 0, "INIT comes first");
    assert_eq!(bench.result(job::SLAVE_CR2011_WORK, &[1, 3]), 1);
    bench.run(5 * MS);
    let sent: Vec<_> = bench.heard().into_iter().filter(|(id, _)| *id != 0).collect();
    assert_eq!(sent, [(0x203, vec![0b0010_0000]), (0x303, vec![100, 0, 0x0C, 0xFE, 0, 0, 0, 0])]);
    assert_eq!([word(&bench, 1031), word(&bench, 1033)], [7, 500], "nothing, and the current");
}

/// Manual p. 77: no value of CFG_RESULT means an abort. So an aborted configuration counts as not finished
/// yet.
#[test]
fn a_refused_configuration_is_repeated_by_the_next_order() {
    let mut bench = booted();
    bench.order_with(0, job::SLAVE_CR2011_CONFIG, &[3, 100, 0, 1], &[9, 0, 0, 0]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x603, vec![0x2F, 0x00, 0x20, 1, 9, 0, 0, 0])]);
    bench.send(0x583, &[0x80, 0x00, 0x20, 1, 0x30, 0, 9, 6]);
    bench.run(5 * MS);
    assert!(bench.is_answered(0));
    let results = [0, 1].map(|number: usize| bench.registers.jobs.a_RESULT[0][number].load());
    assert_eq!(results, [NOT_YET, 0x0609_0030]);
    bench.order_with(0, job::SLAVE_CR2011_CONFIG, &[3, 100, 0, 1], &[4, 0, 0, 0]);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x603, vec![0x2F, 0x00, 0x20, 1, 4, 0, 0, 0])]);
    bench.registers.jobs.a_CONTROL[0].store(0);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x603, vec![0x80, 0x00, 0x20, 1, 0, 0, 4, 5])], "the order was withdrawn");
    bench.order_with(0, job::SLAVE_CR2011_CONFIG, &[3, 100, 1, 0], &[0; 4]);
    assert_eq!(configure(&mut bench, &mut [2; 4]).len(), 4);
    assert_eq!(bench.answer_data(), [2; 4]);
    assert_eq!(bench.job(job::SLAVE_CR2011_CONFIG, &[3, 100, 0, 0]).1[0], 0, "neither READ nor WRITE");
}

/// Manual p. 75-76.
#[test]
fn the_cyclic_block_sends_sync_and_notes_missing_nodes() {
    let mut bench = booted();
    let main = |bench: &mut Bench, automatic: u32, reset: u32| {
        bench.job(job::COP_MSTR_MAIN, &[3, 50, automatic, reset]);
        bench.answer_data()
    };
    let mut heard = Vec::new();
    for _ in 0..50 {
        main(&mut bench, 1, 0);
        bench.run(9 * MS);
        heard.extend(bench.heard());
    }
    let syncs = heard.iter().filter(|frame| **frame == (0x80, vec![])).count();
    assert!((9..=11).contains(&syncs), "every 50 ms: {syncs}");
    assert_eq!(main(&mut bench, 1, 0), [0; 8]);
    // The test answers for nodes 1 and 2, but never for node 3.
    for _ in 0..12 {
        bench.send(0x701, &[127]);
        bench.send(0x702, &[127]);
        bench.run(450 * MS);
        bench.send(0x701, &[255]);
        bench.send(0x702, &[255]);
        bench.run(50 * MS);
        main(&mut bench, 1, 0);
    }
    assert_eq!(main(&mut bench, 1, 0)[..2], [3, 0]);
    assert_eq!(main(&mut bench, 1, 1), [0; 8]);
    assert_eq!(main(&mut bench, 1, 0), [0; 8], "it was known before");
    bench.heard();
    bench.send(0x703, &[127]);
    bench.run(5 * MS);
    assert!(bench.heard().contains(&(0, vec![1, 3])), "AUTO_OPERATIONAL");
}
