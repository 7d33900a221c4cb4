//! Imports the offsets of registers from declarations of IEC 61131-3 into the layout files.
//!
//! A register is identified by the name of its structure and its path in the structure. The type names of
//! sub-structures are ignored. A structure is imported as a whole or not at all. The import writes nothing that the
//! layout compiler would refuse.

mod edit;
mod error;
mod homes;
mod list;
mod matching;
mod others;
mod rows;
mod views;

pub use error::ImportError;
pub use rows::{Row, Verdict};

use crate::check;
use crate::declaration::{Alignment, Declarations, Sizes, TypeId, printable};
use crate::hash::layout_hash;
use crate::source::Sources;
use homes::{Homes, Table};
use matching::{Matcher, Placement};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Pairs of names that differ between manual and declaration: `STRUCTURE` or `STRUCTURE.REGISTER`, and
/// the declaration's name.
#[derive(Debug, Default)]
pub struct NamePairs(BTreeMap<String, String>);

/// Changes of an import; the caller writes [`Import::files`].
#[derive(Debug)]
pub struct Import {
    /// One row per structure and register.
    pub rows: Vec<Row>,
    /// Layout hash before the import.
    pub hash_before: u64,
    /// Layout hash after the import.
    pub hash_after: u64,
    /// True if `commram export` has written the declarations; the import then changes nothing.
    pub is_own_export: bool,
    /// Other devices with registers that move, because the devices share structures.
    pub also_moved: Vec<String>,
    /// Files that change, with their new content.
    files: Vec<(PathBuf, String)>,
}

impl Import {
    /// Compares the layout in `dir` with declarations and prepares the new files.
    ///
    /// # Errors
    /// The layout or a declaration is wrong, the file declares none of the structures, or the result would be an invalid
    /// layout.
    pub fn plan(
        dir: &Path,
        declarations: &Declarations,
        alignment: Alignment,
        called: &NamePairs,
    ) -> Result<Self, ImportError> {
        let hash_before = layout_hash(&check::load(&mut Sources::new(dir))?);
        let homes = Homes::read(Sources::new(dir))?;
        called.check(&homes, declarations)?;
        let sizes = Sizes::new(declarations, alignment);
        let mut matcher = Matcher { homes: &homes, sizes, called, has_our_padding: false };
        let mut rows = Vec::new();
        let mut placements: Vec<Placement> = Vec::new();
        let mut left = Vec::new();
        for index in homes.structures() {
            let name = homes.all[index].name();
            let Some(ty) = declarations.find_only(&called.of_structure(name))? else {
                // The device has its own structure, under another name, for this structure of the family. That
                // structure is imported instead.
                if homes.is_viewed(index) {
                    continue;
                }
                rows.push(undeclared(name, homes.all[index].size()));
                left.push(index);
                continue;
            };
            let matched = matcher.structure(index, ty)?;
            rows.extend(matched.rows);
            match matched.placements {
                Some(found) => {
                    placements.extend(views::of_family(&homes, index, &found));
                    placements.extend(found);
                }
                None => left.push(index),
            }
        }
        if rows.iter().all(|row| row.verdict == Verdict::Undeclared) {
            return Err(nothing_declared(&homes, declarations));
        }
        let placements = agree(&homes, placements, &left)?;
        let is_own_export = declarations.is_own_export || matcher.has_our_padding;
        let (files, also_moved) = if is_own_export {
            (Vec::new(), Vec::new())
        } else {
            let also = others::check(&homes, &placements, &others::of_family(dir, &homes)?, declarations)?;
            (edit::files(&homes, &placements, &marks(&homes, declarations)?)?, also)
        };
        let mut after = Sources::new(dir).edited(files.iter().cloned().collect());
        let device = check::load(&mut after).map_err(|error| ImportError::Refused(error.reason))?;
        Ok(Self { rows, hash_before, hash_after: layout_hash(&device), is_own_export, also_moved, files })
    }

