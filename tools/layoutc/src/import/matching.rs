//! Compares one structure of the layout with its declaration, register by register.

use super::homes::Homes;
use super::rows::{Row, Verdict};
use super::{ImportError, NamePairs};
use crate::declaration::{Element, Shape, Sizes, TypeId};
use crate::model::Scalar;
use crate::raw;
use std::collections::HashSet;
use std::ops::Range;

/// Places of the registers of one list, as one structure uses it.
pub(crate) struct Placement {
    /// Index of the list of registers in [`Homes::all`].
    pub home: usize,
    /// Part of the declaration that needs this placement: the structure, or its member that has the type of the
    /// sub-structure.
    pub user: String,
    /// First byte and end of each entry; `None` for padding.
    pub places: Vec<Option<Range<u32>>>,
    /// Size in bytes of the structure. For a block, the bytes up to its last register.
    pub size: u32,
    /// True if the declaration has the layout's names.
    pub is_named_alike: bool,
    /// The declared type that determines the places.
    pub declared: TypeId,
}

/// Result for a structure.
pub(crate) struct Matched {
    pub rows: Vec<Row>,
    /// Placements of every list that the structure uses. `None` if a register has no place.
    pub placements: Option<Vec<Placement>>,
}

/// Compares structures with their declarations.
pub(crate) struct Matcher<'a> {
    pub homes: &'a Homes,
    pub sizes: Sizes<'a>,
    pub called: &'a NamePairs,
    /// True if the declaration has a filler with the name that `commram export st` gives it.
    pub has_our_padding: bool,
}

/// The structure that is being compared.
struct Structure<'a> {
    name: &'a str,
    rows: Vec<Row>,
    placements: Vec<Placement>,
    /// Paths in the declaration that belong to a register, and their parent paths, in lower case.
    used: HashSet<String>,
}

/// A member of the declaration.
struct DeclaredMember {
    offset: u32,
    ty: TypeId,
    /// Path of the member in the declaration.
    path: String,
}

impl<'a> Matcher<'a> {
    /// Compares structure `index` with its declaration `ty`.
    pub(crate) fn structure(&mut self, index: usize, ty: TypeId) -> Result<Matched, ImportError> {
        let homes = self.homes;
        let home = &homes.all[index];
        let mut structure =
            Structure { name: home.name(), rows: Vec::new(), placements: Vec::new(), used: HashSet::new() };
        for list in homes.lists(index) {
            let entries = homes.all[list].raw.register.iter();
            let places = entries.map(|entry| self.entry(&mut structure, entry.get_ref(), ty));
            let places = places.collect::<Result<Vec<_>, _>>()?;
            let end = places.iter().flatten().map(|place| place.end).max().unwrap_or_default();
            let declared = self.sizes.size(ty)?.next_multiple_of(4);
            // The family's structure may have registers that the library of this device does not have. So a structure
            // with a view need not have the full size.
            let least = home.view.map_or(0, |_| home.size());
            let size = if list == index { declared.max(least) } else { end };
            let user = format!("`{}`", structure.name);
            let is_named_alike = !self.called.has_inside(structure.name);
            structure.placements.push(Placement {
                home: list,
                user,
                places,
                size,
                is_named_alike,
                declared: ty,
            });
        }
        self.new_members(&mut structure, ty, "", 0)?;
        let before = home.size();
        let after = structure.placements.last().map(|placement| placement.size);
        let whole =
            structure.rows.iter().all(|row| !matches!(row.verdict, Verdict::Missing | Verdict::Unlike));
        let (verdict, remark) = match whole {
            false => (Verdict::Left, "its file stays as it is"),
            true if after == Some(before) => (Verdict::Same, ""),
            true => (Verdict::Moved, "size in bytes"),
        };
        structure.row("", verdict, Some(before), after, remark.to_owned());
        let last = structure.rows.pop();
        structure.rows.splice(0..0, last);
        Ok(Matched { rows: structure.rows, placements: whole.then_some(structure.placements) })
    }

