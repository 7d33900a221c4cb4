//! CMSIS-SVD, the register description for debuggers and peripheral viewers. Addresses are CPU addresses.

use super::constants;
use super::members::{self, Group, Member};
use super::names::UsedNames;
use super::scope::Scope;
use super::text;
use super::xml::Xml;
use crate::layout::{Area, AreaStructure, Dim, Meaning, Owner, Register, ValueMeaning};
use std::collections::HashSet;

pub(crate) fn generate(scope: &Scope) -> String {
    let device = scope.device;
    let mut xml = Xml::new();
    for line in text::banner(scope, "svd") {
        xml.comment(&line);
    }
    let attributes = "schemaVersion=\"1.3\" xmlns:xs=\"http://www.w3.org/2001/XMLSchema-instance\" \
                      xs:noNamespaceSchemaLocation=\"CMSIS-SVD.xsd\"";
    xml.node("device", attributes, |xml| {
        xml.leaf("name", device.name.replace('-', "_"));
        xml.leaf("version", text::version());
        xml.leaf(
            "description",
            format!(
                "Communication RAM of the {}. Where an area begins is documented; offsets and whatever names a \
                 decision (D-nn) are inferred.",
                device.title
            ),
        );
        xml.leaf("addressUnitBits", 8);
        xml.leaf("width", 32);
        xml.leaf("size", 32);
        xml.leaf("access", "read-write");
        xml.leaf("resetValue", "0x0");
        xml.leaf("resetMask", "0xFFFFFFFF");
        xml.node("peripherals", "", |xml| {
            // If the manual of the device gives CPU addresses, the file has only areas with a CPU address: a debugger
            // cannot access the other areas.
            let has_cpu = device.areas.iter().any(|area| area.cpu.is_some());
            let mut names = UsedNames::default();
            for area in scope.areas.iter().filter(|area| area.cpu.is_some() || !has_cpu) {
                if area.structures.is_empty() {
                    plain(xml, area, &names.add(area.name));
                }
                let own = |placed: &AreaStructure| names.add(placed.variable.trim_start_matches('_'));
                let own: Vec<_> = area.structures.iter().map(own).collect();
                for (placed, name) in area.structures.iter().zip(&own) {
                    let alternative = own.first().filter(|first| *first != name);
                    peripheral(xml, area, placed, (name, alternative.map(String::as_str)));
                }
            }
        });
    });
    xml.finish()
}

/// Writes an area without registers.
fn plain(xml: &mut Xml, area: &Area, name: &str) {
    xml.node("peripheral", "", |xml| {
        xml.leaf("name", name);
        place(xml, area, area.doc, None, area.bytes, "buffer");
    });
}

/// Writes a structure with its name. Each of several overlaid structures names the first one as its alternative.
fn peripheral(xml: &mut Xml, area: &Area, placed: &AreaStructure, (name, alternative): (&str, Option<&str>)) {
    xml.node("peripheral", "", |xml| {
        xml.leaf("name", name);
        let doc = text::about(placed.structure);
        place(xml, area, &doc, alternative, placed.structure.bytes, "registers");
        xml.node("registers", "", |xml| {
            let members = members::of(placed.structure);
            let mut names = Names::of(&members);
            for member in members {
                match member {
                    Member::Register(of) => register(xml, of, 0, &names.own(of.name)),
                    Member::Group(of) => group(xml, &of, &names.own(of.member_name())),
                    Member::Padding { .. } => {}
                }
            }
        });
    });
}

fn place(xml: &mut Xml, area: &Area, doc: &str, alternative: Option<&str>, bytes: u32, usage: &str) {
    xml.leaf("description", doc);
    if let Some(alternative) = alternative {
        xml.leaf("alternatePeripheral", alternative);
    }
    xml.leaf("groupName", area.name);
    // An area without a CPU address gets the number of its first byte in the image as its address. This number differs
    // for each area.
    let base = area.cpu.map_or(area.first, |(first, _)| first);
    xml.leaf("baseAddress", format!("0x{base:08X}"));
    xml.node("addressBlock", "", |xml| {
        xml.leaf("offset", "0x0");
        xml.leaf("size", format!("0x{bytes:X}"));
        xml.leaf("usage", usage);
    });
}

fn group(xml: &mut Xml, group: &Group, name: &str) {
    xml.node("cluster", "", |xml| {
        dimensions(xml, name, group.dims());
        xml.leaf("description", format!("{}. {}", group.type_name(), group.about()));
        xml.leaf("addressOffset", format!("0x{:X}", group.offset()));
        let members = group.members();
        let mut names = Names::of(&members);
        for member in members {
            if let Member::Register(of) = member {
                register(xml, of, group.offset(), &names.own(of.name));
            }
        }
    });
}

