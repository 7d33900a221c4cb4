//! What one sees at the front of a module: DIP switches (manual 5.02066.01a p. 26-27) and LEDs (p. 28-31).

use super::leds::Leds;
use super::registers::DIP_LAST;
use crate::devices::{ModuleFront, Switch};
use crate::layout::Role;

/// Names of the LEDs.
const LEDS: [&str; 4] = ["H1", "H2", "H3", "H4"];

/// The module with this role, from what stands in the header page of its DIP switches and LEDs.
pub(crate) fn read(role: Role, dip: u32, leds: u32) -> ModuleFront {
    let leds = LEDS.into_iter().zip(Leds::of_code(leds).h);
    match role {
        Role::Master => ModuleFront { kind: "can-06", switches: Vec::new(), leds: leds.take(2).collect() },
        Role::Slave | Role::Peer => {
            let number = Switch::Number((dip & u32::from(DIP_LAST)) as u8);
            // A module with registers in the PLC: at OFF it would be the controller's.
            let switches = vec![("dip", number), ("dip9", Switch::Is(true))];
            ModuleFront { kind: "can-05", switches, leds: leds.collect() }
        }
    }
}
