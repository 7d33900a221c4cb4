//! Everything in the layout files that has a list of registers: structures, sub-structures, blocks.

use crate::check::files;
use crate::error::Error;
use crate::raw;
use crate::source::Sources;
use std::path::PathBuf;

/// Where a list of registers stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Table {
    /// At the top of its own file.
    Top,
    /// This element of `[[substructure]]`.
    Substructure(usize),
    /// This element of `[[block]]`.
    Block(usize),
}

/// A structure, sub-structure or block as written.
pub(crate) struct Home {
    pub file: usize,
    pub table: Table,
    pub raw: raw::Structure,
}

/// All of them, and the files they are in.
pub(crate) struct Homes {
    pub all: Vec<Home>,
    pub files: Vec<(PathBuf, String)>,
}

impl Homes {
    /// Reads a layout that has been found correct.
    pub(crate) fn read(mut sources: Sources) -> Result<Self, Error> {
        let top = files::read(&mut sources)?;
        let mut all = Vec::new();
        for part in &top.parts {
            let (file, part): (usize, raw::Parts) = sources.parse(&part.path, None)?;
            let home = |table: fn(usize) -> Table| {
                move |(index, raw): (usize, raw::Structure)| Home { file, table: table(index), raw }
            };
            all.extend(part.substructure.into_iter().enumerate().map(home(Table::Substructure)));
            all.extend(part.block.into_iter().enumerate().map(home(Table::Block)));
        }
        for structure in &top.structures {
            let (file, raw) = sources.parse(&structure.path, None)?;
            let home = Home { file, table: Table::Top, raw };
            // One with a view has no offsets of its own.
            all.extend(home.raw.view.is_none().then_some(home));
        }
        Ok(Self { all, files: sources.into_files() })
    }

    /// Indices of the structures.
    pub(crate) fn structures(&self) -> impl Iterator<Item = usize> {
        (0..self.all.len()).filter(|index| self.all[*index].table == Table::Top)
    }

    /// The sub-structure of this name.
    pub(crate) fn substructure(&self, name: &str) -> Option<usize> {
        let is_it = |home: &Home| matches!(home.table, Table::Substructure(_)) && home.name() == name;
        self.all.iter().position(is_it)
    }

    /// A structure's own list and those of its blocks.
    pub(crate) fn lists(&self, structure: usize) -> Vec<usize> {
        let blocks = self.all[structure].raw.blocks.iter().filter_map(|name| {
            let is_it = |home: &Home| matches!(home.table, Table::Block(_)) && home.name() == name.get_ref();
            self.all.iter().position(is_it)
        });
        blocks.chain([structure]).collect()
    }

    /// Everything a structure uses: its lists and the sub-structures in them.
    pub(crate) fn parts(&self, structure: usize) -> Vec<usize> {
        let mut parts = self.lists(structure);
        for list in self.lists(structure) {
            let types = self.all[list].raw.register.iter().filter_map(|entry| entry.get_ref().ty.as_ref());
            parts.extend(types.filter_map(|ty| self.substructure(ty.get_ref())));
        }
        parts.sort_unstable();
        parts.dedup();
        parts
    }
}

impl Home {
    pub(crate) fn name(&self) -> &str {
        self.raw.name.get_ref()
    }

    /// In bytes.
    pub(crate) fn size(&self) -> u32 {
        self.raw.size.as_ref().map_or(0, |size| *size.get_ref())
    }

    /// Offsets of the registers as they are; none of padding.
    pub(crate) fn offsets(&self) -> Vec<Option<u32>> {
        let entries = self.raw.register.iter().map(toml::Spanned::get_ref);
        entries
            .map(|entry| entry.name.as_ref().and(entry.offset.as_ref()).map(|offset| *offset.get_ref()))
            .collect()
    }
}
