//! Areas of the image: checks the places of structures, and that overlaid structures agree on widths.

use super::phase::{self, Declared};
use super::{Names, identifier};
use crate::error::{Error, Reason};
use crate::model::{Area, AreaStructure, Field, FieldType, Provenance, Space, Structure};
use crate::raw;
use crate::source::{Sources, at};
use std::collections::BTreeSet;
use toml::Spanned;

/// Maximum number of bytes of all structures in all areas: 100 times that of the largest existing layout. The limit
/// exists because a structure of a few lines may have any size.
const MOST_PLACED: u32 = 16 << 20;

/// Types that areas can use.
pub(super) struct Types<'a> {
    pub structures: &'a [Structure],
    pub subs: &'a [Structure],
    pub phases: Option<&'a Declared>,
}

/// Checks all areas of the device, in the order of the file.
pub(super) fn check(
    sources: &Sources,
    file: usize,
    (raw, from): (&[raw::Area], &Provenance),
    spaces: &[Space],
    types: &Types<'_>,
) -> Result<Vec<Area>, Error> {
    let mut names = Names::default();
    let mut areas: Vec<Area> = Vec::new();
    let mut numbers: Vec<(u32, u32)> = Vec::new();
    let mut left = MOST_PLACED;
    for raw in raw {
        names.add(sources, file, &raw.name)?;
        let (area, (first, last)) = area(sources, file, raw, from, spaces, types, &mut left)?;
        for (other, (other_first, other_last)) in areas.iter().zip(&numbers) {
            if area.space == other.space && first <= *other_last && *other_first <= last {
                let (name, other, other_last) = (area.name.clone(), other.name.clone(), *other_last);
                let reason = Reason::AreaOverlap { name, first, last, other, other_last };
                return Err(sources.error(at(file, raw.first.span()), reason));
            }
        }
        areas.push(area);
        numbers.push((first, last));
    }
    Ok(areas)
}

/// Checks that the names of all variables are identifiers and differ in more than upper and lower case (D-787).
pub(super) fn check_variables(
    sources: &Sources,
    file: usize,
    raw: &[raw::Area],
    areas: &[Area],
) -> Result<(), Error> {
    let mut known = BTreeSet::new();
    let each = raw.iter().zip(areas).flat_map(|(raw, area)| raw.structure.iter().zip(&area.structures));
    for (raw, placed) in each {
        let place = at(file, raw.variable.as_ref().unwrap_or(&raw.name).span());
        identifier(sources, place, &placed.variable)?;
        if !known.insert(placed.variable.to_ascii_lowercase()) {
            return Err(sources.error(place, Reason::VariableTwice(placed.variable.clone())));
        }
    }
    Ok(())
}

/// Removes the area with a size set by each plant from the list of areas, and returns it.
pub(super) fn retain(
    sources: &Sources,
    file: usize,
    raw: &[raw::Area],
    areas: &mut Vec<Area>,
) -> Result<Option<(Area, u32)>, Error> {
    let mut found: Option<(usize, u32)> = None;
    for (index, (raw, area)) in raw.iter().zip(areas.iter()).enumerate() {
        let Some(bytes) = &raw.retain else { continue };
        let wrong = |reason| Err(sources.error(at(file, bytes.span()), reason));
        if let Some((other, _)) = found {
            return wrong(Reason::RetainTwice(areas[other].name.clone()));
        }
        let (default, most) = (*bytes.get_ref(), area.bytes);
        if !area.structures.is_empty() || !(4..=most).contains(&default) || !default.is_multiple_of(4) {
            return wrong(Reason::BadRetain { name: area.name.clone(), most });
        }
        found = Some((index, default));
    }
    Ok(found.map(|(index, default)| (areas.remove(index), default)))
}

