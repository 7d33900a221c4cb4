//! Checks, for any device, that registers of the firmware have valid values. A value is valid if it has a meaning in
//! the layout.

use crate::layout::{DeviceLayout, Owner, RegisterRef};
use crate::plant::PlantConfig;
use core::fmt::Write;

/// Returns registers that only the firmware writes, if their values have meanings: states, error numbers, and counters.
/// The meaning of a counter is its range.
pub(super) fn bounded(device: &DeviceLayout) -> impl Iterator<Item = RegisterRef> {
    let areas =
        device.areas.iter().flat_map(|area| area.structures.iter().flat_map(|it| area.registers_of(it)));
    areas.filter(|it| it.owner() == Owner::Firmware && it.register.meaning.is_some() && !it.is_reserved())
}

/// Returns the text of a scenario function that fails if a register has an invalid value.
pub(super) fn function(plant: &PlantConfig) -> String {
    let mut text =
        "// Registers of the firmware hold what their layout gives a meaning.\nfn in_bounds() {\n".to_owned();
    for device in &plant.devices {
        let mut addresses: Vec<_> = bounded(device.layout()).map(|it| it.address().to_string()).collect();
        // An address with several names occurs once.
        addresses.sort_unstable();
        addresses.dedup();
        for some in addresses.chunks(PER_LINE) {
            let _ = writeln!(text, "    bounded({:?}, {some:?});", device.name());
        }
    }
    text + "}\n"
}

/// Registers in a line of the scenario.
const PER_LINE: usize = 12;
