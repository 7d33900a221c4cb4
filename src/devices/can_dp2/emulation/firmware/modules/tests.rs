//! Configurations octet by octet.

use super::*;
use crate::devices::can_dp2::emulation::firmware::parameters::LENGTH;
use proptest::prelude::*;

/// Returns valid parameters with these flags.
fn parameters(flags_1: u8, flags_2: u8) -> Parameters {
    let mut octets = [0; LENGTH];
    octets[4..6].copy_from_slice(&[0x04, 0xA4]);
    (octets[8], octets[9], octets[11]) = (6, flags_1, flags_2);
    Parameters::parse(&octets).unwrap()
}

fn read(octets: &[u8]) -> Result<Configuration, CfgFault> {
    Configuration::parse(octets, &parameters(0x80, 0))
}

fn only(octets: &[u8]) -> Module {
    let configuration = read(octets).unwrap();
    assert_eq!(configuration.modules.len(), 1, "{configuration:?}");
    configuration.modules[0]
}

fn error(octets: &[u8]) -> (u8, u8) {
    let fault = read(octets).unwrap_err();
    (fault.module, fault.error as u8)
}

fn standard(id: u16) -> Id {
    StandardId::new(id).unwrap().into()
}

#[test]
fn modules_of_the_manual() {
    let output = |id, cycle_ms| ModuleFunction::Output { id, cycle_ms };
    let extended: Id = ExtendedId::new(0x12_3456).unwrap().into();
    for (octets, kind, length, form) in [
        (&[0x83, 5, 2, 3, 0][..], output(standard(0x203), 0), 6, 0),
        (&[0x83, 0x87, 3, 9, 0xB8], output(standard(0x309), 0), 8, 0xB8),
        (&[0x85, 0x87, 3, 9, 0xB8, 3, 0xE8], output(standard(0x309), 1000), 8, 0xB8),
        (&[0x85, 0x87, 0x20, 0x12, 0x34, 0x56, 0xB8], output(extended, 0), 8, 0xB8),
        (&[0x87, 0x87, 0x20, 0x12, 0x34, 0x56, 0xB8, 3, 0xE8], output(extended, 1000), 8, 0xB8),
        (
            &[0x43, 0x85, 2, 0x89, 0xB8],
            ModuleFunction::Input { id: standard(0x289), is_frozen: false },
            6,
            0xB8,
        ),
        (&[0x83, 0x80, 7, 0xF8, 0], ModuleFunction::Dummy, 1, 0),
        (&[0x43, 0x8F, 0xFF, 0xEF, 0], ModuleFunction::WindowInput, 16, 0),
    ] {
        let module = only(octets);
        assert_eq!((module.kind, module.length, module.form), (kind, length, form), "{octets:02X?}");
    }
    let window = read(&[0x85, 0x8F, 0xFF, 0xEF, 0, 3, 0xE8]).unwrap();
    assert_eq!(
        (window.modules[0].kind, window.sync_ms, window.outputs),
        (ModuleFunction::WindowOutput, Some(1000), 16)
    );
}

/// Checks each code of p. 21, with the number of the wrong module.
#[test]
fn each_fault_has_its_code() {
    let good = [0x83, 5, 2, 3, 0];
    for (octets, code) in [
        (&[0xC3, 5, 2, 3, 0][..], 1),
        (&[0x03, 5, 2, 3, 0], 1),
        (&[0x00], 1),
        (&[0x83, 0x45, 2, 3, 0], 2),
        (&[0x83, 9, 2, 3, 0], 3),
        (&[0x83, 15, 2, 3, 0], 3),
        (&[0x83], 3),
        (&[0x85, 0x87, 0xFF, 0xEF, 0, 0, 0], 3),
        (&[0x81, 5, 2], 4),
        (&[0x80, 5], 4),
        (&[0xA8], 4),
        (&[0x82, 5, 2, 4], 5),
        (&[0x84, 5, 0x20, 0, 1, 2], 5),
        (&[0x83, 5, 8, 0, 0], 6),
        (&[0x83, 5, 0x20, 0, 1], 6),
        (&[0x84, 5, 2, 4, 0, 1], 6),
        (&[0x45, 5, 2, 4, 0, 1, 0], 6),
        (&[0x43, 5, 2, 3, 0], 6),
    ] {
        assert_eq!(error(&[&good[..], octets].concat()), (1, code), "{octets:02X?}");
    }
}

