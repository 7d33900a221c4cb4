//! For each rule of the device something that breaks it, and next to it something much alike that is right.

use super::*;
use crate::devices::can_dp2::rules;
use crate::journal::Rule;

/// The rules that have been broken, and at which bytes of the image.
fn broken(bench: &Bench) -> Vec<(&'static str, u32)> {
    bench.journal.findings().iter().map(|entry| (entry.last.rule.id(), entry.last.offset)).collect()
}

/// Names where in the image, as a user does.
fn at(name: &str) -> u32 {
    let place = crate::layout::Place::parse(&crate::layout::Fitted::unknown(&DEVICE), name).unwrap();
    place.offset()
}

/// Starts a request and lets the program write something before it has its answer.
fn meddled(write: impl FnOnce(&CAN_DP2_MST)) -> Bench {
    let mut bench = Bench::exchanging(0, 0, &CFG);
    bench.mst.mst_dsap.store(255);
    bench.mst.mst_request_len.store(2);
    bench.mst.mst_control.store(mst_control::SEND);
    bench.run(CYCLE);
    write(&bench.mst);
    bench.run(10 * MS);
    bench
}

fn exchanging(cfg: &[u8]) -> Bench {
    Bench::exchanging(0, 0, cfg)
}

fn asked(dsap: u8, octets: &[u8]) -> Bench {
    let mut bench = exchanging(&CFG);
    bench.ask(dsap, octets);
    bench
}

#[test]
fn each_rule_is_broken_by_its_case_alone_and_not_by_the_neighbour() {
    let cases: [(&Rule, &str, Bench, Bench); 7] = [
        (&rules::REQUEST, "mst.mst_dsap", asked(54, &[]), asked(55, &[])),
        (
            &rules::REQUEST_CHANGED,
            "mst.mst_dsap",
            meddled(|mst| mst.mst_request[1].store(7)),
            meddled(|mst| mst.mst_request[2].store(7)),
        ),
        (
            &rules::CONTROL_TAKEN,
            "mst.mst_control",
            meddled(|mst| mst.mst_control.store(0)),
            meddled(|mst| mst.mst_control.store(mst_control::SEND)),
        ),
        (&rules::OUTPUT_LENGTH, "outputs.outputs[0]", asked(255, &[1]), asked(255, &[1, 2])),
        (&rules::SWITCHES, "front.switches", Bench::new(0x7D), Bench::new(0x7C)),
        (
            &rules::NO_OUTPUT,
            "cfg.output_len",
            exchanging(&[0x43, 0, 1, 0, 0]),
            exchanging(&[0x43, 0, 1, 0, 0, 0x83, 0, 7, 0xF8, 0]),
        ),
        (
            &rules::RX_TWICE,
            "cfg.module[1].id",
            exchanging(&[0x83, 0, 7, 0xF8, 0, 0x43, 0, 1, 0, 0, 0x43, 0, 1, 0, 0]),
            exchanging(&[0x83, 0, 7, 0xF8, 0, 0x43, 0, 1, 0, 0, 0x43, 0, 1, 1, 0]),
        ),
    ];
    for (rule, name, breaks, right) in &cases {
        assert_eq!(broken(breaks), [(rule.id(), at(name))]);
        assert_eq!(broken(right), [], "{}", rule.id());
    }
    let missing: Vec<_> =
        rules::ALL.iter().filter(|rule| cases.iter().all(|case| case.0 != **rule)).collect();
    assert_eq!(missing, Vec::<&&Rule>::new());
}
