//! Object dictionaries: the entries of a CANopen device that an SDO reaches, from a TOML file of its layout.

use crate::error::{Error, Reason};
use crate::raw::Provenance;
use crate::source::{SourcePlace, Sources, at};
use serde::Deserialize;
use toml::Spanned;

/// The file as written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    object: Vec<Spanned<Row>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Row {
    index: u16,
    sub: u8,
    name: String,
    #[serde(rename = "type")]
    ty: Option<Type>,
    access: Access,
    default: Option<Default>,
    #[serde(default)]
    saved: bool,
    page: String,
    doc: String,
    row_from: Option<Provenance>,
    default_from: Option<Provenance>,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Type {
    U8,
    U16,
    U32,
    String,
    Domain,
}

#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Access {
    #[serde(rename = "ro")]
    ReadOnly,
    #[serde(rename = "rw")]
    ReadWrite,
    #[serde(rename = "none")]
    NotImplemented,
}

#[derive(Deserialize, Clone)]
#[serde(untagged)]
enum Default {
    Number(u32),
    Text(String),
}

/// An entry of the object dictionary that has been checked.
pub(crate) struct Object {
    pub index: u16,
    pub sub: u8,
    pub name: String,
    pub ty: Option<Type>,
    pub access: Access,
    pub default: Value,
    pub saved: bool,
    pub page: String,
    pub doc: String,
    pub row_from: Provenance,
    pub default_from: Provenance,
}

/// The value that an entry has after power-on.
#[derive(Debug)]
pub(crate) enum Value {
    Nothing,
    Number(u32),
    PlusNode(u32),
    Text(String),
}

/// Reads and checks the file that `device.toml` names at `place`.
pub(crate) fn read(sources: &mut Sources, path: &str, place: SourcePlace) -> Result<Vec<Object>, Error> {
    let (file, raw): (usize, File) = sources.parse(path, Some(place))?;
    let mut objects: Vec<Object> = Vec::with_capacity(raw.object.len());
    for row in raw.object {
        let place = at(file, row.span());
        let row = row.into_inner();
        let name = format!("16#{:04X} sub {}", row.index, row.sub);
        if objects.last().is_some_and(|last| (last.index, last.sub) >= (row.index, row.sub)) {
            return Err(sources.error(place, Reason::ObjectOrder(name)));
        }
        if row.ty.is_none() != (row.access == Access::NotImplemented) {
            return Err(sources.error(place, Reason::ObjectType(name)));
        }
        let Some(default) = value(row.ty, row.default) else {
            return Err(sources.error(place, Reason::ObjectDefault(name)));
        };
        let row_from = row.row_from.unwrap_or(Provenance::Manual);
        objects.push(Object {
            index: row.index,
            sub: row.sub,
            name: row.name,
            ty: row.ty,
            access: row.access,
            default,
            saved: row.saved,
            page: row.page,
            doc: row.doc,
            default_from: row.default_from.unwrap_or_else(|| row_from.clone()),
            row_from,
        });
    }
    Ok(objects)
}

/// Returns the default of an entry of this type; `None` if the value does not fit the type.
fn value(ty: Option<Type>, default: Option<Default>) -> Option<Value> {
    let most = match ty {
        Some(Type::U8) => u8::MAX.into(),
        Some(Type::U16) => u16::MAX.into(),
        Some(Type::U32) => u32::MAX,
        Some(Type::String) => {
            return match default {
                Some(Default::Text(text)) => Some(Value::Text(text)),
                _ => None,
            };
        }
        Some(Type::Domain) | None => return default.is_none().then_some(Value::Nothing),
    };
    match default {
        None => Some(Value::Nothing),
        Some(Default::Number(number)) => (number <= most).then_some(Value::Number(number)),
        Some(Default::Text(text)) if text == "node" => Some(Value::PlusNode(0)),
        Some(Default::Text(text)) => {
            let number = text.strip_prefix("0x")?.strip_suffix(" + node")?;
            u32::from_str_radix(number, 16).ok().filter(|number| *number <= most).map(Value::PlusNode)
        }
    }
}
