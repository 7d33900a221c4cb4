//! Descriptor tables for tools: static data of the types in `commram::layout`.

use crate::front;
use crate::front::Front;
use crate::model;
use crate::model::{
    Area, AreaStructure, Bit, Device, Dim, Field, FieldType, FrontWord, Meaning, Object, Owner, Port,
    Provenance, Space, Structure,
};
use crate::objects::Value;
use std::collections::BTreeSet;
use std::fmt::Write;

pub(crate) fn emit(out: &mut String, device: &Device, layout_hash: u64) {
    let _ = writeln!(
        out,
        "/// The whole device, for tools.\npub static DEVICE: commram::layout::DeviceLayout = commram::layout::DeviceLayout {{\n    \
         name: {:?}, title: {:?}, manual: {:?}, undocumented: {:?},\n    layout_hash: 0x{layout_hash:016X}, spaces: &descriptor::SPACES,\n    \
         areas: &descriptor::AREAS, retain: {}, objects: &descriptor::OBJECTS, gsd: {}, front: &descriptor::FRONT, front_area: {}, ports: &descriptor::PORTS,\n    own: {},\n}};\n",
        device.name,
        device.title,
        device.manual,
        device.undocumented,
        if device.retain.is_some() { "Some(&descriptor::RETAIN)" } else { "None" },
        if device.gsd.is_some() { "Some(&descriptor::GSD)" } else { "None" },
        if device.front.is_empty() { "None" } else { "Some(&descriptor::FRONT_AREA)" },
        device.own.map_or_else(|| "None".to_owned(), |area| format!("Some(&descriptor::AREAS[{area}])")),
    );
    out.push_str(
        "/// What the layout files say about areas, structures and registers.\n\
         pub mod descriptor {\n    use commram::layout::*;\n\n",
    );
    spaces(out, device);
    areas(out, device);
    objects(out, device);
    super::gsd::emit(out, device);
    front(out, device);
    front_area(out, device);
    ports(out, device);
    super::phases::descriptor(out, device);
    described(out, device, &used_meanings(device));
}

/// Writes the descriptors to which devices of the family refer.
pub(crate) fn emit_family(out: &mut String, family: &Device) {
    out.push_str(
        "/// What the layout files say about structures and registers.\n\
         pub mod descriptor {\n    use commram::layout::*;\n\n",
    );
    super::phases::descriptor(out, family);
    // Registers of the family's devices may have meanings that no register of the family has.
    described(out, family, &(0..family.meanings.len()).collect());
}

fn described(out: &mut String, device: &Device, meanings: &BTreeSet<usize>) {
    for structure in device.structures.iter().filter(|structure| !structure.shared) {
        emit_structure(out, device, structure);
    }
    for &index in meanings {
        emit_meaning(out, device, &device.meanings[index]);
    }
    out.push_str("}\n\n");
}

/// Returns the meanings that registers of the device's own structures have.
fn used_meanings(device: &Device) -> BTreeSet<usize> {
    let own = device.structures.iter().filter(|structure| !structure.shared);
    let fields = own.flat_map(|structure| &structure.fields).flat_map(|field| match field.kind {
        FieldType::Sub(index) => device.substructures[index].fields.as_slice(),
        _ => std::slice::from_ref(field),
    });
    let front = device.front.iter().filter_map(|word| word.meaning);
    fields.filter_map(|field| field.meaning).chain(front).collect()
}

/// Returns the path of a static, from the module of descriptors.
pub(super) fn path(device: &Device, shared: bool, name: &str) -> String {
    if shared { format!("{}::descriptor::{name}", super::family_module(device)) } else { name.to_owned() }
}

fn spaces(out: &mut String, device: &Device) {
    let front = front::of(device).map(|front| front.space);
    let count = device.spaces.len() + front.iter().len();
    let _ = writeln!(out, "    /// The spaces of addresses.\n    pub static SPACES: [Space; {count}] = [");
    for space in device.spaces.iter().chain(&front) {
        let Space { name, letter, segment, unit, first, offset, bytes, page, doc } = space;
        let segment = segment.map_or(String::new(), |segment| format!("{segment}."));
        let _ = writeln!(
            out,
            "        Space {{ name: {name:?}, letter: '{letter:?}', segment: {segment:?}, unit: Unit::{unit:?}, first: {first}, \
             offset: {offset}, bytes: {bytes}, page: {page:?}, doc: {doc:?} }},"
        );
    }
    out.push_str("    ];\n\n");
}

