//! Random choices: moves, faults, stores.

use crate::devices::{DeviceConfig, Exercise};
use crate::fault::Form;
use crate::plant::PlantConfig;
use fastrand::Rng;
use std::sync::Arc;

/// Numbers that have a meaning in many registers.
const TELLING: [u32; 12] = [0, 1, 2, 3, 5, 0x15, 0x20, 0x40, 0x80, 0xC0, 0xFF, 0xFFFF];
/// Longest time of a fault or a forced register, in microseconds.
const LONGEST_US: u64 = 300_000;
/// Maximum of the numbers in most faults. With larger numbers, faults would rarely concern an actual event.
const MOSTLY: u64 = 32;

/// Returns a random move of the exercise, as a call with random parameters.
pub(super) fn made(exercise: &Exercise, is_right: bool, rng: &mut Rng) -> String {
    let all: u32 = exercise.moves.iter().map(|it| it.weight).sum();
    let mut at = rng.u32(..all.max(1));
    let chosen = exercise.moves.iter().find(|it| {
        let is_it = at < it.weight;
        at = at.saturating_sub(it.weight);
        is_it
    });
    let Some(chosen) = chosen else { return String::new() };
    let parameters = chosen.parameters.iter().map(|range| format!(", {}", rng.i64(range.clone())));
    format!("{}({is_right}{});", chosen.name, parameters.collect::<String>())
}

/// Returns a random fault of any kind at any target. The plant may refuse it.
pub(super) fn fault(plant: &PlantConfig, rng: &mut Rng) -> String {
    let Some(kind) = rng.choice(plant.fault_kinds()) else { return String::new() };
    let device = match kind.declaration() {
        Some(it) => rng.choice(
            plant.devices.iter().filter(|device| device.layout().name == it.device).collect::<Vec<_>>(),
        ),
        None => rng.choice(&plant.devices),
    };
    let mut words = kind.name().to_owned();
    let ends_by_hits = kind.has_hits() && rng.bool();
    for field in kind.all_fields() {
        let value = match (field.name(), field.form()) {
            ("at_us", _) => continue,
            ("count", _) if !ends_by_hits => continue,
            ("duration_us", _) if ends_by_hits => continue,
            ("duration_us", _) => format!("{}us", rng.u64(1..=LONGEST_US)),
            ("bus", _) => rng.choice(&plant.buses).map(|bus| bus.name().to_owned()).unwrap_or_default(),
            (_, Form::Name) => device.map(|it| it.name().to_owned()).unwrap_or_default(),
            (_, Form::Port) => device.and_then(|it| port(it, rng)).unwrap_or_default().to_owned(),
            (_, Form::Word(words)) => rng.choice(words).copied().unwrap_or_default().to_owned(),
            (_, Form::Time { least, most }) => {
                format!("{}us", rng.u64(least..=most.min(LONGEST_US).max(least)))
            }
            (_, Form::Number { least, most } | Form::Hex { least, most, .. }) => {
                let most = if rng.u8(..8) == 0 { most } else { most.min(MOSTLY).max(least) };
                rng.u64(least..=most).to_string()
            }
        };
        words += &format!(" {}={value}", field.name());
    }
    format!("disturb({words:?});")
}

fn port(device: &Arc<dyn DeviceConfig>, rng: &mut Rng) -> Option<&'static str> {
    rng.choice(device.layout().ports).map(|port| port.name)
}

/// Returns a random store to any register, or a force of a register for some time.
pub(super) fn store(plant: &PlantConfig, rng: &mut Rng) -> String {
    let device = &plant.devices[rng.usize(..plant.devices.len())];
    let registers = device
        .layout()
        .areas
        .iter()
        .flat_map(|area| area.structures.iter().flat_map(|it| area.registers_of(it)));
    let Some(register) = rng.choice(registers.collect::<Vec<_>>()) else { return String::new() };
    let place = format!("{}:{}", device.name(), register.address());
    let bits = 8 * register.register.ty.width();
    let any = if rng.bool() { rng.u32(..) } else { TELLING[rng.usize(..TELLING.len())] };
    let value = any & u32::MAX.checked_shr(32 - bits).unwrap_or_default();
    match rng.u8(..8) {
        0 => format!("hold({place:?}, {value}, {});", rng.u64(1..=LONGEST_US)),
        _ => format!("store({place:?}, {value});"),
    }
}
