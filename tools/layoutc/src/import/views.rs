//! Structures with a view. The library declares such a structure of the device, and this declaration places the
//! registers of the family's structure.

use super::homes::{Homes, Table, called_there};
use super::matching::Placement;
use crate::model::Scalar;
use crate::raw::Entry;
use std::collections::BTreeMap;
use std::ops::Range;

/// A register of the family's structure.
struct Register<'a> {
    name: &'a str,
    place: Range<u32>,
    alignment: u32,
    /// Offset of the register in the library, if the library declares the register.
    declared: Option<u32>,
}

/// Returns the placements of the family's structure that follow from `found`, the placements of structure `index`.
/// Returns none if no register moves.
pub(super) fn of_family(homes: &Homes, index: usize, found: &[Placement]) -> Vec<Placement> {
    let Some(base) = homes.all[index].view else { return Vec::new() };
    let lists = homes.lists(index);
    let mut declared: BTreeMap<&str, u32> = BTreeMap::new();
    for placement in found.iter().filter(|placement| lists.contains(&placement.home)) {
        let entries = homes.all[placement.home].raw.register.iter().zip(&placement.places);
        let placed = entries
            .filter_map(|(entry, place)| Some((called_there(entry.get_ref())?, place.as_ref()?.start)));
        declared.extend(placed);
    }
    let mut registers: Vec<_> = homes
        .lists(base)
        .into_iter()
        .flat_map(|list| &homes.all[list].raw.register)
        .filter_map(|entry| {
            let entry = entry.get_ref();
            let (name, first) = (entry.name.as_ref()?.get_ref().as_str(), *entry.offset.as_ref()?.get_ref());
            let place = first..first + bytes(homes, found, entry);
            let declared = declared.get(name).copied();
            Some(Register { name, place, alignment: alignment(homes, entry), declared })
        })
        .collect();
    registers.sort_by_key(|register| register.place.start);
    if registers.iter().all(|register| register.declared.is_none_or(|start| start == register.place.start)) {
        return Vec::new();
    }
    let places = places(&registers);
    let place = |entry: &Entry| places.get(entry.name.as_ref()?.get_ref().as_str()).cloned();
    let user = format!("`{}`", homes.all[index].name());
    let Some(of) = found.iter().find(|placement| placement.home == index) else { return Vec::new() };
    let placements = homes.lists(base).into_iter().map(|home| {
        let entries = homes.all[home].raw.register.iter();
        let places: Vec<_> = entries.map(|entry| place(entry.get_ref())).collect();
        Placement { home, user: user.clone(), places, size: 0, is_named_alike: false, declared: of.declared }
    });
    let mut placements: Vec<_> = placements.collect();
    let end = |placement: &Placement| placement.places.iter().flatten().map(|place| place.end).max();
    let all = placements.iter().filter_map(end).max().unwrap_or_default();
    for placement in &mut placements {
        let is_block = matches!(homes.all[placement.home].table, Table::Block(_));
        placement.size = if is_block { end(placement).unwrap_or_default() } else { all.next_multiple_of(4) };
    }
    placements
}

/// Returns the places of the registers, which are in ascending order. Registers that only the family has keep their distance to the
/// preceding register. If the library leaves no room for them there, they follow the end of the structure (decision D-741).
fn places<'a>(registers: &[Register<'a>]) -> BTreeMap<&'a str, Range<u32>> {
    let moved = |register: &Register<'_>, by: i64| -> Option<Range<u32>> {
        let at = |offset: u32| u32::try_from(i64::from(offset) + by).ok();
        Some(at(register.place.start)?..at(register.place.end)?)
    };
    let declared =
        |register: &Register<'_>| Some(i64::from(register.declared?) - i64::from(register.place.start));
    let mut places: BTreeMap<&str, Range<u32>> =
        registers.iter().filter_map(|it| Some((it.name, moved(it, declared(it)?)?))).collect();
    let mut without_room = Vec::new();
    let mut by = 0;
    for run in registers.chunk_by(|one, next| one.declared.is_some() == next.declared.is_some()) {
        if let Some(last) = run.last().and_then(declared) {
            by = last;
            continue;
        }
        let free = |place: &Range<u32>| {
            places.values().all(|other| other.end <= place.start || place.end <= other.start)
        };
        let wanted = run.iter().map(|register| {
            let place = moved(register, by).filter(free)?;
            place.start.is_multiple_of(register.alignment).then_some(place)
        });
        match wanted.collect::<Option<Vec<_>>>() {
            Some(wanted) => places.extend(run.iter().map(|register| register.name).zip(wanted)),
            None => without_room.push(run),
        }
    }
    for run in without_room {
        let end = i64::from(places.values().map(|place| place.end).max().unwrap_or_default());
        let first = run.first().map_or(0, |register| i64::from(register.place.start));
        // A multiple of 4 keeps every register aligned.
        let by = end - first + (first - end).rem_euclid(4);
        places.extend(run.iter().filter_map(|register| Some((register.name, moved(register, by)?))));
    }
    places
}

/// Returns the alignment of a register's address in bytes.
fn alignment(homes: &Homes, entry: &Entry) -> u32 {
    let Some(ty) = entry.ty.as_ref().map(|ty| ty.get_ref().as_str()) else { return 1 };
    let of_sub = |sub: usize| {
        let entries = homes.all[sub].raw.register.iter();
        entries.map(|entry| alignment(homes, entry.get_ref())).max()
    };
    let of_scalar = Scalar::named(ty).map(Scalar::width);
    of_scalar.or_else(|| homes.substructure(ty).and_then(of_sub)).unwrap_or(1)
}

/// Returns the number of bytes of a register with all its elements. Sub-structures have the size in `found`.
fn bytes(homes: &Homes, found: &[Placement], entry: &Entry) -> u32 {
    let Some(ty) = entry.ty.as_ref().map(|ty| ty.get_ref().as_str()) else { return 0 };
    let of_sub = |sub: usize| {
        let declared = found.iter().find(|placement| placement.home == sub).map(|placement| placement.size);
        declared.unwrap_or_else(|| homes.all[sub].size())
    };
    let one = Scalar::named(ty).map(Scalar::width).or_else(|| homes.substructure(ty).map(of_sub));
    entry
        .array
        .iter()
        .flat_map(|array| array.get_ref())
        .fold(one.unwrap_or_default(), |bytes, count| bytes * count)
}
