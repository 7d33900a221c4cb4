//! A structure that firmware and function blocks look at as one of the family's: what the two have in common lies alike.

use super::Parts;
use crate::error::{Error, Reason};
use crate::model::Structure;
use crate::raw;
use crate::source::{Sources, at};
use toml::Spanned;

/// The family's structure called `wanted`, if `structure`, written as `raw`, can be looked at as it.
pub fn check(
    sources: &Sources,
    parts: &Parts,
    file: usize,
    wanted: &Spanned<String>,
    raw: &raw::Structure,
    structure: &Structure,
) -> Result<usize, Error> {
    let is_it = |known: &Structure| known.shared && known.name == *wanted.get_ref();
    let Some(index) = parts.structures.iter().position(is_it) else {
        return Err(sources.error(at(file, wanted.span()), Reason::UnknownView(wanted.get_ref().clone())));
    };
    let view = &parts.structures[index];
    if structure.size != view.size {
        let (view, size) = (view.name.clone(), view.size);
        return Err(sources.error(at(file, raw.size.span()), Reason::ViewSize { view, size }));
    }
    let own = raw.register.iter().filter(|entry| entry.get_ref().name.is_some());
    for field in structure.fields.iter().filter(|field| !field.is_padding()) {
        let known = view.fields.iter().find(|known| known.name == field.view_name);
        let alike = known.is_some_and(|known| {
            (known.offset, known.kind, &known.dims) == (field.offset, field.kind, &field.dims)
        });
        if !alike {
            // A register of a block is told at the structure's name.
            let mut written = own.clone();
            let place = written.find(|entry| {
                entry.get_ref().name.as_ref().is_some_and(|name| *name.get_ref() == field.name)
            });
            let place = at(file, place.map_or(raw.name.span(), Spanned::span));
            let (name, view) = (field.name.clone(), view.name.clone());
            let offset = known.map(|known| known.offset);
            let reason = match offset {
                None => Reason::NotInView { name: field.view_name.clone(), view },
                Some(offset) => Reason::UnlikeView { name, view, offset },
            };
            return Err(sources.error(place, reason));
        }
    }
    Ok(index)
}
