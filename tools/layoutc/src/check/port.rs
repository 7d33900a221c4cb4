//! Checks that each port has a unique name and number, and an area that exists.

use super::Names;
use crate::error::{Error, Reason};
use crate::model::{Area, Port};
use crate::raw;
use crate::source::{Sources, at};
use toml::Spanned;

/// Checks all ports of the device and brings them into the order of their numbers.
pub(crate) fn check(
    sources: &Sources,
    file: usize,
    raw: &[raw::Port],
    areas: &[Area],
) -> Result<Vec<Port>, Error> {
    let mut names = Names::default();
    let mut ports: Vec<Port> = Vec::new();
    for raw in raw {
        names.add(sources, file, &raw.name)?;
        let number = *raw.number.get_ref();
        let number_is = |reason| sources.error(at(file, raw.number.span()), reason);
        if number == 0 {
            return Err(number_is(Reason::PortZero));
        }
        if ports.iter().any(|port| port.number == number) {
            return Err(number_is(Reason::PortNumberTwice(number)));
        }
        let roles = raw.roles.get_ref();
        if roles.is_empty() || (1..roles.len()).any(|n| roles[..n].contains(&roles[n])) {
            return Err(sources.error(at(file, raw.roles.span()), Reason::PortRoles));
        }
        let name = raw.name.get_ref().clone();
        let area = match &raw.area {
            Some(name) => Some(area(sources, file, name, areas)?),
            None if sources.is_folder() => None,
            None => {
                return Err(sources.error(at(file, raw.name.span()), Reason::PortWithoutArea(name)));
            }
        };
        let medium = raw.medium.get_ref().clone();
        ports.push(Port { name, number, medium, roles: roles.clone(), area });
    }
    ports.sort_by_key(|port| port.number);
    Ok(ports)
}

/// Returns the index of the named area.
pub(super) fn area(
    sources: &Sources,
    file: usize,
    name: &Spanned<String>,
    areas: &[Area],
) -> Result<usize, Error> {
    let wanted = name.get_ref();
    let found = areas.iter().position(|area| area.name == *wanted);
    found.ok_or_else(|| sources.error(at(file, name.span()), Reason::UnknownArea(wanted.clone())))
}
