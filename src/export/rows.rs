//! Every single register of a structure in its area, for the formats that are tables.

use super::scope::Scope;
use crate::layout::{Live, Placed, Provenance, Register, RegisterRef};

/// The registers of all areas, element by element; where structures share one it appears in each.
pub fn all(scope: &Scope) -> impl Iterator<Item = (&'static Placed, RegisterRef)> {
    scope.placed().flat_map(|(area, placed)| {
        area.registers_of(placed.structure).map(move |register| (placed, register))
    })
}

/// The address in CPU notation: `16#B414A004`.
pub fn cpu_address(register: &RegisterRef) -> String {
    format!("16#{:08X}", register.area.cpu_first + (register.offset() - register.area.first))
}

/// When a structure is the valid one.
pub const fn live(live: Live) -> &'static str {
    match live {
        Live::Always => "always",
        Live::Init => "init",
        Live::Cyclic => "cyclic",
    }
}

/// `manual`, or which facts follow from which decision: `offset D-02, reset D-03`.
pub fn provenance(register: &Register) -> String {
    let facts =
        [("name", register.name_from), ("offset", register.offset_from), ("reset", register.reset_from)];
    let inferred: Vec<_> = facts
        .into_iter()
        .filter_map(|(fact, from)| match from {
            Provenance::Manual => None,
            Provenance::Inferred(decision) => Some(format!("{fact} {decision}")),
        })
        .collect();
    if inferred.is_empty() { Provenance::Manual.to_string() } else { inferred.join(", ") }
}