/// Returns the area, and its first and last number.
fn area(
    sources: &Sources,
    file: usize,
    raw: &raw::Area,
    names: &Provenance,
    spaces: &[Space],
    types: &Types<'_>,
    left: &mut u32,
) -> Result<(Area, (u32, u32)), Error> {
    let Types { structures, subs, phases } = types;
    let name = raw.name.get_ref().clone();
    let space = match &raw.space {
        None => 0,
        Some(wanted) => {
            let known = spaces.iter().position(|space| space.name == *wanted.get_ref());
            let unknown = || Reason::UnknownSpace(wanted.get_ref().clone());
            known.ok_or_else(|| sources.error(at(file, wanted.span()), unknown()))?
        }
    };
    let Some(within) = spaces.get(space) else {
        return Err(sources.error(at(file, raw.name.span()), Reason::MissingKey("space")));
    };
    let unit = within.unit_bytes();
    let first = *raw.first.get_ref();
    let size_of = |name: &String| structures.iter().find(|known| known.name == *name).map(|known| known.size);
    let largest = raw.structure.iter().filter_map(|placed| size_of(placed.name.get_ref())).max();
    let last_at = raw.last.as_ref().map_or(raw.first.span(), Spanned::span);
    let last = match (&raw.last, largest) {
        (Some(last), _) => *last.get_ref(),
        (None, Some(largest)) => first.saturating_add(largest.div_ceil(unit) - 1),
        (None, None) => return Err(sources.error(at(file, raw.first.span()), Reason::MissingKey("last"))),
    };
    let by = 4 / unit;
    if !first.is_multiple_of(by) {
        return Err(sources.error(at(file, raw.first.span()), Reason::AreaMisaligned { name, first, by }));
    }
    if last < first {
        return Err(sources.error(at(file, last_at), Reason::AreaReversed { name, first, last }));
    }
    let bytes = (last - first).saturating_add(1).saturating_mul(unit);
    let begin = within.place(first);
    let end = begin.and_then(|begin| begin.checked_add(bytes));
    // A space without the key `bytes` ends with its last area, so it has no end yet.
    let Some(begin) = begin.filter(|_| end.is_some_and(|end| raw_end(within) >= u64::from(end))) else {
        let (space, space_first) = (within.name.clone(), within.first);
        let space_last =
            u64::from(space_first) + (raw_end(within) - u64::from(within.offset)) / u64::from(unit) - 1;
        let reason = Reason::AreaOutside { name, first, last, space, space_first, space_last };
        return Err(sources.error(at(file, raw.first.span()), reason));
    };
    let cpu = match (raw.cpu_first, raw.cpu_last) {
        (Some(first), Some(last)) => Some((first, last)),
        (None, None) => None,
        _ => return Err(sources.error(at(file, raw.name.span()), Reason::HalfCpu)),
    };
    let mut placed: Vec<AreaStructure> = Vec::new();
    let mut cells = OverlaidCells::default();
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
        let Some(rest) = left.checked_sub(structure.size) else {
            let (structure, area) = (structure.name.clone(), name);
            return Err(sources.error(place, Reason::PlacedTooMuch { structure, area, most: MOST_PLACED }));
        };
        *left = rest;
        let live = phase::number(sources, file, &entry.live, *phases)?;
        if let Some(declared) = phases.filter(|_| live != 0) {
            let of = (*structures, declared);
            phase::check_register(sources, (file, &entry.live), structure, &placed, of)?;
        }
        let ending = phases.and_then(|declared| declared.phases.values.get(live.checked_sub(1)?));
        let ending = ending.map_or("", |phase| &phase.variable);
        let (variable, variable_from) = variable((&name, ending), names, entry);
        let new = AreaStructure {
            structure: index,
            live,
            role: entry.role,
            variable,
            variable_from,
            unused: unused(sources, file, structure, &entry.unused)?,
        };
        if raw.structure.len() > 1 {
            let mixed = cells.add(new.role, placed.len(), &placed_cells(&new, structure, subs));
            if let Some(Mixed { other, offset, width, other_width }) = mixed {
                let other = structures[placed[other].structure].name.clone();
                let (structure, area) = (structure.name.clone(), name);
                let reason = Reason::MixedWidth { structure, other, area, offset, width, other_width };
                return Err(sources.error(place, reason));
            }
        }
        placed.push(new);
    }
    let area = Area {
        name,
        name_from: names.clone(),
        space,
        first: begin,
        bytes,
        cpu,
        page: raw.page.clone(),
        doc: raw.doc.clone(),
        structures: placed,
    };
    Ok((area, (first, last)))
}

/// Returns the highest possible end of the space.
fn raw_end(space: &Space) -> u64 {
    if space.bytes == 0 { u64::from(u32::MAX) } else { space.end() }
}

