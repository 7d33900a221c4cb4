//! Lists every single register, for the formats that are tables.

use super::scope::Scope;
use crate::layout::{Area, AreaStructure, RegisterRef};

/// Returns the registers of all areas, element by element. A register that structures share appears in each of them.
pub(crate) fn all(scope: &Scope) -> impl Iterator<Item = (&'static AreaStructure, RegisterRef)> {
    scope
        .placed()
        .flat_map(|(area, placed)| area.registers_of(placed).map(move |register| (placed, register)))
}

/// Returns the name of the phase in which a structure of `area` is valid.
pub(crate) fn live(area: &Area, placed: &AreaStructure) -> &'static str {
    area.phase_facts(placed.live).map_or("always", |phase| phase.name)
}
