//! For each rule of the device, one case that breaks it and a similar case that does not.

use super::*;
use crate::devices::can_dp2::emulation::rules;
use crate::door::BusMessage;
use crate::journal::Rule;
use crate::profibus::Telegram;

/// Returns the broken rules, each with the offset of the register in the image.
fn broken(bench: &Bench) -> Vec<(&'static str, u32)> {
    bench.journal.findings().iter().map(|entry| (entry.last.rule.id(), entry.last.offset)).collect()
}

/// Returns the offset of a name in the image, as a user writes it.
fn at(name: &str) -> u32 {
    let place =
        crate::layout::NamedLocation::parse(&crate::layout::DeviceFit::unknown(&DEVICE), name).unwrap();
    place.offset()
}

/// Starts a request and lets the program write registers before the answer.
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

/// Data exchange with these modules and a window.
fn with_window(cfg: &[u8]) -> Bench {
    Bench::exchanging(0x80, 0, cfg)
}

/// A foreign slave answers from this address.
fn answered_from(address: u8) -> Bench {
    let mut bench = exchanging(&CFG);
    assert!(bench.buses[0].guests().unwrap().guest_joins(1, bench.now));
    let (da, fc, dsap, ssap, data) = (1, 0, None, None, vec![]);
    let frame = crate::profibus::Frame { da, sa: address, fc, dsap, ssap, data };
    let message = BusMessage::burst(Telegram::Frame(frame).octets().unwrap());
    bench.buses[0].guests().unwrap().guest_sends(1, &message, bench.now, &mut bench.journal).unwrap();
    bench.run(MS);
    bench
}

/// Returns a bench in which a foreign master with this address has sent a request to another slave.
fn asked_from(address: u8) -> Bench {
    let mut bench = exchanging(&CFG);
    assert!(bench.buses[0].guests().unwrap().guest_joins(1, bench.now));
    let (da, fc, dsap, ssap, data) = (9, 0x49, None, None, vec![]);
    let frame = crate::profibus::Frame { da, sa: address, fc, dsap, ssap, data };
    let message = BusMessage::burst(Telegram::Frame(frame).octets().unwrap());
    bench.buses[0].guests().unwrap().guest_sends(1, &message, bench.now, &mut bench.journal).unwrap();
    bench.run(MS);
    bench
}

/// A master that has sent no request uses no address, so no other station can share its address (D-721).
#[test]
fn a_master_that_asks_nothing_shares_no_address() {
    let mut bench = Bench::new(5);
    assert!(bench.buses[0].guests().unwrap().guest_joins(1, bench.now));
    for _ in 0..2 {
        let frame = crate::profibus::Frame { da: 9, sa: 1, fc: 0x49, dsap: None, ssap: None, data: vec![] };
        let message = BusMessage::burst(Telegram::Frame(frame).octets().unwrap());
        bench.buses[0].guests().unwrap().guest_sends(1, &message, bench.now, &mut bench.journal).unwrap();
        bench.run(5 * MS);
    }
    assert_eq!(broken(&bench), []);
    bench.ask(60, &[]);
    assert_eq!(broken(&bench), [], "it has heard none since");
}

/// Manual p. 39: a window has one module in each direction, is consistent over its whole length, and has the
/// format byte 00. Figure 6.4.2 shows it without identifiers in page mode.
#[test]
fn each_wrong_window_is_reported() {
    let (input, output) = ([0x43, 0x8F, 0xFF, 0xEF, 0], [0x83, 0x8F, 0xFF, 0xEF, 0]);
    let is_found = |cfg: &[u8], number: usize| {
        let found = [("dp-window", at(&format!("cfg.module[{number}].id")))];
        assert_eq!(broken(&with_window(cfg)), found, "{cfg:02X?}");
    };
    assert_eq!(broken(&with_window(&[input, output].concat())), []);
    let mut loose = [input, output].concat();
    loose[6] = 0x0F;
    is_found(&loose, 1);
    let mut form = [output, input].concat();
    form[4] = 0x80;
    is_found(&form, 0);
    is_found(&[&CFG[..], &output].concat(), 2);
    is_found(&[&CFG[..], &input].concat(), 2);
    let pages = |windows: &[u8]| Bench::exchanging(0x81, 0, &[&[0x80, 0x9F, 0x40, 0x9F], windows].concat());
    assert_eq!(broken(&pages(&[0xAF, 0x9F])), []);
    assert_eq!(broken(&pages(&[0x80, 0x8F, 0x40, 0x8F])), []);
    assert_eq!(broken(&pages(&[0x2F, 0x9F])), [("dp-window", at("cfg.module[2].id"))]);
}

#[test]
fn each_rule_is_broken_by_its_case_alone_and_not_by_the_neighbour() {
    let cases: [(&Rule, &str, Bench, Bench); 10] = [
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
        (
            &rules::WINDOW,
            "cfg.module[1].id",
            with_window(&[0x83, 0x8F, 0xFF, 0xEF, 0, 0x43, 0x0F, 0xFF, 0xEF, 0]),
            with_window(&[0x83, 0x8F, 0xFF, 0xEF, 0, 0x43, 0x8F, 0xFF, 0xEF, 0]),
        ),
        (&rules::ADDRESS, "front.switches", answered_from(5), answered_from(6)),
        (&rules::MASTER_ADDRESS, "mst.mst_address", asked_from(1), asked_from(2)),
    ];
    for (rule, name, breaks, right) in &cases {
        assert_eq!(broken(breaks), [(rule.id(), at(name))]);
        assert_eq!(broken(right), [], "{}", rule.id());
    }
    let missing: Vec<_> =
        rules::ALL.iter().filter(|rule| cases.iter().all(|case| case.0 != **rule)).collect();
    assert_eq!(missing, Vec::<&&Rule>::new());
}
