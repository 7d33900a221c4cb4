//! Meanings: values and bits must not be described twice, and must fit the registers that use them.

use super::{Parts, id};
use crate::error::{Error, Reason};
use crate::model::{Bit, Meaning, Provenance, Scalar, Value};
use crate::raw;
use crate::source::{SourcePlace, Sources, at};
use toml::Spanned;

/// A meaning, and the places of its parts in the file.
pub(crate) struct CheckedMeaning {
    pub meaning: Meaning,
    values: Vec<SourcePlace>,
    bits: Vec<SourcePlace>,
}

/// Checks `raw` and appends it. `manual` is the file's manual; `shared` is true for a file of the family.
pub(crate) fn add(
    sources: &Sources,
    file: usize,
    raw: &raw::Meaning,
    (manual, shared): (&str, bool),
    all: &mut Vec<CheckedMeaning>,
) -> Result<(), Error> {
    let name = raw.name.get_ref();
    // A meaning with a page comes from the manual. A meaning without a page must name its source.
    let source = match (&raw.source, &raw.page) {
        (Some(source), _) => source.clone(),
        (None, Some(_)) => Provenance::Manual,
        (None, None) => {
            return Err(sources.error(at(file, raw.name.span()), Reason::MeaningWithoutSource(name.clone())));
        }
    };
    let values = values(sources, file, &raw.value, &source)?;
    let mut bits: Vec<Bit> = Vec::new();
    for raw in &raw.bit {
        let place = at(file, raw.span());
        let bit = bit(sources, file, raw, &source)?;
        if let Some(twice) = bits.iter().find(|b| b.first <= bit.last && bit.first <= b.last) {
            return Err(sources.error(place, Reason::BitTwice(bit.first.max(twice.first))));
        }
        bits.push(bit);
    }
    let own = raw.page.iter().map(|page| (manual.to_owned(), page.clone()));
    let others = raw.pages.iter().map(|(manual, page)| (manual.clone(), page.clone()));
    let scalar = id::check(sources, file, raw)?;
    let pages = own.chain(others).collect();
    let handshake = handshake(sources, file, raw, &values)?;
    let meaning = Meaning { name: name.clone(), pages, shared, scalar, handshake, values, bits };
    if raw.page.is_none() && meaning.is_documented() {
        return Err(sources.error(at(file, raw.name.span()), Reason::MeaningWithoutPage(name.clone())));
    }
    let checked = CheckedMeaning {
        meaning,
        values: raw.value.iter().map(|v| at(file, v.span())).collect(),
        bits: raw.bit.iter().map(|b| at(file, b.span())).collect(),
    };
    if let Some(scalar) = scalar {
        checked.fits(sources, name, scalar)?;
    }
    all.push(checked);
    Ok(())
}

/// Returns the values of request and answer. Request and answer must be single values of the meaning.
fn handshake(
    sources: &Sources,
    file: usize,
    raw: &raw::Meaning,
    values: &[Value],
) -> Result<Option<(u32, u32)>, Error> {
    let Some(given) = &raw.handshake else { return Ok(None) };
    let raw::Handshake { request, answer } = *given.get_ref();
    let is_known = |wanted: u32| values.iter().any(|value| value.first == wanted && value.last == wanted);
    match [request, answer].into_iter().find(|value| !is_known(*value)) {
        Some(unknown) => {
            let reason = Reason::HandshakeValue(format!("0x{unknown:02X}"));
            Err(sources.error(at(file, given.span()), reason))
        }
        None => Ok(Some((request, answer))),
    }
}

impl CheckedMeaning {
    /// True if every value and bit fits `name` of type `scalar`.
    fn fits(&self, sources: &Sources, name: &str, scalar: Scalar) -> Result<(), Error> {
        let width = scalar.width() * 8;
        for (value, place) in self.meaning.values.iter().zip(&self.values) {
            if u64::from(value.last) >= 1u64 << width {
                return Err(sources.error(*place, too_wide("value", i64::from(value.last), name, scalar)));
            }
        }
        for (bit, place) in self.meaning.bits.iter().zip(&self.bits) {
            if u32::from(bit.last) >= width {
                let (meaning, name) = (self.meaning.name.clone(), name.to_owned());
                let reason =
                    Reason::BitTooWide { bit: bit.last, meaning, name, ty: scalar.name(), bits: width };
                return Err(sources.error(*place, reason));
            }
        }
        Ok(())
    }
}