#[test]
fn there_is_one_window_in_each_direction_if_enabled() {
    let (input, output) = ([0x43, 0x8F, 0xFF, 0xEF, 0], [0x83, 0x8F, 0xFF, 0xEF, 0]);
    assert!(read(&[input, output].concat()).is_ok());
    assert_eq!(error(&[input, output, input].concat()), (2, 6));
    assert_eq!(error(&[output, output].concat()), (1, 6));
    let none = Configuration::parse(&input, &parameters(0, 0));
    assert_eq!(none.map_err(|fault| fault.error), Err(CfgError::Identifier));
}

#[test]
fn counters_take_an_octet() {
    let counted = parameters(0, 6);
    let read = |octets: &[u8]| Configuration::parse(octets, &counted).map_err(|fault| fault.error);
    assert!(read(&[0x43, 8, 1, 0, 0]).is_ok() && read(&[0x83, 8, 2, 0, 0]).is_ok());
    assert_eq!(read(&[0x43, 0, 1, 0, 0]), Err(CfgError::Length));
    assert_eq!(read(&[0x83, 9, 1, 0, 0]), Err(CfgError::Length));
}

#[test]
fn a_later_input_takes_the_identifier_over() {
    let twice = read(&[0x43, 0, 1, 0, 0, 0x43, 0, 1, 0, 0, 0x43, 0, 1, 1, 0]).unwrap();
    let frozen: Vec<bool> = twice
        .modules
        .iter()
        .map(|module| matches!(module.kind, ModuleFunction::Input { is_frozen: true, .. }))
        .collect();
    assert_eq!(frozen, [true, false, false]);
}

#[test]
fn a_station_has_its_limits() {
    let outputs = |bytes: u8, count: usize| [0x83, bytes - 1, 1, 0, 0].repeat(count);
    let inputs = |bytes: u8, count: usize| [0x43, bytes - 1, 2, 0, 0].repeat(count);
    assert_eq!(read(&outputs(1, MODULES)).unwrap().outputs, MODULES);
    assert_eq!(error(&outputs(1, MODULES + 1)), (48, 1));
    // 30 * 8 + 4 = 244 octets is the maximum of one direction; 300 is the maximum of both together.
    let full = [outputs(8, 30), outputs(4, 1)].concat();
    assert_eq!(read(&full).unwrap().outputs, 244);
    assert_eq!(error(&[full.clone(), outputs(1, 1)].concat()), (31, 3));
    assert!(read(&[full.clone(), inputs(8, 7)].concat()).is_ok());
    assert_eq!(error(&[full, inputs(8, 7), inputs(1, 1)].concat()), (38, 3));
}

proptest! {
    #![proptest_config(crate::property_tests())]

    #[test]
    fn any_octets_are_valid_or_have_a_code(octets in prop::collection::vec(any::<u8>(), 0..=244), window: bool) {
        match Configuration::parse(&octets, &parameters(if window { 0x80 } else { 0 }, 0)) {
            Ok(it) => prop_assert!(it.inputs + it.outputs <= TOGETHER && it.modules.len() <= MODULES),
            Err(fault) => prop_assert!((1..=6).contains(&(fault.error as u8)) && fault.module <= 48),
        }
    }
}

/// Parameters and modules of the device description file are valid.
#[test]
fn modules_of_the_description_file_are_valid() {
    let mut octets = vec![0x80, 0, 0, 11, 0x04, 0xA4, 0];
    octets.extend(gsd::DEFAULTS);
    octets[9] |= 0x80;
    let parameters = Parameters::parse(&octets).unwrap();
    let modules = crate::devices::can_dp2::registers::DEVICE.gsd.unwrap().modules;
    let cfg: Vec<u8> =
        modules.iter().filter(|it| it.page != "73").flat_map(|it| it.octets).copied().collect();
    assert_eq!(Configuration::parse(&cfg, &parameters).unwrap().modules.len(), modules.len() - 1);
    assert!(Configuration::parse(modules[0].octets, &parameters).is_ok());
}
