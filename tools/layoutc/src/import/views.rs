//! A structure that looks at one of the family's: what the library declares for it places the registers of the family's.

use super::homes::{Homes, Table, called_there};
use super::matching::Placement;
use crate::model::Scalar;
use crate::raw::Entry;
use std::collections::BTreeMap;
use std::ops::Range;

/// The placements of the family's structure that follow from `found`, those of structure `index`; none if nothing moves. A
/// register that only the family's structure has keeps its distance to the register before it.
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
    if homes.registers(base).all(|(_, name, offset)| declared.get(name).is_none_or(|start| *start == offset))
    {
        return Vec::new();
    }
    let mut shift = 0;
    let mut starts: BTreeMap<&str, u32> = BTreeMap::new();
    for (_, name, offset) in homes.registers(base) {
        if let Some(start) = declared.get(name) {
            shift = i64::from(*start) - i64::from(offset);
        }
        starts.insert(name, u32::try_from(i64::from(offset) + shift).unwrap_or_default());
    }
    let place = |entry: &Entry| -> Option<Range<u32>> {
        let start = *starts.get(entry.name.as_ref()?.get_ref().as_str())?;
        Some(start..start + bytes(homes, entry))
    };
    let user = format!("`{}`", homes.all[index].name());
    let placements = homes.lists(base).into_iter().map(|home| {
        let entries = homes.all[home].raw.register.iter();
        let places: Vec<_> = entries.map(|entry| place(entry.get_ref())).collect();
        Placement { home, user: user.clone(), places, size: 0, is_named_alike: false }
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

/// Bytes of a register with all its elements.
fn bytes(homes: &Homes, entry: &Entry) -> u32 {
    let Some(ty) = entry.ty.as_ref().map(|ty| ty.get_ref().as_str()) else { return 0 };
    let one = Scalar::named(ty).map(Scalar::width);
    let one = one.or_else(|| homes.substructure(ty).map(|sub| homes.all[sub].size())).unwrap_or_default();
    entry.array.iter().flat_map(|array| array.get_ref()).fold(one, |bytes, count| bytes * count)
}
