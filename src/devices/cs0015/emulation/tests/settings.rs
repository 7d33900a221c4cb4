//! Tests settings of the object dictionary: when they take effect, and whether they are stored (p. 155-163).

use super::sdo::{number, request, transfer, write};
use super::*;
use crate::layout::object::{Access, Type};

/// Returns another value for each writable number. The exceptions are numbers in the tests of SDO, Node-ID
/// and bit rate.
fn other_value(index: u16, sub: u8) -> Option<u32> {
    let pdo = u32::from(index & 7);
    Some(match (index, sub) {
        (0x1005, 0) => 0x90,
        (0x1006, 0) => 200_000,
        (0x100C, 0) => 100,
        (0x100D, 0) => 3,
        (0x100E, 0) => 0x6F0,
        (0x1014, 0) => 0x4000_00B0,
        (0x1400..=0x1407, 1) => 0x3A0 + pdo,
        (0x1800..=0x1807, 1) => 0x3B0 + pdo,
        (0x1400..=0x1407 | 0x1800..=0x1807, 2) => 1 + pdo,
        (0x5800..=0x5870 | 0xA100..=0xA107, _) => 0x1234,
        (0x1200, _) | (0x20F0..=0x20F3, _) => return None,
        _ => panic!("{index:X}h sub {sub} is not in the list of p. 155-163"),
    })
}

/// Entries that p. 155 lists as saved. A reset of the communication sets all others to their defaults, except
/// the words of PDOs, which are flags of the program.
const SAVED: [u16; 6] = [0x1005, 0x1006, 0x100C, 0x100D, 0x100E, 0x1014];

/// Manual p. 155-163: every writable row.
#[test]
fn each_setting_is_stored_or_not_as_in_the_list() {
    let mut bench = Bench::running("");
    let all: Vec<_> = DEVICE
        .objects
        .iter()
        .filter(|object| object.access == Access::ReadWrite && object.ty != Some(Type::Domain))
        .filter_map(|object| Some((object, other_value(object.index, object.sub)?)))
        .collect();
    assert_eq!(all.len(), 6 + 32 + 64);
    let write_all = |bench: &mut Bench| {
        for (object, value) in &all {
            let bytes = object.ty.and_then(Type::bytes).unwrap() as u8;
            assert_eq!(write(bench, object.index, object.sub, *value, bytes), Ok(()), "{object}");
            assert_eq!(number(bench, object.index, object.sub), *value, "{object} reads as it was written");
        }
    };
    write_all(&mut bench);
    bench.exchange(0, &[130, 0]);
    for (object, value) in &all {
        let is_word = object.index >= 0x2000;
        let is_left = is_word || SAVED.contains(&object.index);
        let expected = if is_left { *value } else { object.default.at_node(32) };
        assert_eq!(
            number(&mut bench, object.index, object.sub),
            expected,
            "{object}, reset of the communication"
        );
    }
    write_all(&mut bench);
    bench.power_cycle();
    for (object, value) in &all {
        let is_saved = SAVED.contains(&object.index);
        assert_eq!(object.saved, is_saved, "{object}");
        let expected = if is_saved { *value } else { object.default.at_node(32) };
        assert_eq!(number(&mut bench, object.index, object.sub), expected, "{object}, supply off and on");
    }
}

/// Requests the state with this identifier.
fn guard(bench: &mut Bench, id: u16) -> Vec<(u16, Vec<u8>)> {
    bench.ask(id);
    bench.run(5 * MS);
    bench.heard()
}

