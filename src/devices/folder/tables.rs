//! The tables of a layout that is read while the program runs. They have the form of the static tables that
//! the build generates for the layouts of commram.
//!
//! All code that names registers uses static tables, so the tables of folders are never freed. Their size is
//! limited: a folder has at most 2 MiB of text and [`MOST_REGISTERS`](super::MOST_REGISTERS), each text is
//! stored once, and a process reads at most [`MOST_FOLDERS`](super::MOST_FOLDERS) different folders.

use crate::identity::PortNumber;
use crate::layout::{
    Area, AreaStructure, BitField, DeviceLayout, Dim, FrontWord, Handshake, Meaning, Owner, Phase, Phases,
    Port, Provenance, RegType, Register, RegisterPhase, Retain, Role, Space, Structure, Unit, ValueMeaning,
};
use commram_layoutc::front;
use commram_layoutc::model;
use std::collections::HashMap;

/// Returns the tables of this layout, for the lifetime of the process.
pub(super) fn of(read: &commram_layoutc::Layout) -> &'static DeviceLayout {
    let device = &read.device;
    let mut tables = Tables::default();
    tables.meanings = device.meanings.iter().map(|meaning| tables.meaning(device, meaning)).collect();
    let phases = device.phases.as_ref().map(|phases| tables.phases(phases));
    let own_front = front::of(device);
    let front_space = own_front.as_ref().map(|front| &front.space);
    let spaces = device.spaces.iter().chain(front_space).map(|space| tables.space(space)).collect();
    let spaces: &'static [Space] = leaked(spaces);
    let structures: Vec<_> = device.structures.iter().map(|it| tables.structure(device, it)).collect();
    let placed = Placed { phases, spaces, structures };
    let areas: &'static [Area] = leaked(device.areas.iter().map(|area| tables.area(&placed, area)).collect());
    let retain = device.retain.as_ref().map(|(area, default_bytes)| {
        &*Box::leak(Box::new(Retain { area: tables.area(&placed, area), default_bytes: *default_bytes }))
    });
    let front = device.front.iter().map(|word| tables.front_word(word)).collect();
    let front_area = own_front.map(|front| {
        let words = tables.structure(device, &front.words);
        let area =
            Area { structures: leaked(vec![tables.front_words(words)]), ..tables.area(&placed, &front.area) };
        &*Box::leak(Box::new(area))
    });
    Box::leak(Box::new(DeviceLayout {
        name: tables.text(&device.name),
        title: tables.text(&device.title),
        manual: tables.text(&device.manual),
        undocumented: tables.text(&device.undocumented),
        layout_hash: read.layout_hash,
        spaces,
        areas,
        retain,
        objects: &[],
        gsd: None,
        front: leaked(front),
        front_area,
        ports: leaked(device.ports.iter().map(|port| tables.port(areas, port)).collect()),
        own: device.own.and_then(|area| areas.get(area)),
    }))
}

/// The area of a port without registers.
static NO_REGISTERS: Area = Area {
    name: "",
    name_from: Provenance::Manual,
    space: &Space {
        name: "",
        letter: 'M',
        segment: "",
        unit: Unit::Byte,
        first: 0,
        offset: 0,
        bytes: 0,
        page: "",
        doc: "",
    },
    first: 0,
    bytes: 0,
    cpu: None,
    doc: "",
    page: "",
    phases: None,
    structures: &[],
};

pub(super) fn leaked<T>(items: Vec<T>) -> &'static [T] {
    Box::leak(items.into_boxed_slice())
}

/// Returns the source of a fact. `lasting` converts the text of the source to a static text.
pub(super) fn provenance(from: &model::Provenance, lasting: impl FnOnce(&str) -> &'static str) -> Provenance {
    match from {
        model::Provenance::Manual => Provenance::Manual,
        model::Provenance::Documented(document) => Provenance::Documented(lasting(document)),
        model::Provenance::Inferred(decision) => Provenance::Inferred(lasting(decision)),
    }
}