    /// Compares one register, and returns its place.
    fn entry(
        &mut self,
        structure: &mut Structure,
        entry: &raw::Entry,
        ty: TypeId,
    ) -> Result<Option<Range<u32>>, ImportError> {
        let (Some(name), Some(our_type), Some(offset)) = (&entry.name, &entry.ty, &entry.offset) else {
            return Ok(None);
        };
        let (name, our_type) = (name.get_ref().as_str(), our_type.get_ref().as_str());
        let before = *offset.get_ref();
        let wanted = self.called.of(structure.name, name);
        let mut found = self.find(ty, &wanted)?;
        if let (None, Some(also)) = (&found, &entry.also) {
            found = self.find(ty, also.get_ref())?;
        }
        let Some(found) = found else {
            structure.row(name, Verdict::Missing, Some(before), None, not_called(name, &wanted));
            return Ok(None);
        };
        structure.uses(&found.path);
        let shape = self.sizes.shape(found.ty)?;
        let end = found.offset + self.sizes.size(found.ty)?;
        let counts = bounds(entry);
        let sub = self.homes.substructure(our_type);
        match (&shape.element, sub, Scalar::named(our_type)) {
            (_, _, _) if shape.counts != counts => {}
            (Element::Struct(inner), Some(sub), _) => {
                structure.compared(name, before, &found, remark(name, &found.path));
                self.substructure(structure, sub, (name, before), &found, *inner, shape.size)?;
                return Ok(Some(found.offset..end));
            }
            (Element::Scalar(theirs), None, Some(ours)) if shape.size == ours.width() => {
                structure.scalar(name, before, &found, our_type, theirs);
                return Ok(Some(found.offset..end));
            }
            _ => {}
        }
        let difference =
            format!("{} in the declaration, {} in the layout", shape_text(&shape), ours(our_type, &counts));
        structure.row(name, Verdict::Unlike, Some(before), Some(found.offset), difference);
        Ok(None)
    }

    /// Compares the registers of a sub-structure. `(name, before)` is the member that has the type of the
    /// sub-structure.
    fn substructure(
        &mut self,
        structure: &mut Structure,
        sub: usize,
        (name, before): (&str, u32),
        found: &DeclaredMember,
        inner: TypeId,
        size: u32,
    ) -> Result<(), ImportError> {
        let mut places = Vec::new();
        for entry in &self.homes.all[sub].raw.register {
            let entry = entry.get_ref();
            let (Some(our_name), Some(our_type), Some(our_offset)) = (&entry.name, &entry.ty, &entry.offset)
            else {
                places.push(None);
                continue;
            };
            let path = format!("{name}.{}", our_name.get_ref());
            let our_type = our_type.get_ref().as_str();
            let our_offset = *our_offset.get_ref();
            let before = before + our_offset;
            let called = self.called.of(structure.name, &path);
            let wanted = called.rsplit('.').next().unwrap_or_default();
            let Some(part) = self.find(inner, wanted)? else {
                structure.row(
                    &path,
                    Verdict::Missing,
                    Some(before),
                    None,
                    not_called(our_name.get_ref(), wanted),
                );
                places.push(None);
                continue;
            };
            let part_path = format!("{}.{}", found.path, part.path);
            structure.uses(&part_path);
            let shape = self.sizes.shape(part.ty)?;
            let part = DeclaredMember { path: part_path, ..part };
            let at =
                DeclaredMember { offset: found.offset + part.offset, ty: part.ty, path: part.path.clone() };
            let counts = bounds(entry);
            let width = Scalar::named(our_type).map(Scalar::width);
            match shape.element {
                Element::Scalar(theirs) if shape.counts == counts && Some(shape.size) == width => {
                    // The comparison uses the offset in the sub-structure. If the whole sub-structure has moved, the
                    // import has already reported that.
                    if our_offset != part.offset || our_type != theirs {
                        structure.scalar(&path, before, &at, our_type, theirs);
                    }
                    places.push(Some(part.offset..part.offset + self.sizes.size(part.ty)?));
                }
                _ => {
                    let difference = format!(
                        "{} in the declaration, {} in the layout",
                        shape_text(&shape),
                        ours(our_type, &counts)
                    );
                    structure.row(&path, Verdict::Unlike, Some(before), Some(at.offset), difference);
                    places.push(None);
                }
            }
        }
        self.new_members(structure, inner, &format!("{}.", found.path), found.offset)?;
        let user = format!("`{}.{name}`", structure.name);
        let is_named_alike = !self.called.has_inside(&format!("{}.{name}", structure.name));
        let placement = Placement { home: sub, user, places, size, is_named_alike, declared: inner };
        structure.placements.insert(0, placement);
        Ok(())
    }