/// Manual p. 155: COB-IDs take effect at once, also in Operational.
#[test]
fn identifiers_take_effect_at_once() {
    let mut bench = Bench::operational("");
    for (index, sub, value) in [
        (0x1005, 0, 0x90),
        (0x100E, 0, 0x6F0),
        (0x1014, 0, 0x4000_00B0),
        (0x1400, 1, 0x3A0),
        (0x1402, 1, 0x3A2),
        (0x1800, 1, 0x3B0),
        (0x1807, 1, 0x3B7),
    ] {
        assert_eq!(write(&mut bench, index, sub, value, 4), Ok(()));
    }
    let mut sees_sync = |id| {
        bench.send(id, &[]);
        (0..25).any(|_| {
            bench.run(MS);
            bench.registers.flags.COP_SYNC.load() == 1
        })
    };
    assert!(!sees_sync(0x80) && sees_sync(0x90));
    assert_eq!((guard(&mut bench, 0x720), guard(&mut bench, 0x6F0)), (vec![], vec![(0x6F0, vec![5])]));
    for (pdo, id, before) in [(0, 0x3A0, 0x220), (2, 0x3A2, 0x382)] {
        bench.exchange(before, &[1; 8]);
        assert_eq!(bench.registers.rx.a_RX_PDO[pdo][0].load(), 0);
        bench.exchange(id, &[1; 8]);
        assert_eq!(bench.registers.rx.a_RX_PDO[pdo][0].load(), 0x0101);
    }
    for (pdo, id) in [(0, 0x3B0), (7, 0x3B7)] {
        bench.registers.tx.a_TX_PDO[pdo][0].store(1);
        bench.run(20 * MS);
        assert_eq!(bench.heard(), [(id, vec![1, 0, 0, 0, 0, 0, 0, 0])]);
    }
    bench.registers.flags.ERROR.store(1);
    bench.run(5 * MS);
    assert_eq!(bench.heard()[0].0, 0xB0);
}

/// Manual p. 157: the identifiers of the SDO take effect at once and are not stored.
#[test]
fn identifiers_of_the_sdo_take_effect_at_once() {
    let mut bench = Bench::running("");
    assert_eq!(write(&mut bench, 0x1200, 1, 0x650, 4), Ok(()));
    assert_eq!(bench.exchange(0x620, &request(0x40, 0x1000, 0, 0)), []);
    let answer = bench.exchange(0x650, &request(0x23, 0x1200, 2, 0x5F0));
    assert_eq!(answer[0].0, 0x5A0, "the answer has the identifier that the client expects");
    assert_eq!(bench.exchange(0x650, &request(0x40, 0x1000, 0, 0))[0].0, 0x5F0);
    bench.power_cycle();
    assert_eq!(transfer(&mut bench, 32, request(0x40, 0x1000, 0, 0))[0], 0x43);
}

/// Manual p. 42, 155: a node that was guarded at least once supervises its master as soon as both times are
/// set.
#[test]
fn guarding_times_take_effect_at_once() {
    let mut bench = Bench::running("");
    assert_eq!(guard(&mut bench, 0x720).len(), 1);
    assert_eq!(write(&mut bench, 0x100C, 0, 100, 2), Ok(()));
    assert_eq!(write(&mut bench, 0x100D, 0, 3, 1), Ok(()));
    let begun = bench.now;
    while bench.now < begun + 280 * MS {
        // SDOs do not count as guarding.
        number(&mut bench, 0x1000, 0);
    }
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 0);
    bench.run(25 * MS);
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 1);
    // A shorter time takes effect at once.
    let mut bench = Bench::running("guarding = { guard_time_ms = 1000, life_time = 2 }");
    guard(&mut bench, 0x720);
    assert_eq!(write(&mut bench, 0x100C, 0, 10, 2), Ok(()));
    bench.run(25 * MS);
    assert_eq!(bench.registers.flags.COP_GUARDFAIL_ERROR.load(), 1);
}

/// Manual p. 155-156.
#[test]
fn the_communication_cycle_takes_effect_at_once() {
    let mut bench = Bench::operational("");
    assert_eq!(write(&mut bench, 0x1006, 0, 100_000, 4), Ok(()));
    bench.run(90 * MS);
    assert_eq!(bench.registers.flags.COP_SYNCFAIL_ERROR.load(), 0);
    bench.run(15 * MS);
    assert_eq!(bench.registers.flags.COP_SYNCFAIL_ERROR.load(), 1);
    assert_eq!(bench.heard(), [(0xA0, vec![0x00, 0x82, 0x10, 2, 0, 0, 0, 0])]);
    let heard = bench.exchange(0x620, &request(0x23, 0x1006, 0, 0));
    assert_eq!(heard, [(0x5A0, request(0x60, 0x1006, 0, 0).to_vec()), (0xA0, vec![0; 8])], "off again");
}

