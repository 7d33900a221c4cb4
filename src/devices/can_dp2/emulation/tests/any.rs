//! After any telegrams of a master, the slave has a valid state, and a diagnosis that names the reason.

use super::*;
use crate::devices::can_dp2::registers::values::dp_state;
use proptest::prelude::*;

/// Octets of Set_Prm: either valid octets, some of which are changed, or random octets.
fn parameters() -> impl Strategy<Value = Vec<u8>> {
    let changes = prop::collection::vec((0..16_usize, any::<u8>()), 0..3);
    let almost = (any::<u8>(), 0..8_u8, changes).prop_map(|(flags_1, flags_2, changes)| {
        let mut octets = prm(flags_1 & 0x97, flags_2);
        changes.into_iter().for_each(|(number, octet)| octets[number] = octet);
        octets
    });
    prop_oneof![4 => almost, 1 => prop::collection::vec(any::<u8>(), 0..=244)]
}

/// Octets of Chk_Cfg: valid or almost valid modules, segments of pages, valid modules of which the last is
/// cut off, or random octets.
fn configuration() -> impl Strategy<Value = Vec<u8>> {
    let of_can =
        |(is_input, length, high, low)| vec![if is_input { 0x43 } else { 0x83 }, length, high, low, 0xB8];
    let module = prop_oneof![
        (any::<bool>(), 0..10_u8, 0..9_u8, any::<u8>()).prop_map(of_can),
        any::<bool>().prop_map(|is_input| vec![if is_input { 0x43 } else { 0x83 }, 0x8F, 0xFF, 0xEF, 0]),
        any::<bool>().prop_map(|is_input| vec![if is_input { 0x40 } else { 0x80 }, 0x9F]),
        any::<u8>().prop_map(|octet| vec![octet]),
    ];
    let modules = prop::collection::vec(module, 0..12).prop_map(|modules| modules.concat());
    let good = (any::<bool>(), Just(7), Just(1), any::<u8>()).prop_map(of_can);
    let good = prop::collection::vec(good, 1..12).prop_map(|modules| modules.concat());
    let cut_off = (good, 1..5_usize).prop_map(|(mut octets, cut)| {
        octets.truncate(octets.len() - cut);
        octets
    });
    prop_oneof![4 => modules, 1 => cut_off, 1 => prop::collection::vec(any::<u8>(), 0..=244)]
}

/// Checks for any parameters, configuration and outputs that the slave has a valid state, and a diagnosis
/// that names the reason.
fn check_state_and_diagnosis(prm: &[u8], cfg: &[u8], outputs: &[u8]) {
    let mut bench = Bench::new(5);
    assert_eq!(bench.ask(61, prm).0, mst_result::RECEIPT);
    let after_prm = bench.diag();
    assert_eq!(bench.ask(62, cfg).0, mst_result::RECEIPT);
    let diag = bench.diag();
    let state = bench.registers.diag.dp_state.load();
    assert!((dp_state::WAIT_PRM..=dp_state::DATA_EXCHANGE).contains(&state));
    for diag in [&after_prm, &diag] {
        assert!([6, 11].contains(&diag.len()), "{:02X?}", diag);
        assert_eq!(&diag[4..6], &[0x04, 0xA4]);
    }
    // If an error bit of the diagnosis is set, the octets name the reason. Each refusal sets its error bit.
    let cause = diag.get(8).copied();
    assert_eq!(diag[0] & 0x40 != 0, cause == Some(0x3D));
    assert_eq!(diag[0] & 0x04 != 0, cause == Some(0x3E));
    assert_eq!(diag[0] & 0x02 != 0, state != dp_state::DATA_EXCHANGE);
    assert_eq!(diag[1] & 0x01 != 0, state == dp_state::WAIT_PRM);
    if cause == Some(0x3E) {
        assert!((1..=6).contains(&diag[10]) && diag[9] <= 48, "{:02X?}", diag);
    }
    // In any state, outputs are accepted or refused, and the emulation continues.
    let result = bench.ask(255, outputs).0;
    let fits = outputs.is_empty() || outputs.len() == usize::from(bench.registers.cfg.output_len.load());
    assert_eq!(result == mst_result::NOT_ACTIVATED, state != dp_state::DATA_EXCHANGE || !fits);
    let after = bench.registers.diag.dp_state.load();
    assert!((dp_state::WAIT_PRM..=dp_state::DATA_EXCHANGE).contains(&after), "{after} after outputs");
    let diag = bench.diag();
    assert!([6, 11].contains(&diag.len()), "{diag:02X?}");
    assert_eq!(diag[0] & 0x02 != 0, after != dp_state::DATA_EXCHANGE);
    bench.run(10 * MS);
}

/// The input of the fuzzer: the lengths of parameters and configuration, then the octets of parameters,
/// configuration and outputs.
#[test]
fn fuzz_dp_slave() {
    crate::fuzz("dp_slave", |bytes| {
        let [prm, cfg, rest @ ..] = bytes else { return };
        let part = |rest: &mut &[u8], len: usize| {
            let (part, following) = rest.split_at(len.min(rest.len()).min(244));
            *rest = following;
            part.to_vec()
        };
        let rest = &mut &*rest;
        let (prm, cfg, outputs) = (part(rest, (*prm).into()), part(rest, (*cfg).into()), part(rest, 244));
        check_state_and_diagnosis(&prm, &cfg, &outputs);
    });
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn any_octets_lead_to_a_state_and_a_diagnosis(
        prm in parameters(),
        cfg in configuration(),
        outputs in prop::collection::vec(any::<u8>(), 0..=244),
    ) {
        check_state_and_diagnosis(&prm, &cfg, &outputs);
    }
}