/// Returns the meaning called `name` if all its values and bits fit register `register` of type `scalar`.
pub(crate) fn find(
    sources: &Sources,
    parts: &Parts,
    name: (&str, SourcePlace),
    register: &str,
    scalar: Scalar,
) -> Result<usize, Error> {
    let all = &parts.meanings;
    let Some(index) = all.iter().position(|checked| checked.meaning.name == name.0) else {
        return Err(sources.error(name.1, Reason::UnknownMeaning(name.0.to_owned())));
    };
    let checked = &all[index];
    let meaning = &checked.meaning;
    if meaning.is_documented() && !meaning.pages.iter().any(|(manual, _)| *manual == parts.manual) {
        let (meaning, manual) = (meaning.name.clone(), parts.manual.clone());
        return Err(sources.error(name.1, Reason::MeaningWithoutPagesOf { meaning, manual }));
    }
    if let Some(expected) = meaning.scalar.filter(|expected| expected.width() != scalar.width()) {
        let (register, meaning, expected) = (register.to_owned(), meaning.name.clone(), expected.name());
        let reason = Reason::UnlikeMeaning { name: register, ty: scalar.name(), meaning, expected };
        return Err(sources.error(name.1, reason));
    }
    checked.fits(sources, register, scalar)?;
    Ok(index)
}

pub(crate) fn too_wide(what: &'static str, value: i64, name: &str, scalar: Scalar) -> Reason {
    let value = if value < 0 { value.to_string() } else { format!("16#{value:X}") };
    Reason::ValueTooWide { what, value, name: name.to_owned(), ty: scalar.name(), bits: scalar.width() * 8 }
}

/// `source` is the source of values that name none.
fn values(
    sources: &Sources,
    file: usize,
    raw: &[Spanned<raw::Value>],
    source: &Provenance,
) -> Result<Vec<Value>, Error> {
    let mut values: Vec<Value> = Vec::new();
    for raw in raw {
        let place = at(file, raw.span());
        let raw = raw.get_ref();
        let (first, last) = match (raw.is, raw.from, raw.to) {
            (Some(is), None, None) => (is, is),
            (None, Some(from), Some(to)) if from < to => (from, to),
            _ => return Err(sources.error(place, Reason::BadRange("value", "is"))),
        };
        if values.iter().any(|v| v.first <= last && first <= v.last) {
            return Err(sources.error(place, Reason::ValueTwice(format!("16#{first:X}"))));
        }
        let source = raw.source.as_ref().unwrap_or(source).clone();
        let id = raw.id.as_ref().map(|id| id.get_ref().clone());
        let text = match (&raw.text, raw.reserved) {
            (Some(text), false) => text.clone(),
            (None, true) => "reserved".to_owned(),
            _ => return Err(sources.error(place, Reason::TextOrReserved)),
        };
        values.push(Value { id, first, last, text, reserved: raw.reserved, source });
    }
    Ok(values)
}

fn bit(sources: &Sources, file: usize, raw: &Spanned<raw::Bit>, source: &Provenance) -> Result<Bit, Error> {
    let place = at(file, raw.span());
    let raw = raw.get_ref();
    let (first, last) = match (raw.at, raw.from, raw.to) {
        (Some(bit), None, None) => (bit, bit),
        (None, Some(from), Some(to)) if from < to => (from, to),
        _ => return Err(sources.error(place, Reason::BadRange("bit", "at"))),
    };
    let source = raw.source.as_ref().unwrap_or(source);
    let of_field = values(sources, file, &raw.value, source)?;
    for (value, raw) in of_field.iter().zip(&raw.value) {
        if u64::from(value.last) >> (last - first + 1) != 0 {
            let reason = Reason::ValueBesideBits { value: format!("16#{:X}", value.last), first, last };
            return Err(sources.error(at(file, raw.span()), reason));
        }
        if value.id.is_some() && value.first < value.last {
            return Err(sources.error(at(file, raw.span()), Reason::IdOfRange));
        }
    }
    Ok(Bit {
        id: raw.id.as_ref().map(|id| id.get_ref().clone()),
        first,
        last,
        name: raw.name.clone(),
        zero: raw.zero.clone(),
        one: raw.one.clone(),
        text: raw.text.clone(),
        values: of_field,
        joined: raw.joined,
        reserved: raw.reserved,
        source: source.clone(),
    })
}