/// Manual p. 155: a transmission type takes effect at the next start of Operational.
#[test]
fn transmission_types_take_effect_in_the_next_operational() {
    let mut bench = Bench::operational("");
    let id = |bench: &mut Bench, index| number(bench, index, 1) as u16;
    for pdo in 0..8_u16 {
        for index in [0x1400 + pdo, 0x1800 + pdo] {
            assert_eq!(write(&mut bench, index, 2, 1, 1), Ok(()));
            assert_eq!(number(&mut bench, index, 2), 1, "it reads as it was written");
        }
    }
    let received = |bench: &Bench, pdo: u16| bench.registers.rx.a_RX_PDO[usize::from(pdo)][0].load();
    let change =
        |bench: &Bench, pdo: u16, value| bench.registers.tx.a_TX_PDO[usize::from(pdo)][0].store(value);
    for pdo in 0..8 {
        let to = id(&mut bench, 0x1400 + pdo);
        bench.exchange(to, &[1; 8]);
        assert_eq!(received(&bench, pdo), 0x0101, "asynchronous still, {pdo}");
        change(&bench, pdo, 1);
        bench.run(20 * MS);
        assert_eq!(bench.heard().len(), 1, "asynchronous still, {pdo}");
    }
    bench.exchange(0, &[128, 0]);
    bench.exchange(0, &[1, 0]);
    for pdo in 0..8 {
        let to = id(&mut bench, 0x1400 + pdo);
        bench.exchange(to, &[2; 8]);
        change(&bench, pdo, 2);
        bench.run(20 * MS);
        assert_eq!((received(&bench, pdo), bench.heard()), (0x0101, vec![]), "waits for SYNC, {pdo}");
    }
    bench.send(0x80, &[]);
    bench.run(15 * MS);
    assert_eq!(bench.heard().len(), 8);
    assert!((0..8).all(|pdo| received(&bench, pdo) == 0x0202));
    // A type that is written in Pre-Operational takes effect in the next Operational.
    bench.exchange(0, &[128, 0]);
    assert_eq!(write(&mut bench, 0x1800, 2, 255, 1), Ok(()));
    bench.exchange(0, &[1, 0]);
    change(&bench, 0, 3);
    bench.run(20 * MS);
    assert_eq!(bench.heard().len(), 1);
}

/// Manual p. 7, 21, 41: bit rates from 10 to 1000 kbit/s are valid. No invalid value of a parameter is stored
/// (D-661).
#[test]
fn an_invalid_value_is_replaced_by_the_stored_one() {
    let mut bench = Bench::running("");
    assert_eq!(write(&mut bench, 0x100E, 0, 0x6F0, 4), Ok(()));
    for index in [0x20F2, 0x20F3] {
        assert_eq!(write(&mut bench, index, 0, 3, 1), Ok(()));
    }
    let stored = bench.device.novram().unwrap().contents().0.to_vec();
    let wrong = |bench: &Bench| {
        let parameters = &bench.registers.parameters;
        parameters.w_KBIT_S.store(1);
        parameters.b_NODE_ID.store(128);
        parameters.d_COB_ID_SYNC.store(0x800);
        parameters.d_COB_ID_GUARDING.store(0x2000_0001);
        parameters.d_COB_ID_EMCY.store(0x4000_0000);
        parameters.b_OPERATING_SYSTEM.store(2);
    };
    wrong(&bench);
    bench.run(MS);
    assert_eq!(
        (bench.registers.parameters.w_KBIT_S.load(), bench.device.novram().unwrap().contents().0),
        (125, &stored[..])
    );
    wrong(&bench);
    bench.power_cycle();
    assert_eq!(
        (bench.registers.flags.CANBAUDRATE.load(), bench.device.novram().unwrap().contents().0),
        (125, &stored[..])
    );
    assert_eq!((number(&mut bench, 0x100B, 0), number(&mut bench, 0x100E, 0)), (32, 0x6F0));
    bench.registers.parameters.w_KBIT_S.store(250);
    bench.run(MS);
    assert_eq!(
        bench.device.novram().unwrap().contents().0[18..20],
        250_u16.to_le_bytes(),
        "valid values are stored"
    );
}
