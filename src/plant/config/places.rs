//! Positions in a plant file of errors that only a check of the whole plant can detect.
//!
//! The positions are searched after an error has occurred, so that settings need not store them.

use super::PlantError;
use crate::devices::{BuildError, SettingError};
use std::collections::HashMap;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Keys by which a device is connected to a bus.
const BUS_KEYS: [&str; 4] = ["node1", "node2", "bus", "profibus"];

type Value<'t> = Spanned<DeValue<'t>>;

/// Returns the offset in the text for `error`; `None` if the text does not contain the subject of the error.
pub(super) fn offset_of(error: &PlantError, text: &str) -> Option<usize> {
    let table = DeTable::parse(text).ok()?;
    let root = table.get_ref();
    let found = match error {
        PlantError::Build(BuildError::Setting(error)) => setting(root, error),
        PlantError::Build(BuildError::Own { name, at, .. }) => {
            named(root, name).last().map(|it| inside(it, at))
        }
        PlantError::Name { name, .. } => named(root, name).last(),
        PlantError::Duplicate { what: "PLC", name } => devices_named(root, name).last(),
        PlantError::Duplicate { what, name } => {
            sections_of(root, what).filter(|it| is_named(it, name)).last()
        }
        PlantError::UnknownBus { plc, bus, .. } => plugged_at(root, plc, bus).last().map(|(_, key)| key),
        PlantError::OtherKind { plc, bus, .. } => plugged_at(root, plc, bus).next().map(|(_, key)| key),
        PlantError::TwoMasters { bus, second, .. } => {
            plugged_at(root, second, bus).last().map(|(_, key)| key)
        }
        PlantError::SlaveNumber { bus, number, second, .. } => slave_number(root, bus, *number, second),
        _ => None,
    };
    found.map(|value| value.span().start)
}

/// All sections of a plant file by name, for several searches in one file.
pub(super) struct NamedSections<'a, 't>(HashMap<&'a str, Vec<&'a Value<'t>>>);

impl<'a, 't> NamedSections<'a, 't> {
    pub(super) fn new(root: &'a DeTable<'t>) -> Self {
        let mut sections: HashMap<_, Vec<_>> = HashMap::new();
        for section in all_sections(root) {
            if let Some(name) = text_at(section, "name") {
                sections.entry(name).or_default().push(section);
            }
        }
        Self(sections)
    }

    /// Returns the offset of a key in the section of this name, or of the section if it does not contain the key.
    pub(super) fn offset_of_key(&self, section: &str, key: &str) -> Option<usize> {
        let named = |name: &str| self.0.get(name).into_iter().flatten().copied();
        let section = named(section).last().or_else(|| {
            let (device, port) = section.split_once(':')?;
            module_at(named(device), port)
        })?;
        Some(section.get_ref().get(key).unwrap_or(section).span().start)
    }
}

/// Returns the value at a path in a section, or in the section's table `drive`. Returns the section itself if
/// it has no such value.
fn inside<'a, 't>(section: &'a Value<'t>, path: &str) -> &'a Value<'t> {
    let at = |section: &'a Value<'t>| path.split('.').try_fold(section, |it, key| it.get_ref().get(key));
    let own_drive = || section.get_ref().get("drive").and_then(at);
    at(section).or_else(own_drive).unwrap_or(section)
}

/// Returns the value that is out of its range.
fn setting<'a, 't>(root: &'a DeTable<'t>, error: &SettingError) -> Option<&'a Value<'t>> {
    let SettingError { what, name, value, .. } = error;
    let at = |section: &'a Value<'t>| {
        let found = what.split('.').try_fold(section, |section, key| section.get_ref().get(key));
        found.filter(|found| integer(found) == Some(*value))
    };
    let module = module(root, name);
    let own = root.get(*what).filter(|found| integer(found) == Some(*value));
    own.or_else(|| named(root, name).chain(module).find_map(at))
}

/// Returns the section of the module at port `name`, for example `maxx:slotG`.
fn module<'a, 't>(root: &'a DeTable<'t>, name: &str) -> Option<&'a Value<'t>> {
    let (device, port) = name.split_once(':')?;
    module_at(named(root, device), port)
}

/// Returns the section of the module at `port`, searched in the sections of its device.
fn module_at<'a, 't>(devices: impl Iterator<Item = &'a Value<'t>>, port: &str) -> Option<&'a Value<'t>>
where
    't: 'a,
{
    let mut modules = devices.flat_map(|section| below(section.get_ref(), "module"));
    modules.find(|module| text_at(module, "slot").is_some_and(|slot| is_port_of(port, slot)))
}

/// True if this is the port of the module in this slot.
fn is_port_of(port: &str, slot: &str) -> bool {
    port.strip_prefix("slot") == Some(slot)
}

/// Of two devices with the same number on a bus, returns the number of the later one. If the file contains no
/// number for that device, returns its bus.
fn slave_number<'a, 't>(root: &'a DeTable<'t>, bus: &str, number: u8, second: &str) -> Option<&'a Value<'t>> {
    let buses = sections_of(root, "bus").filter(|section| is_named(section, bus));
    let drives = buses.flat_map(|section| below(section.get_ref(), "drive"));
    let drive =
        drives.filter(|drive| is_named(drive, second)).find_map(|drive| drive.get_ref().get("slave_number"));
    let drive = drive.filter(|found| integer(found) == Some(number.into()));
    drive.or_else(|| {
        let (device, port) = second.split_once(':').unwrap_or((second, ""));
        let is_its = |section: &DeValue<'_>| {
            let slot = section.get("slot").and_then(|slot| slot.get_ref().as_str());
            port.is_empty() || slot.is_none_or(|slot| is_port_of(port, slot))
        };
        let (section, key) = plugged_at(root, device, bus).filter(|(section, _)| is_its(section)).last()?;
        Some(section.get("dip").unwrap_or(key))
    })
}