/// The names of the members of a structure. A tool expands an array of two dimensions to names such as `a_x_5_7`, which
/// another member may have, too.
struct Names {
    elements: HashSet<String>,
    used: UsedNames,
}

impl Names {
    fn of(members: &[Member]) -> Self {
        let named = |member: &Member| match member {
            Member::Register(of) => Some((of.name, members::own_dims(of))),
            Member::Group(of) => Some((of.member_name(), of.dims())),
            Member::Padding { .. } => None,
        };
        let elements: HashSet<_> = members
            .iter()
            .filter_map(named)
            .filter_map(|(name, dims)| <&[Dim; 2]>::try_from(dims).ok().map(|dims| (name, dims)))
            .flat_map(|(name, [outer, inner])| pairs(outer, inner).map(move |pair| format!("{name}_{pair}")))
            .collect();
        let all = members.iter().filter_map(named).map(|(name, _)| name.to_owned());
        let used = UsedNames::of(all.chain(elements.iter().cloned()));
        Self { elements, used }
    }

    /// Returns the name of a member in the export.
    fn own(&mut self, name: &str) -> String {
        if self.elements.contains(name) { self.used.add(name) } else { name.to_owned() }
    }
}

/// Returns the two indices of each element, such as `5_7`.
fn pairs(outer: &Dim, inner: &Dim) -> impl Iterator<Item = String> {
    let (outer, inner) = (outer.count, inner.count);
    (0..outer).flat_map(move |i| (0..inner).map(move |j| format!("{i}_{j}")))
}

/// Writes the number of elements, and the name with a placeholder for the index.
fn dimensions(xml: &mut Xml, name: &str, dims: &[Dim]) {
    let Some(inner) = dims.last() else {
        return xml.leaf("name", name);
    };
    xml.leaf("dim", dims.iter().map(|dim| u32::from(dim.count)).product::<u32>());
    xml.leaf("dimIncrement", inner.stride);
    let [outer, inner] = dims else {
        xml.leaf("dimIndex", format!("0-{}", inner.count - 1));
        return xml.leaf("name", format!("{name}[%s]"));
    };
    // SVD has only one index, so it counts the elements of both dimensions.
    xml.leaf("dimIndex", pairs(outer, inner).collect::<Vec<_>>().join(","));
    xml.leaf("name", format!("{name}_%s"));
}

/// Writes a register with a name. `start` is the base of the offset.
fn register(xml: &mut Xml, of: &'static Register, start: u32, name: &str) {
    xml.node("register", "", |xml| {
        dimensions(xml, name, members::own_dims(of));
        xml.leaf("description", text::remark(of));
        xml.leaf("addressOffset", format!("0x{:X}", of.offset - start));
        xml.leaf("size", 8 * of.ty.width());
        xml.leaf("access", if of.owner == Owner::Firmware { "read-only" } else { "read-write" });
        xml.leaf("resetValue", format!("0x{:X}", of.reset));
        if let Some(meaning) = of.meaning {
            xml.node("fields", "", |xml| fields(xml, meaning, 8 * of.ty.width()));
        }
    });
}

fn fields(xml: &mut Xml, meaning: &Meaning, width: u32) {
    if meaning.bits.is_empty() {
        field(xml, "VALUE", meaning.name, 0, width, meaning.values);
    }
    for (bits, name) in constants::fields(meaning) {
        let width = u32::from(bits.last - bits.first) + 1;
        field(xml, &name, &constants::about(bits), bits.first.into(), width, bits.values);
    }
}

/// Ranges of values cannot be expressed and are omitted.
fn field(xml: &mut Xml, name: &str, doc: &str, offset: u32, width: u32, values: &[ValueMeaning]) {
    // A name must begin with a letter or `_`.
    let begin = if name.starts_with(|first: char| first.is_ascii_digit()) { "_" } else { "" };
    xml.node("field", "", |xml| {
        xml.leaf("name", format!("{begin}{name}"));
        xml.leaf("description", doc);
        xml.leaf("bitOffset", offset);
        xml.leaf("bitWidth", width);
        let values = constants::singles(values);
        if values.is_empty() {
            return;
        }
        xml.node("enumeratedValues", "", |xml| {
            for constant in values {
                xml.node("enumeratedValue", "", |xml| {
                    xml.leaf("name", constant.name);
                    xml.leaf("description", constant.text);
                    xml.leaf("value", constant.value);
                });
            }
        });
    });
}
