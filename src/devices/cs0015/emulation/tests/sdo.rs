//! The object dictionary by SDO, identifiers, Node-ID and bit rate.

use super::*;
use crate::devices::canopen::sdo::Abort;
use crate::layout::object::{Access, Type};

/// Executes a transfer with the node of this Node-ID, as a client would do.
pub(super) fn transfer(bench: &mut Bench, node: u16, request: [u8; 8]) -> [u8; 8] {
    let heard = bench.exchange(0x600 + node, &request);
    let [(id, data)] = heard.as_slice() else { panic!("{request:X?}: {heard:X?}") };
    assert_eq!(*id, 0x580 + node, "{request:X?}");
    data.as_slice().try_into().unwrap()
}

pub(super) fn request(command: u8, index: u16, sub: u8, value: u32) -> [u8; 8] {
    let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
    [command, low, high, sub, a, b, c, d]
}

/// Writes `bytes` bytes to node 32.
pub(super) fn write(bench: &mut Bench, index: u16, sub: u8, value: u32, bytes: u8) -> Result<(), u32> {
    let command = 0x23 | (4 - bytes) << 2;
    let answer = transfer(bench, 32, request(command, index, sub, value));
    let abort_code = u32::from_le_bytes(answer[4..].try_into().unwrap());
    if answer[0] == 0x80 {
        return Err(abort_code);
    }
    assert_eq!(answer, request(0x60, index, sub, 0));
    Ok(())
}

/// Reads from node 32, in segments if necessary.
pub(super) fn read(bench: &mut Bench, index: u16, sub: u8) -> Result<Vec<u8>, u32> {
    let answer = transfer(bench, 32, request(0x40, index, sub, 0));
    if answer[0] == 0x80 {
        return Err(u32::from_le_bytes(answer[4..].try_into().unwrap()));
    }
    assert_eq!(answer[1..4], request(0, index, sub, 0)[1..4]);
    if answer[0] & 2 != 0 {
        return Ok(answer[4..8 - usize::from(answer[0] >> 2 & 3)].to_vec());
    }
    let mut value = Vec::new();
    for toggle in [0, 0x10].into_iter().cycle() {
        let answer = transfer(bench, 32, [0x60 | toggle, 0, 0, 0, 0, 0, 0, 0]);
        value.extend_from_slice(&answer[1..8 - usize::from(answer[0] >> 1 & 7)]);
        if answer[0] & 1 != 0 {
            break;
        }
    }
    Ok(value)
}

pub(super) fn number(bench: &mut Bench, index: u16, sub: u8) -> u32 {
    let value = read(bench, index, sub).unwrap();
    value.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}

#[test]
fn every_entry_has_the_default_of_the_manual() {
    let mut bench = Bench::running("");
    for object in DEVICE.objects {
        let value = read(&mut bench, object.index, object.sub);
        match (object.access, object.ty, object.default) {
            (Access::NotImplemented, ..) => assert_eq!(value, Err(Abort::NoObject.code()), "{object}"),
            (_, Some(Type::Domain), _) => assert_eq!(value, Ok(vec![0; 256]), "{object}"),
            (.., crate::layout::object::Default::Text(text)) => assert_eq!(value.unwrap(), text.as_bytes()),
            (_, ty, default) => {
                let bytes = ty.and_then(Type::bytes).unwrap();
                assert_eq!(value.unwrap(), default.at_node(32).to_le_bytes()[..bytes], "{object}");
            }
        }
    }
    let mut value = |index, sub| number(&mut bench, index, sub);
    assert_eq!((value(0x1000, 0), value(0x1005, 0), value(0x1014, 0)), (0x195, 0x8000_0080, 0x4000_00A0));
    assert_eq!((value(0x1400, 1), value(0x1800, 1), value(0x1807, 1)), (0x220, 0x1A0, 0x38F));
    for (index, sub, abort) in [
        (0x1002, 0, Abort::NoObject),
        (0x1003, 0, Abort::NoObject),
        (0x1007, 1, Abort::NoObject),
        (0x1400, 3, Abort::NoSub),
        (0x5800, 0, Abort::NoSub),
        (0xFFFF, 0, Abort::NoObject),
    ] {
        assert_eq!(read(&mut bench, index, sub), Err(abort.code()), "{index:X}");
    }
    assert_eq!(write(&mut bench, 0x1600, 1, 0, 4), Err(Abort::ReadOnly.code()));
    assert_eq!(write(&mut bench, 0x1001, 0, 0, 1), Err(Abort::ReadOnly.code()));
}