/// Structures and other tables to which areas refer.
struct Placed {
    phases: Option<&'static Phases>,
    spaces: &'static [Space],
    structures: Vec<&'static Structure>,
}

/// Tables of a layout while they are created.
#[derive(Default)]
struct Tables {
    /// Stores each text only once. This saves memory, because the registers of shared sub-structures have
    /// equal texts.
    texts: HashMap<String, &'static str>,
    meanings: Vec<&'static Meaning>,
}

impl Tables {
    fn text(&mut self, text: &str) -> &'static str {
        if let Some(known) = self.texts.get(text) {
            return known;
        }
        let new: &'static str = Box::leak(text.to_owned().into_boxed_str());
        self.texts.insert(text.to_owned(), new);
        new
    }

    fn from(&mut self, from: &model::Provenance) -> Provenance {
        provenance(from, |text| self.text(text))
    }

    fn meaning(&mut self, device: &model::Device, meaning: &model::Meaning) -> &'static Meaning {
        let bits = meaning.bits.iter().map(|bit| self.bit(bit)).collect();
        let handshake = meaning.handshake.map(|(request, answer)| Handshake { request, answer });
        Box::leak(Box::new(Meaning {
            name: self.text(&meaning.name),
            page: self.text(meaning.page_in(&device.manual)),
            handshake,
            values: self.values(&meaning.values),
            bits: leaked(bits),
        }))
    }

    fn values(&mut self, values: &[model::Value]) -> &'static [ValueMeaning] {
        let value = |value: &model::Value| ValueMeaning {
            id: self.text(value.id.as_deref().unwrap_or_default()),
            first: value.first,
            last: value.last,
            text: self.text(&value.text),
            reserved: value.reserved,
            source: self.from(&value.source),
        };
        leaked(values.iter().map(value).collect())
    }

    fn bit(&mut self, bit: &model::Bit) -> BitField {
        BitField {
            id: self.text(bit.id.as_deref().unwrap_or_default()),
            first: bit.first,
            last: bit.last,
            name: self.text(&bit.name),
            zero: self.text(&bit.zero),
            one: self.text(&bit.one),
            text: self.text(&bit.text),
            values: self.values(&bit.values),
            joined: bit.joined,
            reserved: bit.reserved,
            source: self.from(&bit.source),
        }
    }

    fn phases(&mut self, phases: &model::Phases) -> &'static Phases {
        let phase = |phase: &model::Phase| Phase {
            name: self.text(&phase.name),
            from: phase.from,
            doc: self.text(&phase.doc),
        };
        let values = phases.values.iter().map(phase).collect();
        Box::leak(Box::new(Phases {
            register: self.text(&phases.register),
            source: self.from(&phases.source),
            phases: leaked(values),
        }))
    }

    fn space(&mut self, space: &model::Space) -> Space {
        let segment = space.segment.map_or(String::new(), |segment| format!("{segment}."));
        Space {
            name: self.text(&space.name),
            letter: match space.letter {
                model::Letter::I => 'I',
                model::Letter::Q => 'Q',
                model::Letter::M => 'M',
                model::Letter::F => 'F',
            },
            segment: self.text(&segment),
            unit: match space.unit {
                model::Unit::Byte => Unit::Byte,
                model::Unit::Word => Unit::Word,
            },
            first: space.first,
            offset: space.offset,
            bytes: space.bytes,
            page: self.text(&space.page),
            doc: self.text(&space.doc),
        }
    }

    fn structure(&mut self, device: &model::Device, structure: &model::Structure) -> &'static Structure {
        let mut registers = Vec::new();
        for field in &structure.fields {
            match field.kind {
                model::FieldType::Scalar(scalar) => {
                    registers.push(self.register(device, None, (field, scalar)))
                }
                model::FieldType::Sub(index) => {
                    let sub = &device.substructures[index];
                    for member in &sub.fields {
                        if let model::FieldType::Scalar(scalar) = member.kind {
                            registers.push(self.register(device, Some((field, sub)), (member, scalar)));
                        }
                    }
                }
                model::FieldType::Padding(_) => {}
            }
        }
        Box::leak(Box::new(Structure {
            name: self.text(&structure.name),
            bytes: structure.size,
            doc: self.text(&structure.doc),
            page: self.text(&structure.page),
            name_from: self.from(&structure.name_from),
            registers: leaked(registers),
        }))
    }

    /// Creates the register `field`. It is a field of the structure itself or, with `group`, of a
    /// sub-structure of that type.
    fn register(
        &mut self,
        device: &model::Device,
        group: Option<(&model::Field, &model::Structure)>,
        (field, scalar): (&model::Field, model::Scalar),
    ) -> Register {
        let mut dims = group.map_or(Vec::new(), |(group, _)| device.dims(group));
        let group_dims = dims.len();
        dims.extend(device.dims(field));
        let [name_from, offset_from, type_from] = field.sources(group.map(|(group, _)| group));
        let dim =
            |dim: model::Dim| Dim { count: dim.count as u16, used: dim.used as u16, stride: dim.stride };
        Register {
            group: self.text(group.map_or("", |(group, _)| &group.name)),
            group_type: self.text(group.map_or("", |(_, sub)| &sub.name)),
            group_type_from: group.map_or(Provenance::Manual, |(_, sub)| self.from(&sub.name_from)),
            group_bytes: group.map_or(0, |(_, sub)| sub.size),
            name: self.text(&field.name),
            ty: data_type(scalar),
            offset: group.map_or(0, |(group, _)| group.offset) + field.offset,
            // Bounds are at most 65535.
            dims: leaked(dims.into_iter().map(dim).collect()),
            group_dims,
            array_type: self.text(&field.array_type),
            also: self.text(&field.also),
            owner: owner(field.owner),
            reset: field.reset,
            reserved: field.reserved,
            doc: self.text(&field.doc),
            page: self.text(group.map_or(&field.page, |(group, _)| &group.page)),
            meaning: field.meaning.and_then(|index| self.meanings.get(index).copied()),
            name_from: self.from(&name_from),
            offset_from: self.from(&offset_from),
            type_from: self.from(&type_from),
            owner_from: self.from(&field.owner_from),
            reset_from: self.from(&field.reset_from),
        }
    }

    fn area(&mut self, placed: &Placed, area: &model::Area) -> Area {
        let has_phases = area.structures.iter().any(|structure| structure.live != 0);
        let structures = area.structures.iter().map(|it| self.area_structure(placed, it)).collect();
        Area {
            name: self.text(&area.name),
            name_from: self.from(&area.name_from),
            space: &placed.spaces[area.space],
            first: area.first,
            bytes: area.bytes,
            cpu: area.cpu,
            doc: self.text(&area.doc),
            page: self.text(&area.page),
            phases: placed.phases.filter(|_| has_phases),
            structures: leaked(structures),
        }
    }

    fn area_structure(&mut self, placed: &Placed, it: &model::AreaStructure) -> AreaStructure {
        let unused = it.unused.iter().map(|name| self.text(name)).collect();
        AreaStructure {
            structure: placed.structures[it.structure],
            // A layout has at most 255 phases.
            live: RegisterPhase::numbered(it.live as u8),
            role: it.role.map(role),
            variable: self.text(&it.variable),
            variable_from: self.from(&it.variable_from),
            unused: leaked(unused),
        }
    }

    /// Returns the only structure of the front panel's area.
    fn front_words(&mut self, structure: &'static Structure) -> AreaStructure {
        AreaStructure {
            structure,
            live: RegisterPhase::ALWAYS,
            role: None,
            variable: "_front",
            variable_from: structure.name_from,
            unused: &[],
        }
    }

    fn front_word(&mut self, word: &model::FrontWord) -> FrontWord {
        FrontWord {
            name: self.text(&word.name),
            ty: data_type(word.scalar),
            offset: word.offset,
            owner: owner(word.owner),
            meaning: word.meaning.and_then(|index| self.meanings.get(index).copied()),
            is_text: word.is_text,
            source: self.from(&word.source),
            page: self.text(&word.page),
            doc: self.text(&word.doc),
        }
    }

    fn port(&mut self, areas: &'static [Area], port: &model::Port) -> Port {
        Port {
            name: self.text(&port.name),
            number: PortNumber(port.number),
            medium: self.text(&port.medium),
            roles: leaked(port.roles.iter().copied().map(role).collect()),
            area: port.area.and_then(|area| areas.get(area)).unwrap_or(&NO_REGISTERS),
        }
    }
}

