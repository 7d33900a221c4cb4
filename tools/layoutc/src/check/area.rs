//! Areas of the segment: where the structures lie, and that overlaid structures agree on widths.

use super::{Names, identifier};
use crate::error::{Error, Reason};
use crate::model::{Area, Field, Kind, Placed, Provenance, Structure};
use crate::raw;
use crate::source::{At, Sources, at};
use toml::Spanned;

/// Checks all areas of the device.
pub(crate) fn check(
    sources: &Sources,
    file: usize,
    (raw, from): (&[raw::Area], &Provenance),
    structures: &[Structure],
    subs: &[Structure],
) -> Result<Vec<Area>, Error> {
    let mut names = Names::default();
    let mut areas: Vec<Area> = Vec::new();
    for raw in raw {
        names.add(sources, file, &raw.name)?;
        let area = area(sources, file, raw, from, structures, subs)?;
        let last = area.first + (area.bytes - 1);
        for other in &areas {
            let other_last = other.first + (other.bytes - 1);
            if area.first <= other_last && other.first <= last {
                let (name, first, other) = (area.name.clone(), area.first, other.name.clone());
                let reason = Reason::AreaOverlap { name, first, last, other, other_last };
                return Err(sources.error(at(file, raw.first.span()), reason));
            }
        }
        areas.push(area);
    }
    Ok(areas)
}

fn area(
    sources: &Sources,
    file: usize,
    raw: &raw::Area,
    names: &Provenance,
    structures: &[Structure],
    subs: &[Structure],
) -> Result<Area, Error> {
    let name = raw.name.get_ref().clone();
    let first = *raw.first.get_ref();
    let size_of = |name: &String| structures.iter().find(|known| known.name == *name).map(|known| known.size);
    let largest = raw.structure.iter().filter_map(|placed| size_of(placed.name.get_ref())).max();
    let last_at = raw.last.as_ref().map_or(raw.first.span(), Spanned::span);
    let last = match (&raw.last, largest) {
        (Some(last), _) => *last.get_ref(),
        (None, Some(largest)) => first.saturating_add(largest - 1),
        (None, None) => return Err(sources.error(at(file, raw.first.span()), Reason::MissingKey("last"))),
    };
    if !first.is_multiple_of(4) {
        return Err(sources.error(at(file, raw.first.span()), Reason::AreaMisaligned { name, first }));
    }
    if last < first {
        return Err(sources.error(at(file, last_at), Reason::AreaReversed { name, first, last }));
    }
    let cpu = match (raw.cpu_first, raw.cpu_last) {
        (Some(first), Some(last)) => Some((first, last)),
        (None, None) => None,
        _ => return Err(sources.error(at(file, raw.name.span()), Reason::HalfCpu)),
    };
    let bytes = (last - first).saturating_add(1);
    let mut placed: Vec<Placed> = Vec::new();
    for entry in &raw.structure {
        let place = at(file, entry.name.span());
        let wanted = entry.name.get_ref();
        let Some(index) = structures.iter().position(|structure| structure.name == *wanted) else {
            return Err(sources.error(place, Reason::UnknownStructure(wanted.clone())));
        };
        let structure = &structures[index];
        if !structure.size.is_multiple_of(4) {
            let (structure, size) = (structure.name.clone(), structure.size);
            return Err(sources.error(place, Reason::OddSize { structure, size, align: 4 }));
        }
        if structure.size > bytes {
            let (structure, size) = (structure.name.clone(), structure.size);
            return Err(sources.error(place, Reason::PastAreaEnd { structure, size, area: name, bytes }));
        }
        let (variable, variable_from) = variable(sources, file, &name, names, entry)?;
        let new = Placed {
            structure: index,
            live: entry.live,
            role: entry.role,
            variable,
            variable_from,
            unused: unused(sources, file, structure, &entry.unused)?,
        };
        // What is in the slot of a port stays there: structures of different roles never meet.
        let meets = |other: &&Placed| new.role.is_none() || other.role.is_none() || new.role == other.role;
        for other in placed.iter().filter(meets) {
            same_widths(sources, place, &name, [&new, other], structures, subs)?;
        }
        placed.push(new);
    }
    Ok(Area {
        name,
        name_from: names.clone(),
        first,
        bytes,
        cpu,
        page: raw.page.clone(),
        doc: raw.doc.clone(),
        structures: placed,
    })
}

/// The manual's name of the application's variable, or one made from area and phase, which is no more documented
/// than the area's.
fn variable(
    sources: &Sources,
    file: usize,
    area: &str,
    names: &Provenance,
    placed: &raw::Placed,
) -> Result<(String, Provenance), Error> {
    let Some(given) = &placed.variable else {
        let made = match placed.live {
            raw::Live::Always => format!("_{area}"),
            raw::Live::Init => format!("_{area}_INIT"),
            raw::Live::Cyclic => format!("_{area}_CTRL"),
        };
        return Ok((made, names.clone()));
    };
    identifier(sources, at(file, given.span()), given.get_ref())?;
    Ok((given.get_ref().clone(), Provenance::Manual))
}

/// The names of the registers that nobody uses in this area; the structure must have them.
fn unused(
    sources: &Sources,
    file: usize,
    structure: &Structure,
    names: &[Spanned<String>],
) -> Result<Vec<String>, Error> {
    let known = |name: &str| structure.fields.iter().any(|field| field.name == name && !field.is_padding());
    if let Some(wrong) = names.iter().find(|name| !known(name.get_ref())) {
        let (structure, name) = (structure.name.clone(), wrong.get_ref().clone());
        return Err(sources.error(at(file, wrong.span()), Reason::UnknownRegister { structure, name }));
    }
    Ok(names.iter().map(|name| name.get_ref().clone()).collect())
}

/// Atomic accesses of different sizes to one byte are not defined, so overlaid registers that are used must
/// have the same width and the same start. Padding is never accessed but copied, byte by byte.
fn same_widths(
    sources: &Sources,
    place: At,
    area: &str,
    pair: [&Placed; 2],
    structures: &[Structure],
    subs: &[Structure],
) -> Result<(), Error> {
    let [mine, others] = pair.map(|placed| placed_cells(placed, &structures[placed.structure], subs));
    for (offset, widths) in mine.into_iter().zip(others).enumerate() {
        let (Some(width), Some(other_width)) = widths else { continue };
        if width != other_width {
            let [structure, other] = pair.map(|placed| structures[placed.structure].name.clone());
            let reason = Reason::MixedWidth {
                structure,
                other,
                area: area.to_owned(),
                offset: offset as u32,
                width,
                other_width,
            };
            return Err(sources.error(place, reason));
        }
    }
    Ok(())
}

/// For each byte the width of the cell it lies in, `None` in registers that nobody uses. Cells are aligned to
/// their width, so equal widths mean equal starts.
fn placed_cells(placed: &Placed, structure: &Structure, subs: &[Structure]) -> Vec<Option<u32>> {
    let fields = structure.fields.iter();
    let cells = |field: &Field| {
        let used = !placed.unused.contains(&field.name);
        field_cells(field, subs).into_iter().map(move |width| used.then_some(width))
    };
    fields.flat_map(cells).collect()
}

fn field_cells(field: &Field, subs: &[Structure]) -> Vec<u32> {
    let element = match field.kind {
        Kind::Scalar(scalar) => vec![scalar.width(); scalar.width() as usize],
        Kind::Sub(index) => subs[index].fields.iter().flat_map(|field| field_cells(field, subs)).collect(),
        Kind::Padding(bytes) => vec![1; bytes as usize],
    };
    element.repeat(field.dims.iter().product::<u32>() as usize)
}