fn objects(out: &mut String, device: &Device) {
    let count = device.objects.len();
    let _ = writeln!(
        out,
        "    /// The object dictionary, in the order of index and sub-index.\n    pub static OBJECTS: [Object; {count}] = ["
    );
    for object in &device.objects {
        let Object { index, sub, name, ty, access, default, saved, page, doc, .. } = object;
        let default = match default {
            Value::Nothing => "Default::Nothing".to_owned(),
            Value::Number(number) => format!("Default::Number({number})"),
            Value::PlusNode(number) => format!("Default::PlusNode({number})"),
            Value::Text(text) => format!("Default::Text({text:?})"),
        };
        let ty = ty.map_or_else(|| "None".to_owned(), |ty| format!("Some(object::Type::{ty:?})"));
        let (row_from, default_from) = (provenance(&object.row_from), provenance(&object.default_from));
        let _ = writeln!(
            out,
            "        Object {{ index: 0x{index:04X}, sub: {sub}, name: {name:?}, ty: {ty}, access: object::Access::{access:?}, \
             default: object::{default}, saved: {saved}, page: {page:?}, doc: {doc:?}, row_from: {row_from}, \
             default_from: {default_from} }},"
        );
    }
    out.push_str("    ];\n\n");
}

fn areas(out: &mut String, device: &Device) {
    let count = device.areas.len();
    let _ = writeln!(out, "    /// The areas in ascending order.\n    pub static AREAS: [Area; {count}] = [");
    for area in &device.areas {
        let _ = writeln!(out, "        {},", self::area(device, area));
    }
    out.push_str("    ];\n\n");
    if let Some((area, default)) = &device.retain {
        let _ = writeln!(
            out,
            "    /// The area whose size each plant sets.\n    pub static RETAIN: Retain = Retain {{\n        \
             area: {},\n        default_bytes: {default},\n    }};\n",
            self::area(device, area)
        );
    }
}

fn area(device: &Device, area: &Area) -> String {
    let Area { name, name_from, space, first, bytes, cpu, page, doc, structures } = area;
    let name_from = provenance(name_from);
    let has_phases = structures.iter().any(|placed| placed.live != 0);
    let phases = if has_phases { super::phases::reference(device) } else { "None".to_owned() };
    let mut out = format!(
        "Area {{ name: {name:?}, name_from: {name_from}, space: &SPACES[{space}], first: {first}, bytes: {bytes}, \
         cpu: {cpu:?}, page: {page:?}, doc: {doc:?}, phases: {phases}, structures: &["
    );
    for AreaStructure { structure, live, role, variable, variable_from, unused } in structures {
        let variable_from = provenance(variable_from);
        let structure = &device.structures[*structure];
        let item = path(device, structure.shared, &static_name(&structure.name));
        let role = role.map_or("None".to_owned(), |role| format!("Some(Role::{role:?})"));
        let _ = write!(
            out,
            "AreaStructure {{ structure: &{item}, live: RegisterPhase::numbered({live}), role: {role}, variable: {variable:?}, \
             variable_from: {variable_from}, unused: &{unused:?} }}, "
        );
    }
    out.push_str("] }");
    out
}

fn front(out: &mut String, device: &Device) {
    let count = device.front.len();
    let _ = writeln!(
        out,
        "    /// What the device has at its front, in ascending order.\n    pub static FRONT: [FrontWord; {count}] = ["
    );
    for FrontWord { name, scalar, offset, owner, meaning, is_text, source, page, doc } in &device.front {
        let meaning = meaning.and_then(|index| device.meanings.get(index));
        let meaning =
            meaning.map_or("None".to_owned(), |meaning| format!("Some(&{})", meaning_name(meaning)));
        let _ = writeln!(
            out,
            "        FrontWord {{ name: {name:?}, ty: RegType::{}, offset: {offset}, owner: Owner::{owner:?}, meaning: {meaning}, \
             is_text: {is_text}, source: {}, page: {page:?}, doc: {doc:?} }},",
            scalar.variant(),
            provenance(source)
        );
    }
    out.push_str("    ];\n\n");
}

