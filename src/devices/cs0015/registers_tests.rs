//! Tests properties of the CS0015's layout: the addresses of the manual, flags, object dictionary.

use super::registers::DEVICE;
use crate::layout::object::{Access, Default, Type};
use crate::layout::{DeviceFit, NamedLocation, Owner};

fn address(name: &str) -> String {
    DEVICE.register(name).unwrap().address().to_string()
}

fn offset(address: &str) -> u32 {
    NamedLocation::parse(&DeviceFit::unknown(&DEVICE), address).unwrap().offset()
}

/// Manual p. 152-154.
#[test]
fn addresses_match_the_manual() {
    for (name, expected) in [
        ("inputs.I0", "%IW0"),
        ("inputs.S2", "%IB2"),
        ("outputs.Q0", "%QW0"),
        ("function.a_FUNCTION[0]", "%MW128"),
        ("function.a_FUNCTION[383]", "%MW511"),
        ("rx_pdo.a_RX_PDO[0][0]", "%MW2000"),
        ("rx_pdo.a_RX_PDO[7][3]", "%MW2031"),
        ("tx_pdo.a_TX_PDO[0][0]", "%MW2032"),
        ("tx_pdo.a_TX_PDO[7][3]", "%MW2063"),
        ("flags.ERROR", "%MB7936"),
    ] {
        assert_eq!(address(name), expected, "{name}");
    }
    // S3 is %IX1.8, S4 %IX2.0, S5 %IX2.8.
    for (name, bit) in [("inputs.S3", "%IX1.8"), ("inputs.S4", "%IX2.0"), ("inputs.S5", "%IX2.8")] {
        assert_eq!(offset(&address(name)), offset(bit), "{name}");
    }
    assert_eq!(DEVICE.retain.unwrap().area.bytes, 256, "%MB0 to %MB255, p. 107");
}

/// Manual p. 107, 154: %MW0 to %MW4095 are the flags, and each flag is in an area.
#[test]
fn every_flag_has_an_address() {
    for word in 0..4096 {
        let place = NamedLocation::parse(&DeviceFit::unknown(&DEVICE), &format!("%MW{word}")).unwrap();
        assert_eq!(place.offset(), 8192 + 2 * word);
    }
    assert!(DEVICE.address("%MW4096").is_ok_and(|it| DEVICE.area_at(it).unwrap().name == "jobs"), "D-434");
}

/// Manual p. 71.
#[test]
fn the_numbers_of_slave_words_contain_node_and_connector() {
    for (node, connector, expected) in [(1, 3, "%MW1012"), (2, 8, "%MW1027"), (32, 8, "%MW1327")] {
        let name = format!("slaves.a_SLAVE[{}][{}]", node - 1, connector - 1);
        assert_eq!(address(&name), expected);
    }
}

/// Manual p. 152.
#[test]
fn there_are_36_system_flags() {
    let flags = DEVICE.area("flags").unwrap().structures[0].structure.registers;
    assert_eq!(flags.len(), 36);
    assert_eq!(flags.iter().filter(|flag| flag.meaning.is_some_and(|it| it.name == "bool")).count(), 33);
    assert!(flags.iter().all(|flag| !flag.name.starts_with("TEXT_KEY") || flag.owner == Owner::Firmware));
}

#[test]
fn the_object_dictionary_matches_the_manual() {
    // The manual has 155 printed rows with index and sub-index. The words of the PDOs are added.
    assert_eq!(DEVICE.objects.len(), 155 + 64);
    let object = |index, sub| DEVICE.object(index, sub).unwrap();
    assert_eq!(object(0x1000, 0).default, Default::Number(0x195));
    assert_eq!(object(0x1800, 1).default.at_node(32), 0x1A0);
    assert_eq!(object(0x1403, 1).default.at_node(32), 0x383);
    assert_eq!(object(0x1807, 1).default.at_node(32), 0x38F);
    assert_eq!(object(0x1600, 0).ty, Some(Type::U32), "as printed");
    assert_eq!(object(0x1007, 0).access, Access::NotImplemented);
    assert!(object(0x20F0, 0).saved && !object(0x1400, 1).saved);
    assert_eq!(DEVICE.object(0x1400, 3), None);
    assert!(DEVICE.has_index(0x1400) && !DEVICE.has_index(0x1002) && !DEVICE.has_index(0xFFFF));
    assert_eq!(object(0x1801, 1).to_string(), "1801h sub 1 COB ID");
}