    /// True if the layout files stay as they are.
    pub fn changes_nothing(&self) -> bool {
        self.files.is_empty()
    }

    /// True if all declared structures can be imported. For an export of commram itself, true if the layout has the
    /// same offsets.
    pub fn is_whole(&self) -> bool {
        let is_fine = |verdict| match verdict {
            Verdict::Left => false,
            Verdict::Moved | Verdict::New | Verdict::Type => !self.is_own_export,
            Verdict::Same | Verdict::Missing | Verdict::Unlike | Verdict::Undeclared => true,
        };
        self.rows.iter().all(|row| is_fine(row.verdict))
    }

    /// Returns the files that change, with their new contents.
    pub fn files(&self) -> impl Iterator<Item = (&Path, &str)> {
        self.files.iter().map(|(path, text)| (path.as_path(), text.as_str()))
    }
}

impl NamePairs {
    /// Makes the table from pairs of the layout's and the declaration's name.
    ///
    /// # Errors
    /// [`ImportError::Called`] if two pairs are about the same name of the layout.
    pub fn new(pairs: impl IntoIterator<Item = (String, String)>) -> Result<Self, ImportError> {
        let mut all = BTreeMap::new();
        for (ours, theirs) in pairs {
            if let Some(other) = all.insert(ours.clone(), theirs.clone()) {
                let right =
                    format!("`{ours}` already has the name `{other}` in the declarations; give one name");
                return Err(ImportError::Called { ours, theirs, right });
            }
        }
        Ok(Self(all))
    }

    fn of_structure(&self, structure: &str) -> String {
        self.0.get(structure).cloned().unwrap_or_else(|| structure.to_owned())
    }

    fn of(&self, structure: &str, path: &str) -> String {
        self.0.get(&format!("{structure}.{path}")).cloned().unwrap_or_else(|| path.to_owned())
    }

    /// True if a name inside `path` differs between layout and declaration.
    fn has_inside(&self, path: &str) -> bool {
        let inside = format!("{path}.");
        self.0.keys().any(|ours| ours.starts_with(&inside))
    }

    /// Checks that every name on the left is a name of the layout, and that the declarations have the structures on the
    /// right.
    fn check(&self, homes: &Homes, declarations: &Declarations) -> Result<(), ImportError> {
        for (ours, theirs) in &self.0 {
            let mut path = ours.split('.');
            let structure = path.next().unwrap_or_default();
            let found = homes.structures().find(|index| homes.all[*index].name() == structure);
            let mut lists = found.map(|index| homes.lists(index));
            for name in path {
                let entries = lists.into_iter().flatten().flat_map(|list| &homes.all[list].raw.register);
                let mut named = entries
                    .map(toml::Spanned::get_ref)
                    .filter(|entry| entry.name.as_ref().is_some_and(|known| known.get_ref() == name));
                let ty = named.next().map(|entry| entry.ty.as_ref().map_or("", |ty| ty.get_ref()));
                lists = ty.map(|ty| homes.substructure(ty).into_iter().collect());
            }
            if lists.is_none() {
                let right = "write the layout's STRUCTURE or STRUCTURE.REGISTER on the left".to_owned();
                let (ours, theirs) = (ours.clone(), theirs.clone());
                return Err(ImportError::Called { ours, theirs, right });
            }
            if ours == structure && declarations.find_only(theirs)?.is_none() {
                let right = format!(
                    "{} declares no structure `{theirs}`; its structures: {}",
                    declarations.title(),
                    declared_by(declarations)
                );
                return Err(ImportError::Called { ours: ours.clone(), theirs: theirs.clone(), right });
            }
        }
        Ok(())
    }
}

fn undeclared(structure: &str, size: u32) -> Row {
    let (structure, member, remark) = (structure.to_owned(), String::new(), String::new());
    Row { structure, member, verdict: Verdict::Undeclared, before: Some(size), after: None, remark }
}

