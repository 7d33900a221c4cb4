//! A device in a folder of an unknown author: refuses keys that only the code of a device can implement.

use crate::error::{Error, Reason};
use crate::model::{ALWAYS, FieldType, Structure};
use crate::raw;
use crate::raw::Role;
use crate::source::{SourcePlace, Sources, at};
use std::collections::BTreeMap;

/// Refuses object dictionaries, device description files and bus timing.
pub(super) fn check(sources: &Sources, file: usize, raw: &raw::Device) -> Result<(), Error> {
    let refused = |place: SourcePlace, key| Err(sources.error(place, Reason::NotInFolder(key)));
    if let Some(objects) = &raw.objects {
        return refused(at(file, objects.span()), "objects");
    }
    if let Some(gsd) = &raw.gsd {
        return refused(at(file, gsd.span()), "gsd");
    }
    if let Some(rate) = raw.baud_rate.first() {
        return refused(at(file, rate.deadline_WRC.span()), "baud_rate");
    }
    check_port(sources, file, &raw.port)
}

/// Checks that the device has at most one port on a CAN bus and one on PROFIBUS, without registers.
fn check_port(sources: &Sources, file: usize, ports: &[raw::Port]) -> Result<(), Error> {
    let wrong = |span, what| Err(sources.error(at(file, span), Reason::PortInFolder(what)));
    for port in ports {
        match (port.medium.get_ref().as_str(), *port.number.get_ref()) {
            ("can", 1) if port.roles.get_ref() != &[Role::Peer] => {
                return wrong(port.roles.span(), "its roles at \"can\" are [\"peer\"]");
            }
            ("profibus", 2) if port.roles.get_ref() != &[Role::Master] => {
                return wrong(port.roles.span(), "its roles at \"profibus\" are [\"master\"]");
            }
            ("can", 1) | ("profibus", 2) => {}
            ("can", _) => return wrong(port.number.span(), "its number at \"can\" is 1"),
            ("profibus", _) => return wrong(port.number.span(), "its number at \"profibus\" is 2"),
            _ => return wrong(port.medium.span(), "its medium is \"can\" or \"profibus\""),
        }
        if let Some(area) = &port.area {
            return wrong(area.span(), "it has no `area`, because no register belongs to it");
        }
    }
    Ok(())
}

/// Checks the structures that overlay each other: at most one area has them, in each phase one of them is valid, and the
/// register that shows the phase has at most 16 bits. The areas must have been checked.
pub(super) fn check_phases(
    sources: &Sources,
    file: usize,
    raw: &raw::Device,
    structures: &[Structure],
) -> Result<(), Error> {
    let refused = |span, reason| Err(sources.error(at(file, span), reason));
    let has_phases = |area: &&raw::Area| area.structure.iter().any(|placed| placed.live.get_ref() != ALWAYS);
    let mut overlaid = raw.area.iter().filter(has_phases);
    let (Some(area), Some(phases)) = (overlaid.next(), &raw.phase) else { return Ok(()) };
    let name = area.name.get_ref().clone();
    if let Some(other) = overlaid.next() {
        return refused(other.name.span(), Reason::PhasesOfAreas(name, other.name.get_ref().clone()));
    }
    let register = &phases.get_ref().register;
    let mut of_phases = BTreeMap::new();
    for raw::AreaStructure { name: structure, live, .. } in &area.structure {
        if live.get_ref() == ALWAYS {
            continue;
        }
        let structure = structure.get_ref();
        if let Some(other) = of_phases.insert(live.get_ref(), structure) {
            let (phase, structure, other) = (live.get_ref().clone(), structure.clone(), other.clone());
            return refused(live.span(), Reason::PhaseTaken { area: name, structure, other, phase });
        }
        let mut fields = structures.iter().filter(|it| it.name == *structure).flat_map(|it| &it.fields);
        let is_wide = |kind: &FieldType| matches!(kind, FieldType::Scalar(scalar) if scalar.width() > 2);
        if fields.any(|field| field.name == *register.get_ref() && is_wide(&field.kind)) {
            return refused(register.span(), Reason::WidePhaseRegister(register.get_ref().clone()));
        }
    }
    Ok(())
}
