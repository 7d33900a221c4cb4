//! Front of a module: DIP switches (manual 5.02066.01a p. 26-27) and LEDs (p. 28-31).

use super::leds::Leds;
use crate::devices::bm4_o_can_06::registers::DIP_LAST;
use crate::devices::{ModuleFront, Switch};
use crate::layout::Role;

/// Names of the LEDs.
const LEDS: [&str; 4] = ["H1", "H2", "H3", "H4"];

/// Position of DIP switches 1 to 3 in the word of the header page that has DIP switches 4 to 8 in its lowest
/// five bits.
pub(super) const DIP_BAUD: u32 = 5;
/// A BM4-O-CAN-05 with DIP switch 9 at OFF: the module has no registers, so only this bit shows its
/// presence.
pub(super) const DIP_9_OFF: u32 = 1 << 8;
/// DIP switch 10 at ON.
pub(super) const DIP_10_ON: u32 = 1 << 9;

/// Returns the module with this role, from its DIP switches and LEDs in the header page.
pub(crate) fn read(role: Option<Role>, dip: u32, leds: u32) -> Option<ModuleFront> {
    let leds = LEDS.into_iter().zip(Leds::of_code(leds).h);
    let is_for_controller = dip & DIP_9_OFF != 0;
    if role == Some(Role::Master) {
        return Some(ModuleFront { kind: "can-06", switches: Vec::new(), leds: leds.take(2).collect() });
    }
    if role.is_none() && !is_for_controller {
        return None;
    }
    let number = Switch::Number((dip & u32::from(DIP_LAST)) as u8);
    let mut switches = vec![("dip", number), ("dip9", Switch::Is(!is_for_controller))];
    if is_for_controller {
        switches.push(("dip_baud", Switch::Number((dip >> DIP_BAUD & 0b111) as u8)));
    }
    if dip & DIP_10_ON != 0 {
        switches.push(("dip10", Switch::Is(true)));
    }
    Some(ModuleFront { kind: "can-05", switches, leds: leds.collect() })
}