fn nothing_declared(homes: &Homes, declarations: &Declarations) -> ImportError {
    let known: Vec<_> = homes.structures().map(|index| homes.all[index].name()).collect();
    let declared = declared_by(declarations);
    ImportError::NothingDeclared { path: declarations.title(), known: known.join(", "), declared }
}

/// Returns the names of the declared structures; of many structures, only the first ones.
fn declared_by(declarations: &Declarations) -> String {
    let declared: Vec<_> = declarations.structures().take(20).collect();
    if declared.is_empty() { "none".to_owned() } else { declared.join(", ") }
}

/// Returns every list of registers once. A list that several structures use must have the same places in all of them.
/// If one of these structures is in `left`, the places must be the present ones, because structures in `left` stay
/// unchanged.
fn agree(homes: &Homes, placements: Vec<Placement>, left: &[usize]) -> Result<Vec<Placement>, ImportError> {
    let mut agreed: Vec<Placement> = Vec::new();
    for placement in placements {
        let theirs = (&*offsets(&placement), placement.size, &*placement.user);
        let compared = |known: &Placement| compare(homes, known, theirs);
        match agreed.iter().find(|known| known.home == placement.home) {
            Some(known) => compared(known)?,
            None => agreed.push(placement),
        }
    }
    for (index, part) in
        left.iter().flat_map(|index| homes.parts(*index).into_iter().map(move |part| (index, part)))
    {
        if let Some(known) = agreed.iter().find(|known| known.home == part) {
            let user = format!("`{}`, which stays as it is", homes.all[*index].name());
            compare(homes, known, (&homes.all[part].offsets(), homes.all[part].size(), &user))?;
        }
    }
    Ok(agreed)
}

fn offsets(placement: &Placement) -> Vec<Option<u32>> {
    placement.places.iter().map(|place| place.as_ref().map(|place| place.start)).collect()
}

/// Reports an error if the registers of `one` have other offsets than `user` needs, or the structure has another size. The
/// size of a block is not compared, because its registers are in the structure itself.
fn compare(
    homes: &Homes,
    one: &Placement,
    (theirs, size, user): (&[Option<u32>], u32, &str),
) -> Result<(), ImportError> {
    let home = &homes.all[one.home];
    let names = home.raw.register.iter().map(|entry| entry.get_ref().name.as_ref());
    let names = names.map(|name| name.map_or("", |name| name.get_ref()));
    let mut pairs: Vec<_> = names.zip(offsets(one).into_iter().zip(theirs.iter().copied())).collect();
    if !matches!(home.table, Table::Block(_)) {
        pairs.push(("size", (Some(one.size), Some(size))));
    }
    let unlike = pairs
        .into_iter()
        .find_map(|(name, (one, other))| Some((name, one?, other?)).filter(|_| one != other));
    let why = match home.table {
        Table::Block(_) => {
            ": these structures overlay each other, and the firmware needs the registers at one address in all of them"
        }
        Table::Top | Table::Substructure(_) => "",
    };
    match unlike {
        None => Ok(()),
        Some((register, offset, other_offset)) => Err(ImportError::Conflict {
            part: home.name().to_owned(),
            register: register.to_owned(),
            user: one.user.clone(),
            offset,
            other: user.to_owned(),
            other_offset,
            why,
        }),
    }
}

/// Returns the provenance of an import: the device's library, and the name of the file that declares the type.
fn marks<'a>(
    homes: &'a Homes,
    declarations: &'a Declarations,
) -> Result<impl Fn(TypeId) -> String + use<'a>, ImportError> {
    let Some(library) = &homes.library else {
        return Err(ImportError::NoLibrary { path: declarations.title(), device: homes.device.clone() });
    };
    Ok(move |declared| {
        let path = declarations.file_of(declared);
        let name = path.file_name().unwrap_or(path.as_os_str());
        format!("manual: {library}, {}", printable(&name.to_string_lossy()))
    })
}
