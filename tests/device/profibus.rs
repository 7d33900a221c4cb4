//! Stations of a PROFIBUS segment: their addresses, and addresses that two stations share.

use crate::rig::plant_of;
use commram::devices::Power;
use commram::devices::can_dp2::registers::FRONT_SWITCHES;
use commram::devices::can_dp2::rules::ADDRESS;
use commram::identity::DeviceIndex;
use commram::plant::{Plant, PlantConfig};

/// Returns a plant file: gateways with these switches on one segment, and one gateway on another segment.
fn text(switches: &[Option<u8>]) -> String {
    let mut text = String::new();
    for (number, switches) in switches.iter().enumerate() {
        text += &format!("[[device]]\nkind = 'can-dp2'\nname = 'gw{number}'\nprofibus = 'dp'\n");
        text += &switches.map_or_else(String::new, |switches| format!("switches = {switches}\n"));
    }
    text += "[[device]]\nkind = 'can-dp2'\nname = 'far'\nprofibus = 'other'\n";
    text + "[[bus]]\nname = 'dp'\nkind = 'profibus'\n[[bus]]\nname = 'other'\nkind = 'profibus'\n"
}

/// Returns the devices and addresses of the findings about addresses.
fn shared(plant: &Plant) -> Vec<(u16, u32)> {
    let found = plant.journal().findings();
    let of_addresses = found.iter().filter(|entry| entry.last.rule == &ADDRESS);
    of_addresses.map(|entry| (entry.last.plc.0, entry.last.value)).collect()
}

/// CAN-DP/2 p. 9, 26: each gateway has its own address, set by its switches and read at power-on.
#[test]
fn gateways_with_the_same_address_are_found() {
    for (switches, expected) in [
        (&[Some(5), Some(6)][..], &[][..]),
        // Both devices have the address at delivery.
        (&[None, None], &[(0, 3), (1, 3)]),
        // A switch position below 3 means address 3, a position above 124 means 124 (p. 9).
        (&[Some(7), Some(0), Some(3)], &[(1, 3), (2, 3)]),
        (&[Some(0x7C), Some(0xFF)], &[(0, 124), (1, 124)]),
    ] {
        let text = text(switches);
        let mut plant = plant_of(&text);
        plant.advance_to(1_000);
        assert_eq!(shared(&plant), expected, "{switches:?}");
        let doubts = PlantConfig::parse("p.toml", &text).unwrap().doubts(&text);
        assert_eq!(doubts.len(), expected.len() / 2, "{doubts:?}");
        if let ([(line, doubt)], [.., (second, address)]) = (&doubts[..], expected) {
            assert!(line.is_some());
            assert!(
                doubt.text.contains(&format!("'gw{second}:dp' have the same address {address} on bus 'dp'")),
                "{}",
                doubt.text
            );
        }
    }
}

/// The gateway reads its switches at power-on. Two gateways share an address only while both have read it and are
/// switched on.
#[test]
fn an_address_is_shared_while_both_are_on() {
    let mut plant = plant_of(&text(&[Some(5), Some(6)]));
    plant.advance_to(1_000);
    plant.devices()[1].segment().header().unwrap().front[FRONT_SWITCHES].store(5);
    plant.advance_to(2_000);
    assert_eq!(shared(&plant), []);
    plant.set_power(DeviceIndex(0), Power::Off);
    plant.set_power(DeviceIndex(1), Power::Off);
    plant.advance_to(3_000);
    plant.set_power(DeviceIndex(1), Power::On);
    plant.advance_to(4_000);
    assert_eq!(shared(&plant), [], "the other one is off");
    plant.set_power(DeviceIndex(0), Power::On);
    plant.advance_to(5_000);
    assert_eq!(shared(&plant), [(0, 5), (1, 5)]);
}

/// `commram bus list` shows the slaves with address and state, their masters, and no station without supply.
#[test]
fn stations_have_addresses_and_states() {
    let mut plant = plant_of(&text(&[Some(5), Some(6)]));
    plant.advance_to(1_000);
    let stations = |plant: &Plant| {
        let of = plant.buses()[0].stations().into_iter();
        of.map(|it| (it.origin.plc.0, it.address, it.does.unwrap())).collect::<Vec<_>>()
    };
    let mut found = stations(&plant);
    found.sort();
    assert_eq!(
        found,
        [
            (0, Some(1), "master"),
            (0, Some(5), "baud_search"),
            (1, Some(1), "master"),
            (1, Some(6), "baud_search"),
        ]
    );
    plant.set_power(DeviceIndex(0), Power::Off);
    plant.advance_to(2_000);
    assert_eq!(stations(&plant).len(), 2);
}
