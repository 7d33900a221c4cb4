//! A device in a folder of an unknown author: refuses keys that only the code of a device can implement.

use crate::error::{Error, Reason};
use crate::raw;
use crate::raw::Role;
use crate::source::{SourcePlace, Sources, at};

/// Medium of the port that a device in a folder may have.
const MEDIUM: &str = "can";

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

/// Checks that the device has at most one port: number 1 on a CAN bus, without registers.
fn check_port(sources: &Sources, file: usize, ports: &[raw::Port]) -> Result<(), Error> {
    let wrong = |span, what| Err(sources.error(at(file, span), Reason::PortInFolder(what)));
    if let Some(second) = ports.get(1) {
        return wrong(second.name.span(), "there is one port only");
    }
    let Some(port) = ports.first() else { return Ok(()) };
    if *port.number.get_ref() != 1 {
        return wrong(port.number.span(), "its number is 1");
    }
    if port.medium.get_ref() != MEDIUM {
        return wrong(port.medium.span(), "its medium is \"can\"");
    }
    if port.roles.get_ref() != &[Role::Peer] {
        return wrong(port.roles.span(), "its roles are [\"peer\"]");
    }
    match &port.area {
        Some(area) => wrong(area.span(), "it has no `area`, because no register belongs to it"),
        None => Ok(()),
    }
}