    /// Returns the member at the end of a path with dots.
    fn find(&mut self, ty: TypeId, path: &str) -> Result<Option<DeclaredMember>, ImportError> {
        let mut found = DeclaredMember { offset: 0, ty, path: String::new() };
        for name in path.split('.') {
            let shape = self.sizes.shape(found.ty)?;
            let Element::Struct(inner) = shape.element else { return Ok(None) };
            if !shape.counts.is_empty() {
                return Ok(None);
            }
            let members = self.sizes.members(inner)?;
            let Some((offset, member)) =
                members.iter().find(|(_, member)| member.name.eq_ignore_ascii_case(name))
            else {
                return Ok(None);
            };
            let dot = if found.path.is_empty() { "" } else { "." };
            let path = format!("{}{dot}{}", found.path, member.name);
            found = DeclaredMember { offset: found.offset + offset, ty: member.ty, path };
        }
        Ok(Some(found))
    }

    /// Reports members of the declaration that have no register in the layout. `prefix` is the path to these members.
    fn new_members(
        &mut self,
        structure: &mut Structure,
        ty: TypeId,
        prefix: &str,
        start: u32,
    ) -> Result<(), ImportError> {
        for (offset, member) in self.sizes.members(ty)? {
            let path = format!("{prefix}{}", member.name);
            if structure.used.contains(&path.to_ascii_lowercase()) {
                continue;
            }
            let shape = self.sizes.shape(member.ty)?;
            let inside = format!("{}.", path.to_ascii_lowercase());
            if structure.used.iter().any(|used| used.starts_with(&inside))
                && let Element::Struct(inner) = shape.element
            {
                self.new_members(structure, inner, &format!("{path}."), start + offset)?;
            } else if is_padding(&member.name, &shape) {
                self.has_our_padding |= member.name == format!("padding_{offset}");
            } else {
                let remark = format!("{}; the layout has no register for it", shape_text(&shape));
                structure.row(&path, Verdict::New, None, Some(start + offset), remark);
            }
        }
        Ok(())
    }
}

impl Structure<'_> {
    fn row(
        &mut self,
        member: &str,
        verdict: Verdict,
        before: Option<u32>,
        after: Option<u32>,
        remark: String,
    ) {
        let (structure, member) = (self.name.to_owned(), member.to_owned());
        self.rows.push(Row { structure, member, verdict, before, after, remark });
    }

    fn uses(&mut self, path: &str) {
        self.used.insert(path.to_ascii_lowercase());
    }

    fn compared(&mut self, name: &str, before: u32, found: &DeclaredMember, remark: String) {
        let verdict = if before == found.offset { Verdict::Same } else { Verdict::Moved };
        self.row(name, verdict, Some(before), Some(found.offset), remark);
    }

    fn scalar(&mut self, name: &str, before: u32, found: &DeclaredMember, ours: &str, theirs: &str) {
        let called = remark(name, &found.path);
        if ours == theirs {
            return self.compared(name, before, found, called);
        }
        let verdict = if before == found.offset { Verdict::Type } else { Verdict::Moved };
        let remark = format!("{theirs} in the declaration, the layout keeps {ours} {called}");
        self.row(name, verdict, Some(before), Some(found.offset), remark.trim_end().to_owned());
    }
}

fn bounds(entry: &raw::Entry) -> Vec<u32> {
    entry.array.as_ref().map(|array| array.get_ref().clone()).unwrap_or_default()
}

/// True if a member is a filler with the name that `commram export st` gives it.
fn is_padding(name: &str, shape: &Shape) -> bool {
    let number = name.strip_prefix("padding_").unwrap_or_default();
    !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()) && shape.size == 1
}

fn shape_text(shape: &Shape) -> String {
    match shape.element {
        Element::Scalar(name) => ours(name, &shape.counts),
        Element::Struct(_) => ours(&format!("a structure of {} bytes", shape.size), &shape.counts),
    }
}

fn ours(ty: &str, counts: &[u32]) -> String {
    let counts: String = counts.iter().map(|count| format!("{count} x ")).collect();
    format!("{counts}{ty}")
}

/// Returns the name of a register in the declaration, if it differs from the layout's name.
fn remark(ours: &str, theirs: &str) -> String {
    if ours.eq_ignore_ascii_case(theirs) { String::new() } else { format!("there {theirs}") }
}

fn not_called(ours: &str, wanted: &str) -> String {
    if ours == wanted { String::new() } else { format!("nor is there a {wanted}") }
}
