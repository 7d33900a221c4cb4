//! Writes new offsets into the text of the layout files. Comments stay with their lines, and the lines keep their order
//! as far as the offsets permit.

use super::ImportError;
use super::homes::{Home, Homes, Table};
use super::list;
use super::matching::Placement;
use crate::declaration::TypeId;
use std::ops::Range;
use std::path::PathBuf;
use toml_edit::{DocumentMut, InlineTable, Item, TableLike, Value};

/// Returns the files that change, with their new content.
pub(crate) fn files(
    homes: &Homes,
    placements: &[Placement],
    mark: &impl Fn(TypeId) -> String,
) -> Result<Vec<(PathBuf, String)>, ImportError> {
    let mut changed = Vec::new();
    for (file, (path, text)) in homes.files.iter().enumerate() {
        let mut document: Option<DocumentMut> = None;
        for placement in placements.iter().filter(|placement| homes.all[placement.home].file == file) {
            let home = &homes.all[placement.home];
            let form = || ImportError::Form { path: path.clone(), name: home.name().to_owned() };
            let document = match &mut document {
                Some(document) => document,
                none => none.insert(text.parse().map_err(|_| form())?),
            };
            let mark = homes.is_marked(placement.home).then(|| mark(placement.declared));
            let mark = mark.as_deref();
            if home.view.is_some() {
                // A structure with a view has no offsets of its own, because the family's structure defines them. So
                // only its marks are written.
                marks(document, home, placement, mark).ok_or_else(form)?;
                continue;
            }
            let gaps = gaps(homes, placements, placement);
            structure(document, home, placement, &gaps, mark).ok_or_else(form)?;
        }
        let new = document.map(|document| document.to_string());
        changed.extend(new.filter(|new| new != text).map(|new| (path.clone(), new)));
    }
    Ok(changed)
}

/// Writes one structure, sub-structure or block. Returns nothing if it is not in the usual form.
fn structure(
    document: &mut DocumentMut,
    home: &Home,
    placement: &Placement,
    gaps: &[Range<u32>],
    mark: Option<&str>,
) -> Option<()> {
    marks(document, home, placement, mark)?;
    let table = table(document, home)?;
    put(table, "size", i64::from(placement.size).into());
    let registers = table.get_mut("register")?.as_array_mut()?;
    let offsets: Vec<_> =
        placement.places.iter().map(|place| place.as_ref().map(|place| place.start)).collect();
    list::place(registers, &offsets, gaps)
}

/// Returns the table of the file in which a structure, sub-structure or block is written.
fn table<'a>(document: &'a mut DocumentMut, home: &Home) -> Option<&'a mut dyn TableLike> {
    Some(match home.table {
        Table::Top => document.as_table_mut(),
        Table::Substructure(index) => element(document, "substructure", index)?,
        Table::Block(index) => element(document, "block", index)?,
    })
}

/// Writes the source of the offsets, and of the names that were inferred.
fn marks(document: &mut DocumentMut, home: &Home, placement: &Placement, mark: Option<&str>) -> Option<()> {
    let table = table(document, home)?;
    let Some(mark) = mark else { return Some(()) };
    put(table, "offsets", mark.into());
    let names =
        placement.is_named_alike && table.get("names").and_then(Item::as_value).is_some_and(is_inferred);
    if names {
        put(table, "names", mark.into());
    }
    let registers = table.get_mut("register")?.as_array_mut()?;
    for entry in registers.iter_mut().filter_map(Value::as_inline_table_mut) {
        remove(entry, "offset_from");
        if names && entry.get("name_from").is_some_and(is_inferred) {
            remove(entry, "name_from");
        }
    }
    Some(())
}

fn element<'a>(document: &'a mut DocumentMut, name: &str, index: usize) -> Option<&'a mut dyn TableLike> {
    let table = document.get_mut(name)?.as_array_of_tables_mut()?.get_mut(index)?;
    Some(table)
}

/// Changes an existing key. Comments and blanks around its value stay.
fn put(table: &mut dyn TableLike, key: &str, mut value: Value) {
    if let Some(old) = table.get_mut(key).and_then(Item::as_value_mut) {
        *value.decor_mut() = old.decor().clone();
        *old = value;
    }
}

/// True if the source is a decision. The library states the fact, so the decision is no longer needed. A fact from the
/// manual keeps its source.
fn is_inferred(source: &Value) -> bool {
    source.as_str().is_some_and(|source| source.starts_with("inferred "))
}

/// Removes a key. The blank between the last key and the brace stays.
fn remove(entry: &mut InlineTable, key: &str) {
    if entry.remove(key).is_some()
        && let Some((_, last)) = entry.iter_mut().last()
    {
        last.decor_mut().set_suffix(" ");
    }
}

/// Returns the bytes of a structure without registers. The gaps of a structure with blocks are reported in its own list.
fn gaps(homes: &Homes, placements: &[Placement], placement: &Placement) -> Vec<Range<u32>> {
    let lists = match homes.all[placement.home].table {
        Table::Block(_) => return Vec::new(),
        Table::Substructure(_) => vec![placement.home],
        Table::Top => homes.lists(placement.home),
    };
    let listed = placements.iter().filter(|placement| lists.contains(&placement.home));
    let mut places: Vec<_> =
        listed.flat_map(|placement| placement.places.iter().flatten().cloned()).collect();
    places.sort_unstable_by_key(|place| place.start);
    places.push(placement.size..placement.size);
    let mut gaps = Vec::new();
    let mut end = 0;
    for place in places {
        if place.start > end {
            gaps.push(end..place.start);
        }
        end = end.max(place.end);
    }
    gaps
}
