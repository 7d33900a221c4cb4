//! Ids of values and bits. They become names of constants, must be unique in a meaning, and need a type of the meaning.

use crate::error::{Error, Reason};
use crate::model::Scalar;
use crate::parameters::is_id;
use crate::raw;
use crate::source::{Sources, at};
use std::collections::BTreeSet;
use toml::Spanned;

/// Returns the type of the constants of `meaning`; `None` if there are none.
pub(super) fn check(sources: &Sources, file: usize, meaning: &raw::Meaning) -> Result<Option<Scalar>, Error> {
    let scalar = match &meaning.ty {
        None => None,
        Some(ty) => Some(Scalar::named(ty.get_ref()).ok_or_else(|| {
            let reason = Reason::UnknownType(ty.get_ref().clone(), String::new());
            sources.error(at(file, ty.span()), reason)
        })?),
    };
    let mut known = BTreeSet::new();
    for id in ids(meaning) {
        let name = id.get_ref();
        let reason = if !is_id(name) {
            Reason::BadId(name.clone())
        } else if !known.insert(name) {
            Reason::DuplicateName(name.clone())
        } else if scalar.is_none() {
            Reason::IdWithoutType(meaning.name.get_ref().clone())
        } else {
            continue;
        };
        return Err(sources.error(at(file, id.span()), reason));
    }
    Ok(scalar.filter(|_| !known.is_empty()))
}

/// Returns the ids of values, of bits, and of the values of bit fields.
fn ids(meaning: &raw::Meaning) -> impl Iterator<Item = &Spanned<String>> {
    let of_bits = meaning.bit.iter().map(Spanned::get_ref).flat_map(|bit| {
        let of_values = bit.value.iter().filter_map(|value| value.get_ref().id.as_ref());
        bit.id.iter().chain(of_values)
    });
    meaning.value.iter().filter_map(|value| value.get_ref().id.as_ref()).chain(of_bits)
}