/// Writes the front panel as an area. Its words are registers of a structure.
fn front_area(out: &mut String, device: &Device) {
    let Some(Front { words, area, .. }) = front::of(device) else { return };
    emit_structure(out, device, &words);
    let Area { name, name_from, space, first, bytes, page, doc, .. } = area;
    let from = provenance(&name_from);
    let _ = writeln!(
        out,
        "    /// The front as an area.\n    pub static FRONT_AREA: Area = Area {{ name: {name:?}, name_from: {from}, \
         space: &SPACES[{space}], first: {first}, bytes: {bytes}, cpu: None, page: {page:?}, doc: {doc:?}, phases: None, structures: &[AreaStructure {{ \
         structure: &FRONT_WORDS, live: RegisterPhase::ALWAYS, role: None, variable: \"_front\", variable_from: {from}, unused: &[] }}] }};\n\n    \
         const _: () = assert!(core::mem::offset_of!(commram::memory::Header, front) == {first});\n",
    );
}

fn ports(out: &mut String, device: &Device) {
    let count = device.ports.len();
    let _ = writeln!(
        out,
        "    /// The ports in the order of their numbers.\n    pub static PORTS: [Port; {count}] = ["
    );
    for Port { name, number, medium, roles, area } in &device.ports {
        // Only the port of a device in a folder has no area, and no tables are generated for such a device.
        let Some(area) = area else { continue };
        let roles: String = roles.iter().map(|role| format!("Role::{role:?}, ")).collect();
        let _ = writeln!(
            out,
            "        Port {{ name: {name:?}, number: commram::identity::PortNumber({number}), medium: {medium:?}, roles: &[{roles}], area: &AREAS[{area}] }},"
        );
    }
    out.push_str("    ];\n\n");
}

pub(crate) fn static_name(name: &str) -> String {
    name.to_uppercase()
}

fn emit_structure(out: &mut String, device: &Device, structure: &Structure) {
    let Structure { name, size, doc, page, name_from, .. } = structure;
    let name_from = provenance(name_from);
    let _ = writeln!(
        out,
        "    /// Descriptor of `{name}`.\n    pub static {}: Structure = Structure {{\n        \
         name: {name:?}, bytes: {size}, doc: {doc:?}, page: {page:?}, name_from: {name_from},\n        registers: &[",
        static_name(name)
    );
    for field in &structure.fields {
        match field.kind {
            FieldType::Scalar(_) => emit_register(out, device, None, field),
            FieldType::Sub(index) => {
                for member in &device.substructures[index].fields {
                    if matches!(member.kind, FieldType::Scalar(_)) {
                        emit_register(out, device, Some(field), member);
                    }
                }
            }
            FieldType::Padding(_) => {}
        }
    }
    out.push_str("        ],\n    };\n\n");
}

