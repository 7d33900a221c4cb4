//! A structure that firmware and function blocks view as a structure of the family: common registers have the same
//! offsets, because only the family's structure defines the offsets.

use super::Parts;
use super::field::{self, LocatedField};
use crate::error::{Error, Reason};
use crate::model::Structure;
use crate::raw;
use crate::source::{SourcePlace, Sources, at};
use toml::Spanned;

/// Returns the family's structure called `wanted`.
pub(crate) fn find(
    sources: &Sources,
    parts: &Parts,
    file: usize,
    wanted: &Spanned<String>,
) -> Result<usize, Error> {
    let is_it = |known: &Structure| known.shared && known.name == *wanted.get_ref();
    parts.structures.iter().position(is_it).ok_or_else(|| {
        let shared = parts.structures.iter().filter(|known| known.shared);
        let known = shared.map(|known| known.name.as_str()).collect::<Vec<_>>().join(", ");
        let name = wanted.get_ref().clone();
        sources.error(at(file, wanted.span()), Reason::UnknownView { name, known })
    })
}

/// Puts a register at its offset in `view`. Type and bounds must be the same.
pub(crate) fn place(
    sources: &Sources,
    view: &Structure,
    (at, field): &mut LocatedField,
) -> Result<(), Error> {
    let Some(known) = view.fields.iter().find(|known| known.name == field.view_name) else {
        let (name, view) = (field.view_name.clone(), view.name.clone());
        return Err(sources.error(*at, Reason::NotInView { name, view }));
    };
    if (known.kind, &known.dims) != (field.kind, &field.dims) {
        let (name, view) = (field.name.clone(), view.name.clone());
        return Err(sources.error(*at, Reason::UnlikeView { name, view }));
    }
    field.offset = known.offset;
    Ok(())
}

/// Adds padding for registers that only the family's structure has, up to `size`. `fields` are in ascending order.
pub(crate) fn fill_gaps(
    raw: &raw::Structure,
    subs: &[Structure],
    size: u32,
    place: SourcePlace,
    fields: &mut Vec<LocatedField>,
) {
    let mut gaps = Vec::new();
    let mut end = 0;
    for (_, field) in fields.iter() {
        gaps.extend((field.offset > end).then_some(end..field.offset));
        end = end.max(field.offset + field.size(subs));
    }
    gaps.extend((size > end).then_some(end..size));
    fields.extend(gaps.into_iter().map(|gap| (place, field::gap(gap.start, gap.end - gap.start, raw))));
    fields.sort_by_key(|(_, field)| field.offset);
}