/// Returns the connections of devices to a bus, in the order of the file. Each item consists of the section and of the
/// name of the bus in it.
fn plugged_at<'a, 't>(
    root: &'a DeTable<'t>,
    device: &str,
    bus: &str,
) -> impl Iterator<Item = (&'a DeValue<'t>, &'a Value<'t>)> {
    let devices = devices_named(root, device);
    let sections =
        devices.flat_map(|section| [section].into_iter().chain(below(section.get_ref(), "module")));
    let keys = sections
        .flat_map(|section| BUS_KEYS.map(|key| Some((section.get_ref(), section.get_ref().get(key)?))));
    let mut found: Vec<_> =
        keys.flatten().filter(|(_, value)| value.get_ref().as_str() == Some(bus)).collect();
    found.sort_by_key(|(_, value)| value.span().start);
    found.into_iter()
}

/// Returns all sections of a kind that [`PlantError`] calls "PLC", "bus" or "drive".
fn sections_of<'a, 't>(root: &'a DeTable<'t>, what: &str) -> impl Iterator<Item = &'a Value<'t>> {
    let arrays: &[&str] = match what {
        "PLC" => &["plc", "device"],
        _ => &["bus"],
    };
    let sections =
        arrays.iter().filter_map(|name| root.get(*name)).flat_map(|value| elements(value.get_ref()));
    let sections: Vec<_> = match what {
        "drive" => sections.flat_map(|bus| below(bus.get_ref(), "drive")).collect(),
        "PLC" => sections
            .flat_map(|device| [device].into_iter().chain(below(device.get_ref(), "option")))
            .collect(),
        _ => sections.collect(),
    };
    sections.into_iter()
}

/// Returns all sections with this name.
fn named<'a, 't>(root: &'a DeTable<'t>, name: &str) -> impl Iterator<Item = &'a Value<'t>> {
    let others = ["bus", "drive"].into_iter().flat_map(|what| sections_of(root, what));
    devices_named(root, name).chain(others.filter(move |section| is_named(section, name)))
}

/// Returns all sections of devices with this name. An option card without the key `name` has a name such as
/// `line-option1`.
fn devices_named<'a, 't>(root: &'a DeTable<'t>, name: &str) -> impl Iterator<Item = &'a Value<'t>> {
    let place = name.rsplit_once("-option").and_then(|(plc, slot)| Some((plc, slot.parse::<u64>().ok()?)));
    let is_card = |card: &Value<'t>, slot| {
        text_at(card, "name").is_none() && card.get_ref().get("slot").and_then(integer) == Some(slot)
    };
    let of_controller = move |(plc, slot)| {
        let controllers = sections_of(root, "PLC").filter(move |section| is_named(section, plc));
        let cards = controllers.flat_map(|section| below(section.get_ref(), "option"));
        cards.filter(move |card| is_card(card, slot))
    };
    let named = sections_of(root, "PLC").filter(move |section| is_named(section, name));
    named.chain(place.into_iter().flat_map(of_controller))
}

/// Returns all sections that can have a name.
fn all_sections<'a, 't>(root: &'a DeTable<'t>) -> impl Iterator<Item = &'a Value<'t>> {
    ["PLC", "bus", "drive"].into_iter().flat_map(|what| sections_of(root, what))
}

fn below<'a, 't>(section: &'a DeValue<'t>, key: &str) -> impl Iterator<Item = &'a Value<'t>> + use<'a, 't> {
    section.get(key).into_iter().flat_map(|value| elements(value.get_ref()))
}

fn elements<'a, 't>(value: &'a DeValue<'t>) -> impl Iterator<Item = &'a Value<'t>> + use<'a, 't> {
    value.as_array().into_iter().flat_map(|sections| sections.iter())
}

fn text_at<'a>(section: &'a Value<'_>, key: &str) -> Option<&'a str> {
    section.get_ref().get(key)?.get_ref().as_str()
}

fn is_named(section: &Value<'_>, name: &str) -> bool {
    text_at(section, "name") == Some(name)
}

fn integer(value: &Value<'_>) -> Option<u64> {
    let integer = value.get_ref().as_integer()?;
    u64::from_str_radix(integer.as_str(), integer.radix()).ok()
}