fn data_type(scalar: model::Scalar) -> RegType {
    match scalar {
        model::Scalar::Byte => RegType::Byte,
        model::Scalar::Word => RegType::Word,
        model::Scalar::Dword => RegType::Dword,
        model::Scalar::Sint => RegType::Sint,
        model::Scalar::Int => RegType::Int,
        model::Scalar::Dint => RegType::Dint,
        model::Scalar::Usint => RegType::Usint,
        model::Scalar::Uint => RegType::Uint,
        model::Scalar::Udint => RegType::Udint,
    }
}

fn owner(owner: model::Owner) -> Owner {
    match owner {
        model::Owner::Plc => Owner::Plc,
        model::Owner::Firmware => Owner::Firmware,
        model::Owner::Both => Owner::Both,
    }
}

fn role(role: model::Role) -> Role {
    match role {
        model::Role::Master => Role::Master,
        model::Role::Slave => Role::Slave,
        model::Role::Peer => Role::Peer,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices;
    use std::fmt::Write;
    use std::path::Path;

    /// Everything about areas, structures and registers.
    fn described(layout: &'static DeviceLayout) -> String {
        let mut text = format!("{} {:X} {}\n", layout.title, layout.layout_hash, layout.undocumented);
        let _ = writeln!(text, "{:?}", layout.spaces);
        let retain = layout.retain.map(|retain| &retain.area);
        for area in layout.areas.iter().chain(layout.front_area).chain(retain) {
            let Area { name, name_from, space, first, bytes, cpu, doc, page, phases, structures } = area;
            let _ = writeln!(text, "{name} {name_from} {space:?} {first} {bytes} {cpu:?} {doc} {page}");
            if let Some(Phases { register, source, phases }) = phases {
                let _ = writeln!(text, "{register} {source}");
                for Phase { name, from, doc } in *phases {
                    let _ = writeln!(text, "{name} {from} {doc}");
                }
            }
            for placed in *structures {
                let Structure { name, bytes, doc, page, name_from, registers } = placed.structure;
                let _ = writeln!(text, "{placed:?} {name} {bytes} {doc} {page} {name_from} {registers:?}");
            }
        }
        for word in layout.front {
            let FrontWord { name, ty, offset, owner, meaning, is_text, source, page, doc } = word;
            let _ =
                writeln!(text, "{name} {ty} {offset} {owner} {meaning:?} {is_text} {source} {page} {doc}");
        }
        for Port { name, number, medium, roles, area } in layout.ports {
            let _ = writeln!(text, "{name} {number} {medium} {roles:?} {}", area.name);
        }
        let _ = writeln!(text, "{:?}", layout.own);
        text
    }

    /// This module makes the same tables as the build from the same files.
    #[test]
    fn the_tables_are_those_of_the_build() {
        let layouts = Path::new(env!("CARGO_MANIFEST_DIR")).join("layouts");
        for known in devices::all() {
            let read = commram_layoutc::read(&layouts.join(known.layout.name)).unwrap();
            assert_eq!(described(of(&read)), described(known.layout), "{}", known.layout.name);
        }
    }
}