/// Returns the manual's name of the application's variable. If there is none, returns a name made from area and phase,
/// with the source of the area's name.
fn variable(
    (area, ending): (&str, &str),
    names: &Provenance,
    placed: &raw::AreaStructure,
) -> (String, Provenance) {
    match &placed.variable {
        None => (format!("_{area}{ending}"), names.clone()),
        Some(given) => (given.get_ref().clone(), Provenance::Manual),
    }
}

/// Returns the names of the registers that are unused in this area. The structure must have these registers.
fn unused(
    sources: &Sources,
    file: usize,
    structure: &Structure,
    names: &[Spanned<String>],
) -> Result<Vec<String>, Error> {
    let registers = structure.fields.iter().filter(|field| !field.is_padding());
    let registers: BTreeSet<_> = registers.map(|field| &field.name).collect();
    if let Some(wrong) = names.iter().find(|name| !registers.contains(name.get_ref())) {
        let (structure, name) = (structure.name.clone(), wrong.get_ref().clone());
        return Err(sources.error(at(file, wrong.span()), Reason::UnknownRegister { structure, name }));
    }
    Ok(names.iter().map(|name| name.get_ref().clone()).collect())
}

/// For each byte, the width of its cell, and the number of the first structure that has this cell.
type FirstCells = Vec<Option<(u32, usize)>>;

/// The cells of structures that overlay each other, byte by byte.
///
/// Atomic accesses of different sizes to one byte are not defined, so overlaid registers that are used must have the
/// same width and the same start. Padding is never accessed but copied, byte by byte.
#[derive(Default)]
struct OverlaidCells {
    /// The cells for each role, and for the structures without a role.
    of_roles: Vec<(Option<raw::Role>, FirstCells)>,
}

/// Two structures that have cells of different widths at one byte.
struct Mixed {
    /// Number of the earlier structure.
    other: usize,
    offset: u32,
    width: u32,
    other_width: u32,
}

impl OverlaidCells {
    /// Adds the cells of structure `number`. Returns the first difference to another structure, if there is one.
    fn add(&mut self, role: Option<raw::Role>, number: usize, cells: &[Option<u32>]) -> Option<Mixed> {
        // The role of a port does not change during a run. So structures of different roles are never in use at the
        // same time.
        let meets = |other: &Option<raw::Role>| role.is_none() || other.is_none() || role == *other;
        let pairs = self
            .of_roles
            .iter()
            .filter(|(other, _)| meets(other))
            .flat_map(|(_, known)| known.iter().zip(cells).enumerate());
        let mixed = pairs.filter_map(|(offset, (known, cell))| {
            let ((other_width, other), width) = ((*known)?, (*cell)?);
            (width != other_width).then_some(Mixed { other, offset: offset as u32, width, other_width })
        });
        if let Some(mixed) = mixed.min_by_key(|mixed| (mixed.other, mixed.offset)) {
            return Some(mixed);
        }
        let known = self.of_roles.iter().position(|(known, _)| *known == role);
        let index = known.unwrap_or_else(|| {
            self.of_roles.push((role, Vec::new()));
            self.of_roles.len() - 1
        });
        let known = &mut self.of_roles[index].1;
        known.resize(known.len().max(cells.len()), None);
        for (known, cell) in known.iter_mut().zip(cells) {
            *known = known.or_else(|| cell.map(|width| (width, number)));
        }
        None
    }
}

/// Returns for each byte the width of the cell that contains it, and `None` in unused registers. Cells are aligned to
/// their width, so equal widths mean equal starts.
fn placed_cells(placed: &AreaStructure, structure: &Structure, subs: &[Structure]) -> Vec<Option<u32>> {
    let fields = structure.fields.iter();
    let unused: BTreeSet<_> = placed.unused.iter().collect();
    let cells = |field: &Field| {
        let used = !unused.contains(&field.name);
        field_cells(field, subs).into_iter().map(move |width| width.filter(|_| used))
    };
    fields.flat_map(cells).collect()
}

/// Returns the width of the register at each byte of the field; `None` for padding, which is no register.
fn field_cells(field: &Field, subs: &[Structure]) -> Vec<Option<u32>> {
    let element = match field.kind {
        FieldType::Scalar(scalar) => vec![Some(scalar.width()); scalar.width() as usize],
        FieldType::Sub(index) => {
            subs[index].fields.iter().flat_map(|field| field_cells(field, subs)).collect()
        }
        FieldType::Padding(bytes) => vec![None; bytes as usize],
    };
    element.repeat(field.dims.iter().product::<u32>() as usize)
}
