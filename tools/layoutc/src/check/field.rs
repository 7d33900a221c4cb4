//! One register in a layout file: type, name, array bounds, reset value, meaning.

use super::{Parts, identifier, meaning};
use crate::error::{Error, Reason};
use crate::model::{Field, FieldType, Owner, Scalar};
use crate::raw;
use crate::source::{SourcePlace, Sources, at};
use toml::Spanned;

/// A checked field, with the place of its entry in the file.
pub(crate) type LocatedField = (SourcePlace, Field);

/// Checks all properties that concern only `entry`. `home` is the structure or block that contains the entry.
pub(crate) fn check(
    sources: &Sources,
    parts: &Parts,
    file: usize,
    home: &raw::Structure,
    entry: &Spanned<raw::Entry>,
) -> Result<LocatedField, Error> {
    let place = at(file, entry.span());
    let entry = entry.get_ref();
    if let Some(bytes) = &entry.padding {
        if entry.name.is_some() || entry.ty.is_some() || entry.array.is_some() {
            return Err(sources.error(place, Reason::PaddingWithKeys));
        }
        return Ok((place, padding(entry, *bytes.get_ref(), home)));
    }
    let missing = |key| sources.error(place, Reason::MissingKey(key));
    let name_at = entry.name.as_ref().ok_or_else(|| missing("name"))?;
    let name = name_at.get_ref();
    identifier(sources, at(file, name_at.span()), name)?;
    let ty = entry.ty.as_ref().ok_or_else(|| missing("type"))?;
    let kind = kind(sources, parts, at(file, ty.span()), ty.get_ref())?;
    let (dims, used) = dims(sources, file, entry, name)?;
    if let (FieldType::Sub(_), Some(array), 2..) = (kind, &entry.array, dims.len()) {
        return Err(sources.error(at(file, array.span()), Reason::NestedArray(name.clone())));
    }
    if dims.is_empty() {
        prefix(sources, at(file, name_at.span()), name, kind)?;
    }
    let array_type = match &entry.array_type {
        Some(array_type) if dims.is_empty() => {
            return Err(
                sources.error(at(file, array_type.span()), Reason::ArrayTypeWithoutArray(name.clone()))
            );
        }
        Some(array_type) => {
            identifier(sources, at(file, array_type.span()), array_type.get_ref())?;
            array_type.get_ref().clone()
        }
        None => String::new(),
    };
    let also = match &entry.also {
        Some(also) => {
            identifier(sources, at(file, also.span()), also.get_ref())?;
            if let FieldType::Sub(_) = kind {
                let reason = Reason::AlsoOfSubstructure(name.clone());
                return Err(sources.error(at(file, also.span()), reason));
            }
            also.get_ref().clone()
        }
        None => String::new(),
    };
    let doc = entry.doc.clone().ok_or_else(|| missing("doc"))?;
    let (owner, owner_from) = match (entry.reserved, entry.owner) {
        (true, Some(_)) => return Err(sources.error(place, Reason::ReservedWithOwner(name.clone()))),
        (true, None) => (Some(parts.reserved.owner), &parts.reserved.source),
        (false, owner) => (owner, entry.owner_from.as_ref().unwrap_or(&home.owners)),
    };
    let (owner, reset, meaning) = match kind {
        FieldType::Scalar(scalar) => {
            let owner = owner.ok_or_else(|| missing("owner"))?;
            if entry.reset.is_some() && entry.reset_from.is_none() {
                return Err(missing("reset_from"));
            }
            let meaning = match &entry.meaning {
                Some(m) => {
                    let wanted = (m.get_ref().as_str(), at(file, m.span()));
                    Some(meaning::find(sources, parts, wanted, name, scalar)?)
                }
                None => None,
            };
            (owner, reset(sources, file, entry, name, scalar)?, meaning)
        }
        _ => {
            if let Some(reset) = &entry.reset {
                let reason = Reason::ResetOfSubstructure(name.clone());
                return Err(sources.error(at(file, reset.span()), reason));
            }
            (Owner::Both, 0, None)
        }
    };
    let field = Field {
        name: name.clone(),
        view_name: entry.view_name.as_ref().unwrap_or(name_at).get_ref().clone(),
        offset: offset(entry),
        kind,
        dims,
        used,
        array_type,
        also,
        reserved: entry.reserved,
        owner,
        reset,
        page: entry.page.clone().unwrap_or_else(|| home.page.clone()),
        doc,
        meaning,
        name_from: entry.name_from.clone().unwrap_or_else(|| home.names.clone()),
        offset_from: entry.offset_from.clone().unwrap_or_else(|| home.offsets.clone()),
        type_from: entry.type_from.clone().unwrap_or_else(|| home.types.clone()),
        owner_from: owner_from.clone(),
        reset_from: entry.reset_from.clone().unwrap_or_else(|| home.resets.clone()),
    };
    Ok((place, field))
}

