//! Phases: constants for the firmware, and their descriptor.

use super::tables::{path, provenance};
use super::text::doc;
use crate::model::{Device, Phase, Phases};
use std::fmt::Write;

/// Returns the phases that the layout itself declares.
fn own(device: &Device) -> Option<&Phases> {
    device.phases.as_ref().filter(|phases| !phases.shared)
}

/// Writes a constant for each phase.
pub(crate) fn constants(out: &mut String, device: &Device) {
    let Some(phases) = own(device) else { return };
    out.push_str(
        "/// The phases, in which different structures are valid.\npub mod phases {\n    use commram::layout::RegisterPhase;\n\n",
    );
    for (number, phase) in (1..).zip(&phases.values) {
        out.push_str(&doc("    ", &format!("Valid {}.", phase.doc)));
        let name = phase.name.to_uppercase();
        let _ = writeln!(out, "    pub const {name}: RegisterPhase = RegisterPhase::numbered({number});");
    }
    out.push_str("}\n\n");
}

/// Writes the descriptor, to which areas refer.
pub(crate) fn descriptor(out: &mut String, device: &Device) {
    let Some(Phases { register, source, values, .. }) = own(device) else { return };
    let source = provenance(source);
    let _ = writeln!(
        out,
        "    /// The phases.\n    pub static PHASES: Phases = Phases {{ register: {register:?}, source: {source}, phases: &["
    );
    for Phase { name, from, doc, .. } in values {
        let _ = writeln!(out, "        Phase {{ name: {name:?}, from: {from}, doc: {doc:?} }},");
    }
    out.push_str("    ] };\n\n");
}

/// Returns the reference of an area to the descriptor.
pub(crate) fn reference(device: &Device) -> String {
    let phases = device.phases.as_ref();
    phases.map_or("None".to_owned(), |phases| format!("Some(&{})", path(device, phases.shared, "PHASES")))
}