/// Manual p. 41, 45, 155.
#[test]
fn a_node_id_is_entered_twice_and_takes_effect_at_once() {
    let mut bench = Bench::running("");
    assert_eq!((number(&mut bench, 0x20F0, 0), number(&mut bench, 0x20F1, 0)), (32, 32));
    assert_eq!(write(&mut bench, 0x20F0, 0, 5, 1), Ok(()));
    assert_eq!((number(&mut bench, 0x100B, 0), bench.registers.flags.NODEID.load()), (32, 32));
    // The answer has the identifier that the master expects: the one before the change.
    assert_eq!(write(&mut bench, 0x20F1, 0, 5, 1), Ok(()));
    assert_eq!(bench.registers.flags.NODEID.load(), 5);
    let read_value = |bench: &mut Bench, index, sub| {
        let answer = transfer(bench, 5, request(0x40, index, sub, 0));
        u32::from_le_bytes(answer[4..].try_into().unwrap())
    };
    let all = [(0x1400, 1), (0x1401, 1), (0x1800, 1), (0x1801, 1), (0x1014, 0), (0x100E, 0), (0x1402, 1)];
    let expected = [0x205, 0x305, 0x185, 0x285, 0x4000_0085, 0x705, 0x382];
    assert_eq!(all.map(|(index, sub)| read_value(&mut bench, index, sub)), expected);
    assert_eq!(bench.exchange(0x620, &request(0x40, 0x1000, 0, 0)), []);
    bench.ask(0x705);
    bench.run(5 * MS);
    assert_eq!(bench.heard(), [(0x705, vec![0x7F])]);
    bench.power_cycle();
    assert_eq!((read_value(&mut bench, 0x100B, 0), bench.device.novram().unwrap().contents().0[21]), (5, 5));
    assert_eq!(transfer(&mut bench, 5, request(0x2F, 0x20F0, 0, 128))[0], 0x80);
}

/// Manual p. 41, 163.
#[test]
fn a_bit_rate_is_entered_twice_and_takes_effect_after_a_reset() {
    let mut bench = Bench::running("");
    let rate = |bench: &Bench| bench.registers.flags.CANBAUDRATE.load();
    assert_eq!(write(&mut bench, 0x20F2, 0, 2, 1), Ok(()));
    bench.power_cycle();
    assert_eq!((rate(&bench), number(&mut bench, 0x20F2, 0)), (125, 3), "one of them is not enough");
    for index in [0x20F2, 0x20F3] {
        assert_eq!(write(&mut bench, index, 0, 8, 1), Err(Abort::Value.code()));
        assert_eq!(write(&mut bench, index, 0, 2, 1), Ok(()));
    }
    assert_eq!((rate(&bench), bench.registers.parameters.w_KBIT_S.load()), (125, 250));
    bench.power_cycle();
    assert_eq!(rate(&bench), 250);
    // The bus has 125 kbit/s (D-433).
    assert_eq!(bench.exchange(0x620, &request(0x40, 0x1000, 0, 0)), []);
}

/// Decision D-433.
#[test]
fn a_device_with_another_bit_rate_neither_receives_nor_sends() {
    let mut bench = Bench::new("kbit_s = 250, boot_up = '700'");
    bench.run(250 * MS);
    bench.exchange(0, &[1, 0]);
    bench.registers.tx.a_TX_PDO[0][0].store(1);
    bench.run(50 * MS);
    assert_eq!((bench.heard(), bench.stat()), (vec![], "green 0.5 Hz".into()));
}

