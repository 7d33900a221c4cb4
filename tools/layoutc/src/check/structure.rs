//! Checks that the registers of a structure are in ascending order and aligned, without overlaps and undeclared gaps.

use super::field::{self, LocatedField};
use super::view;
use super::{Names, Parts};
use crate::error::{Error, Reason};
use crate::model::{Field, FieldType, Structure};
use crate::raw;
use crate::source::{Sources, at};

/// Checks `raw` with the blocks it includes.
pub(crate) fn check(
    sources: &Sources,
    parts: &Parts,
    file: usize,
    raw: &raw::Structure,
) -> Result<Structure, Error> {
    let subs = &parts.substructures;
    let view = raw.view.as_ref().map(|wanted| view::find(sources, parts, file, wanted)).transpose()?;
    let view = view.map(|index| (index, &parts.structures[index]));
    let mut names = Names::default();
    let mut fields: Vec<LocatedField> = Vec::new();
    for block in &raw.blocks {
        let Some((block_file, block)) =
            parts.blocks.iter().find(|(_, known)| known.name.get_ref() == block.get_ref())
        else {
            let reason = Reason::UnknownBlock(block.get_ref().clone());
            return Err(sources.error(at(file, block.span()), reason));
        };
        add(sources, parts, view, (*block_file, block), &mut names, &mut fields)?;
    }
    add(sources, parts, view, (file, raw), &mut names, &mut fields)?;
    fields.sort_by_key(|(_, field)| field.offset);

    let name_at = at(file, raw.name.span());
    let size_at = raw.size.as_ref().map_or(name_at, |size| at(file, size.span()));
    let size = match (&raw.size, view) {
        (Some(size), None) => *size.get_ref(),
        (None, Some((_, view))) => view.size,
        (None, None) => return Err(sources.error(name_at, Reason::MissingKey("size"))),
        (Some(_), Some(_)) => return Err(sources.error(size_at, Reason::OwnPlace)),
    };
    if view.is_some() {
        view::fill_gaps(raw, subs, size, name_at, &mut fields);
    }
    let mut end = 0;
    let mut previous = "the start of the structure";
    for (place, field) in &fields {
        let Field { name, offset, .. } = field;
        let (name, offset) = (name.clone(), *offset);
        let align = field.align(subs);
        if offset < end {
            let previous = previous.to_owned();
            return Err(sources.error(*place, Reason::Overlap { name, offset, previous, end }));
        }
        if !offset.is_multiple_of(align) {
            let ty = type_name(field.kind, subs).to_owned();
            return Err(sources.error(*place, Reason::Misaligned { name, ty, offset, align }));
        }
        if offset > end {
            return Err(sources
                .error(*place, Reason::Gap { name: format!("`{name}`"), start: end, bytes: offset - end }));
        }
        end = offset.saturating_add(field.size(subs));
        if end > size {
            let structure = raw.name.get_ref().clone();
            return Err(sources.error(*place, Reason::PastStructureEnd { name, end, structure, size }));
        }
        previous = &field.name;
    }
    if end < size {
        let name = format!("the end of `{}`", raw.name.get_ref());
        return Err(sources.error(size_at, Reason::Gap { name, start: end, bytes: size - end }));
    }
    let align = fields.iter().map(|(_, field)| field.align(subs)).max().unwrap_or(1);
    if !size.is_multiple_of(align) {
        let structure = raw.name.get_ref().clone();
        return Err(sources.error(size_at, Reason::OddSize { structure, size, align }));
    }
    let name_from = raw.name_from.clone();
    Ok(Structure {
        name: raw.name.get_ref().clone(),
        name_from: name_from.ok_or_else(|| sources.error(size_at, Reason::UnnamedSource))?,
        size,
        align,
        page: raw.page.clone(),
        doc: raw.doc.clone(),
        shared: false,
        view: view.map(|(index, _)| index),
        fields: fields.into_iter().map(|(_, field)| field).collect(),
    })
}

fn add(
    sources: &Sources,
    parts: &Parts,
    view: Option<(usize, &Structure)>,
    (file, raw): (usize, &raw::Structure),
    names: &mut Names,
    fields: &mut Vec<LocatedField>,
) -> Result<(), Error> {
    for entry in &raw.register {
        let mut placed = field::check(sources, parts, file, raw, entry)?;
        match (view, &entry.get_ref().offset) {
            (Some((_, view)), None) => view::place(sources, view, &mut placed)?,
            (Some(_), Some(_)) => return Err(sources.error(placed.0, Reason::OwnPlace)),
            (None, Some(_)) => {}
            (None, None) => return Err(sources.error(placed.0, Reason::MissingKey("offset"))),
        }
        if let Some(name) = &entry.get_ref().name {
            names.add(sources, file, name)?;
        }
        fields.push(placed);
    }
    Ok(())
}

fn type_name(kind: FieldType, subs: &[Structure]) -> &str {
    match kind {
        FieldType::Scalar(scalar) => scalar.name(),
        FieldType::Sub(index) => &subs[index].name,
        FieldType::Padding(_) => "padding",
    }
}
