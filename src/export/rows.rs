//! Every single register of a structure in its area, for the formats that are tables.

use super::scope::Scope;
use crate::layout::{Placed, RegisterPhase, RegisterRef};

/// The registers of all areas, element by element; where structures share one it appears in each.
pub(crate) fn all(scope: &Scope) -> impl Iterator<Item = (&'static Placed, RegisterRef)> {
    scope
        .placed()
        .flat_map(|(area, placed)| area.registers_of(placed).map(move |register| (placed, register)))
}

/// Phase in which a structure is valid.
pub(crate) const fn live(live: RegisterPhase) -> &'static str {
    match live {
        RegisterPhase::Always => "always",
        RegisterPhase::Init => "init",
        RegisterPhase::Cyclic => "cyclic",
    }
}