/// Manual p. 42, 163.
#[test]
fn retained_data_are_transferred_in_segments() {
    let mut bench = Bench::running("");
    let value: Vec<u8> = (0..=255).collect();
    assert_eq!(transfer(&mut bench, 32, request(0x21, 0x2000, 0, 256))[0], 0x60);
    let segments = value.chunks(7).count();
    for (number, chunk) in value.chunks(7).enumerate() {
        let mut segment = [0; 8];
        segment[0] =
            ((number % 2) as u8) << 4 | ((7 - chunk.len()) as u8) << 1 | u8::from(number + 1 == segments);
        segment[1..=chunk.len()].copy_from_slice(chunk);
        assert_eq!(transfer(&mut bench, 32, segment)[0] & 0xE0, 0x20, "{number}");
    }
    assert_eq!(bench.registers.retain(), value);
    bench.power_cycle();
    assert_eq!(read(&mut bench, 0x2000, 0), Ok(value));
    let answer = transfer(&mut bench, 32, request(0x21, 0x2000, 0, 257));
    assert_eq!(answer, request(0x80, 0x2000, 0, Abort::TooLong.code()));
}

/// Manual p. 155: the device saves exactly these values.
#[test]
fn saved_entries_survive_a_power_cycle() {
    let mut bench = Bench::running("");
    let saved = [
        (0x1005, 0, 0x90, 4),
        (0x1006, 0, 200_000, 4),
        (0x100C, 0, 100, 2),
        (0x100D, 0, 3, 1),
        (0x100E, 0, 0x6F0, 4),
        (0x1014, 0, 0x4000_00B0, 4),
    ];
    let others = [(0x1400, 1, 0x3A0, 4), (0x1400, 2, 1, 1), (0x1807, 1, 0x3A1, 4), (0x1807, 2, 240, 1)];
    for (index, sub, value, bytes) in saved.into_iter().chain(others) {
        assert_eq!(write(&mut bench, index, sub, value, bytes), Ok(()), "{index:X}");
        assert_eq!(number(&mut bench, index, sub), value, "{index:X}");
    }
    bench.power_cycle();
    for (index, sub, value, _) in saved {
        assert_eq!(number(&mut bench, index, sub), value, "{index:X}");
    }
    for (index, sub, ..) in others {
        let default = DEVICE.object(index, sub).unwrap().default.at_node(32);
        assert_eq!(number(&mut bench, index, sub), default, "{index:X}");
    }
}

#[test]
fn invalid_requests_are_refused() {
    let mut bench = Bench::running("");
    for (index, sub, value, bytes, abort) in [
        (0x1005, 0, 0x2000_0080, 4, Abort::Value),
        (0x1014, 0, 0x4000_0000, 4, Abort::Value),
        (0x1400, 1, 0x800, 4, Abort::Value),
        (0x1400, 2, 252, 1, Abort::Value),
        (0x1400, 2, 241, 1, Abort::Value),
        (0x1400, 2, 1, 2, Abort::TooLong),
        (0x100C, 0, 1, 1, Abort::TooShort),
        (0x20F0, 0, 0, 1, Abort::Value),
    ] {
        assert_eq!(write(&mut bench, index, sub, value, bytes), Err(abort.code()), "{index:X} {value:X}");
    }
}

/// The node answers in Pre-Operational and Operational only.
#[test]
fn a_prepared_node_serves_no_sdo() {
    let mut bench = Bench::running("");
    bench.exchange(0, &[2, 0]);
    assert_eq!(bench.exchange(0x620, &request(0x40, 0x1000, 0, 0)), []);
    bench.exchange(0, &[1, 0]);
    assert_eq!(number(&mut bench, 0x1000, 0), 0x195);
}

#[test]
fn words_of_pdos_are_entries() {
    let mut bench = Bench::running("");
    bench.registers.rx.a_RX_PDO[7][3].store(0xABCD);
    assert_eq!(number(&mut bench, 0x5870, 4), 0xABCD);
    assert_eq!(write(&mut bench, 0xA103, 2, 0x1234, 2), Ok(()));
    assert_eq!(bench.registers.tx.a_TX_PDO[3][1].load(), 0x1234);
}
