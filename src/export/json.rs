//! A JSON document with all known facts about registers and header page. `docs/reference/export.md` describes its
//! structure, which changes only with [`VERSION`].

use super::rows;
use super::scope::Scope;
use super::text;
use crate::layout::{Area, BitField, Dim, Register, Space, Structure, ValueMeaning};
use crate::memory::HEADER_SIZE;
use crate::memory::contract::{self, FieldKind, HeaderStruct};
use crate::memory::header::ABI_VERSION;
use serde_json::{Map, Value, json};

/// Version of the document's structure. New keys do not change it.
const VERSION: u32 = 2;

pub(crate) fn generate(scope: &Scope) -> String {
    let device = scope.device;
    let document = json!({
        "schema": "commram.registers",
        "schema_version": VERSION,
        "made_by": format!("commram {}", text::version()),
        "device": device.name,
        "title": device.title,
        "manual": device.manual,
        "layout_hash": format!("{:016X}", device.layout_hash),
        "segment_size": device.segment_size(),
        "spaces": device.spaces.iter().map(space).collect::<Vec<_>>(),
        "header": header(),
        "areas": scope.areas.iter().map(|area| self::area(area)).collect::<Vec<_>>(),
        "structures": scope.structures().into_iter().map(structure).collect::<Vec<_>>(),
        "meanings": meanings(scope),
    });
    format!("{document:#}\n")
}

fn space(of: &Space) -> Value {
    json!({
        "letter": of.letter.to_string(),
        "segment": of.segment,
        "unit": of.unit.width().bytes(),
        "first": of.first,
        "offset": of.offset,
        "bytes": of.bytes,
        "doc": of.doc,
        "page": of.page,
    })
}

fn header() -> Value {
    let code =
        |(value, name, doc): &(u32, &str, &str)| json!({ "value": value, "name": name, "doc": doc.trim() });
    let codes =
        contract::CODES.iter().map(|of| (of.name.to_owned(), of.codes.iter().map(code).collect::<Value>()));
    json!({
        "size": HEADER_SIZE,
        "abi_version": ABI_VERSION,
        "structures": contract::structures().into_iter().map(header_struct).collect::<Vec<_>>(),
        "codes": codes.collect::<Map<_, _>>(),
    })
}

fn header_struct(of: &HeaderStruct) -> Value {
    let fields = of.fields.iter().map(|field| {
        let kind = match field.kind {
            FieldKind::Integer(bytes) => format!("u{}", 8 * bytes),
            FieldKind::Struct(of) => of.name.to_owned(),
        };
        json!({
            "name": field.name,
            "offset": field.offset,
            "type": kind,
            "count": field.count,
            "bytes": field.bytes(),
            "doc": field.meaning().unwrap_or_default(),
        })
    });
    json!({ "name": of.name, "bytes": of.bytes, "fields": fields.collect::<Vec<_>>() })
}

fn area(area: &Area) -> Value {
    let structures = area.structures.iter().map(|placed| {
        json!({
            "structure": placed.structure.name,
            "live": rows::live(area, placed),
            "live_provenance": area.phase_source(placed.live).to_string(),
            "variable": placed.variable,
            "variable_provenance": placed.variable_from.to_string(),
        })
    });
    json!({
        "name": area.name,
        "provenance": area.name_from.to_string(),
        "first": area.first,
        "bytes": area.bytes,
        "cpu_first": area.cpu.map(|(first, _)| first),
        "cpu_last": area.cpu.map(|(_, last)| last),
        "doc": area.doc,
        "page": area.page,
        "structures": structures.collect::<Vec<_>>(),
    })
}

fn structure(structure: &Structure) -> Value {
    json!({
        "name": structure.name,
        "bytes": structure.bytes,
        "doc": structure.doc,
        "page": structure.page,
        "provenance": structure.name_from.to_string(),
        "registers": structure.registers.iter().map(register).collect::<Vec<_>>(),
    })
}

fn register(register: &Register) -> Value {
    let dim = |dim: &Dim| json!({ "count": dim.count, "used": dim.used, "stride": dim.stride });
    json!({
        "name": register.name,
        "pattern": register.pattern(),
        "group": register.group,
        "group_type": register.group_type,
        "group_bytes": register.group_bytes,
        "group_dims": register.group_dims,
        "dims": register.dims.iter().map(dim).collect::<Vec<_>>(),
        "type": register.ty.name(),
        "bytes": register.ty.width(),
        "offset": register.offset,
        "owner": register.owner.to_string().to_lowercase(),
        "reset": register.reset,
        "reserved": register.reserved,
        "meaning": register.meaning.map(|meaning| meaning.name),
        "doc": register.doc,
        "page": register.page,
        "provenance": register.facts().map(|(fact, from)| (fact.to_owned(), from.to_string().into()))
            .into_iter().collect::<Map<_, _>>(),
        "group_type_provenance": register.group_type_from.to_string(),
    })
}

fn meanings(scope: &Scope) -> Value {
    let meaning = |meaning: &crate::layout::Meaning| {
        json!({
            "page": meaning.page,
            "values": values(meaning.values),
            "bits": meaning.bits.iter().map(bit).collect::<Vec<_>>(),
        })
    };
    let named = scope.meanings().into_iter().map(|(known, _)| (known.name.to_owned(), meaning(known)));
    Value::Object(named.collect::<Map<_, _>>())
}

fn values(values: &[ValueMeaning]) -> Value {
    let value = |known: &ValueMeaning| {
        json!({
            "first": known.first,
            "last": known.last,
            "text": known.text,
            "reserved": known.reserved,
            "provenance": known.source.to_string(),
        })
    };
    values.iter().map(value).collect()
}

fn bit(field: &BitField) -> Value {
    json!({
        "first": field.first,
        "last": field.last,
        "name": field.name,
        "zero": field.zero,
        "one": field.one,
        "text": field.text,
        "values": values(field.values),
        "joined": field.joined,
        "reserved": field.reserved,
        "provenance": field.source.to_string(),
    })
}
