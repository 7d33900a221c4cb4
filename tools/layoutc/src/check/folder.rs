//! A device in a folder of an unknown author: refuses keys that only the code of a device can implement.

use crate::error::{Error, Reason};
use crate::raw;
use crate::raw::Role;
use crate::source::{SourcePlace, Sources, at};

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