/// Writes the register `field` of the structure itself or, with `group`, of the sub-structure `group`.
fn emit_register(out: &mut String, device: &Device, group: Option<&Field>, field: &Field) {
    let FieldType::Scalar(scalar) = field.kind else { return };
    let mut dims = group.map_or(Vec::new(), |group| dims(device, group));
    let group_dims = dims.len();
    let group_type = group.and_then(|group| match group.kind {
        FieldType::Sub(index) => device.substructures.get(index),
        _ => None,
    });
    dims.extend(self::dims(device, field));
    let meaning = match field.meaning {
        Some(index) => {
            let meaning = &device.meanings[index];
            format!("Some(&{})", meaning_name(meaning))
        }
        None => "None".to_owned(),
    };
    let Field { name, array_type, also, reset, reserved, doc, .. } = field;
    let [name_from, offset_from, type_from] = field.sources(group);
    // For sub-structures that several structures share: the page where this structure uses it.
    let page = group.map_or(&field.page, |group| &group.page);
    let owner = match field.owner {
        Owner::Plc => "Plc",
        Owner::Firmware => "Firmware",
        Owner::Both => "Both",
    };
    let _ = writeln!(
        out,
        "            Register {{ group: {:?}, group_type: {:?}, group_type_from: {}, group_bytes: {}, name: {name:?}, ty: RegType::{}, offset: {}, dims: &[{}], \
         group_dims: {group_dims}, array_type: {array_type:?}, also: {also:?}, owner: Owner::{owner}, reset: 0x{reset:X}, reserved: {reserved}, \
         doc: {doc:?}, page: {page:?}, meaning: {meaning}, name_from: {}, offset_from: {}, type_from: {}, owner_from: {}, reset_from: {} }},",
        group.map_or("", |group| &group.name),
        group_type.map_or("", |group| &group.name),
        provenance(group_type.map_or(&Provenance::Manual, |group| &group.name_from)),
        group_type.map_or(0, |group| group.size),
        scalar.variant(),
        group.map_or(0, |group| group.offset) + field.offset,
        dims.concat(),
        provenance(&name_from),
        provenance(&offset_from),
        provenance(&type_from),
        provenance(&field.owner_from),
        provenance(&field.reset_from),
    );
}

/// Returns the source of the dimensions of `field` alone, outermost first.
fn dims(device: &Device, field: &Field) -> Vec<String> {
    let dims = device.dims(field).into_iter();
    dims.map(|Dim { count, used, stride }| {
        format!("Dim {{ count: {count}, used: {used}, stride: {stride} }}, ")
    })
    .collect()
}

pub(crate) fn provenance(from: &Provenance) -> String {
    match from {
        Provenance::Manual => "Provenance::Manual".to_owned(),
        Provenance::Documented(document) => format!("Provenance::Documented({document:?})"),
        Provenance::Inferred(decision) => format!("Provenance::Inferred({decision:?})"),
    }
}

fn meaning_name(meaning: &Meaning) -> String {
    format!("MEANING_{}", meaning.name.to_uppercase())
}

/// Writes a meaning with the pages of the device's manual. The family describes its own values and bits.
fn emit_meaning(out: &mut String, device: &Device, meaning: &Meaning) {
    let page = meaning.page_in(&device.manual);
    if meaning.shared {
        let theirs = path(device, true, &meaning_name(meaning));
        let _ = writeln!(
            out,
            "    static {}: Meaning = Meaning {{ name: {:?}, page: {page:?}, handshake: {theirs}.handshake, values: {theirs}.values, bits: {theirs}.bits }};\n",
            meaning_name(meaning),
            meaning.name,
        );
        return;
    }
    let handshake = meaning.handshake.map_or("None".to_owned(), |(request, answer)| {
        format!("Some(Handshake {{ request: {request}, answer: {answer} }})")
    });
    let _ = writeln!(
        out,
        "    /// Meaning `{}`.\n    pub static {}: Meaning = Meaning {{ name: {:?}, page: {page:?}, handshake: {handshake}, values: {}, bits: &[",
        meaning.name,
        meaning_name(meaning),
        meaning.name,
        values(&meaning.values)
    );
    for bit in &meaning.bits {
        let Bit { first, last, name, zero, one, text, joined, reserved, .. } = bit;
        let id = bit.id.as_deref().unwrap_or_default();
        let _ = writeln!(
            out,
            "        BitField {{ id: {id:?}, first: {first}, last: {last}, name: {name:?}, zero: {zero:?}, one: {one:?}, \
             text: {text:?}, values: {}, joined: {joined}, reserved: {reserved}, source: {} }},",
            values(&bit.values),
            provenance(&bit.source),
        );
    }
    out.push_str("    ] };\n\n");
}

fn values(values: &[model::Value]) -> String {
    let items: Vec<String> = values
        .iter()
        .map(|model::Value { id, first, last, text, reserved, source, .. }| {
            let (id, source) = (id.as_deref().unwrap_or_default(), provenance(source));
            format!("ValueMeaning {{ id: {id:?}, first: {first}, last: {last}, text: {text:?}, reserved: {reserved}, source: {source} }}")
        })
        .collect();
    format!("&[{}]", items.join(", "))
}