/// Returns the offset in the file. A register without an offset gets it from the structure of `view`.
fn offset(entry: &raw::Entry) -> u32 {
    entry.offset.as_ref().map_or(0, |offset| *offset.get_ref())
}

fn padding(entry: &raw::Entry, bytes: u32, home: &raw::Structure) -> Field {
    gap(offset(entry), bytes, home)
}

/// Returns a field for bytes without a register.
pub(crate) fn gap(offset: u32, bytes: u32, home: &raw::Structure) -> Field {
    Field {
        name: format!("_padding_{offset}"),
        view_name: String::new(),
        offset,
        kind: FieldType::Padding(bytes),
        dims: Vec::new(),
        used: Vec::new(),
        array_type: String::new(),
        also: String::new(),
        reserved: true,
        owner: Owner::Firmware,
        reset: 0,
        page: home.page.clone(),
        doc: "Padding".to_owned(),
        meaning: None,
        name_from: home.offsets.clone(),
        offset_from: home.offsets.clone(),
        type_from: home.offsets.clone(),
        owner_from: home.offsets.clone(),
        reset_from: home.offsets.clone(),
    }
}

fn kind(sources: &Sources, parts: &Parts, place: SourcePlace, name: &str) -> Result<FieldType, Error> {
    if let Some(scalar) = Scalar::named(name) {
        return Ok(FieldType::Scalar(scalar));
    }
    if let Some(index) = parts.substructures.iter().position(|sub| sub.name == name) {
        return Ok(FieldType::Sub(index));
    }
    let subs = parts.substructures.iter().map(|sub| format!(", {}", sub.name)).collect();
    Err(sources.error(place, Reason::UnknownType(name.to_owned(), subs)))
}

/// Returns the array bounds and, for each of them, the number of used elements.
fn dims(
    sources: &Sources,
    file: usize,
    entry: &raw::Entry,
    name: &str,
) -> Result<(Vec<u32>, Vec<u32>), Error> {
    let Some(array) = &entry.array else {
        return Ok((Vec::new(), Vec::new()));
    };
    let dims = array.get_ref();
    let place = at(file, array.span());
    if !(1..=2).contains(&dims.len()) || dims.iter().any(|n| !(1..=65_535).contains(n)) {
        return Err(sources.error(place, Reason::BadArray(dims.clone())));
    }
    if short_name(name).is_some_and(|short| short != "a") {
        return Err(sources.error(place, Reason::ArrayPrefix(name.to_owned())));
    }
    let Some(used) = &entry.used else {
        return Ok((dims.clone(), dims.clone()));
    };
    let place = at(file, used.span());
    let used = used.get_ref();
    if used.len() != dims.len() || used.iter().zip(dims).any(|(used, n)| used > n) {
        return Err(sources.error(place, Reason::BadUsed { used: used.clone(), array: dims.clone() }));
    }
    Ok((dims.clone(), used.clone()))
}

/// Returns the short name of a data type at the start of a register name, if there is one: neither `CAN_OPEN` nor
/// `cfg_len` has one.
fn short_name(name: &str) -> Option<&str> {
    let known =
        |prefix: &&str| ["", "a"].contains(prefix) || Scalar::prefixes().any(|short| short == *prefix);
    name.split_once('_').map(|(prefix, _)| prefix).filter(known)
}

/// Checks that the short name of the data type agrees with the type.
fn prefix(sources: &Sources, place: SourcePlace, name: &str, kind: FieldType) -> Result<(), Error> {
    let Some(prefix) = short_name(name) else { return Ok(()) };
    if prefix == "a" {
        return Err(sources.error(place, Reason::ArrayPrefix(name.to_owned())));
    }
    let (expected, found) = match kind {
        FieldType::Scalar(scalar) => (scalar.prefix(), scalar.name()),
        _ => ("", "a sub-structure"),
    };
    if prefix == expected {
        return Ok(());
    }
    let reason = Reason::Prefix {
        name: name.to_owned(),
        expected: if prefix.is_empty() { "a sub-structure" } else { "another type" }.to_owned(),
        found: format!("{found} (`{expected}_`)"),
    };
    Err(sources.error(place, reason))
}

fn reset(
    sources: &Sources,
    file: usize,
    entry: &raw::Entry,
    name: &str,
    scalar: Scalar,
) -> Result<u32, Error> {
    let Some(reset) = &entry.reset else {
        return Ok(0);
    };
    let value = *reset.get_ref();
    let bits = scalar.width() * 8;
    let range = if scalar.signed() { -(1i64 << (bits - 1))..1i64 << (bits - 1) } else { 0..1i64 << bits };
    if !range.contains(&value) {
        let reason = meaning::too_wide("reset value", value, name, scalar);
        return Err(sources.error(at(file, reset.span()), reason));
    }
    // Truncation keeps the two's complement of the register's width.
    Ok((value & ((1i64 << bits) - 1)) as u32)
}
