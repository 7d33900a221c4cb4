//! Everything in the layout files that has a list of registers: structures, sub-structures, blocks.

use crate::check::files;
use crate::error::Error;
use crate::raw;
use crate::source::Sources;
use std::collections::BTreeMap;
use std::path::PathBuf;
use toml::Spanned;

/// Place of a list of registers in a layout file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Table {
    /// The list is at the top level of a separate file.
    Top,
    /// The list is in this element of `[[substructure]]`.
    Substructure(usize),
    /// The list is in this element of `[[block]]`.
    Block(usize),
}

/// A structure, sub-structure or block in the form of its file.
pub(crate) struct Home {
    pub file: usize,
    pub table: Table,
    /// True if the structure belongs to the family, so that other devices use it, too.
    pub is_shared: bool,
    /// The family's structure that defines the offsets instead of this structure: an index into [`Homes::all`].
    pub view: Option<usize>,
    pub raw: raw::Structure,
}

/// All lists of registers of a layout, and the files that contain them.
pub(crate) struct Homes {
    /// Name of the device.
    pub device: String,
    /// Directory of the family with which the device shares structures.
    pub family: Option<String>,
    /// Name of the vendor's library of types.
    pub library: Option<String>,
    pub all: Vec<Home>,
    pub files: Vec<(PathBuf, String)>,
}

impl Homes {
    /// Reads a layout that was checked before.
    pub(crate) fn read(mut sources: Sources) -> Result<Self, Error> {
        let top = files::read(&mut sources)?;
        let mut all = Vec::new();
        for part in &top.parts {
            let (file, parts): (usize, raw::Parts) = sources.parse(&part.path, None)?;
            let home = |table: fn(usize) -> Table| {
                let is_shared = part.shared;
                move |(index, raw): (usize, raw::Structure)| Home {
                    file,
                    table: table(index),
                    is_shared,
                    view: None,
                    raw,
                }
            };
            all.extend(parts.substructure.into_iter().enumerate().map(home(Table::Substructure)));
            all.extend(parts.block.into_iter().enumerate().map(home(Table::Block)));
        }
        for structure in &top.structures {
            let (file, raw) = sources.parse(&structure.path, None)?;
            all.push(Home { file, table: Table::Top, is_shared: structure.shared, view: None, raw });
        }
        let raw::Device { name, family, library, .. } = top.device;
        let (device, family) = (name.into_inner(), family.map(Spanned::into_inner));
        let mut homes = Self { device, family, library, all, files: Vec::new() };
        homes.place_views();
        homes.files = sources.into_files();
        Ok(homes)
    }

    /// Copies the offsets of the family's structures to the registers of structures with a view.
    fn place_views(&mut self) {
        for index in 0..self.all.len() {
            let Some(view) = self.all[index].raw.view.as_ref().map(|view| view.get_ref().clone()) else {
                continue;
            };
            let is_it =
                |home: &Home| home.table == Table::Top && home.raw.view.is_none() && home.name() == view;
            let Some(base) = self.all.iter().position(is_it) else { continue };
            let offsets: BTreeMap<String, u32> =
                self.registers(base).map(|(_, name, offset)| (name.to_owned(), offset)).collect();
            let size = self.all[base].size();
            for list in self.lists(index) {
                let raw = &mut self.all[list].raw;
                raw.size.get_or_insert_with(|| Spanned::new(0..0, size));
                for entry in raw.register.iter_mut().map(Spanned::get_mut) {
                    let offset = called_there(entry).and_then(|name| offsets.get(name)).copied();
                    entry.offset =
                        entry.offset.take().or_else(|| offset.map(|offset| Spanned::new(0..0, offset)));
                }
                self.all[list].view = Some(base);
            }
        }
    }

    /// Returns the registers of a structure and its blocks, in ascending order: list, name and offset.
    pub(crate) fn registers(&self, structure: usize) -> impl Iterator<Item = (usize, &str, u32)> {
        let of_list = |list: usize| {
            let entries = self.all[list].raw.register.iter().map(Spanned::get_ref);
            entries.filter_map(move |entry| {
                Some((list, entry.name.as_ref()?.get_ref().as_str(), *entry.offset.as_ref()?.get_ref()))
            })
        };
        let mut all: Vec<_> = self.lists(structure).into_iter().flat_map(of_list).collect();
        all.sort_by_key(|(.., offset)| *offset);
        all.into_iter()
    }

    /// True if the device views the structure through a structure of its own.
    pub(crate) fn is_viewed(&self, structure: usize) -> bool {
        self.all.iter().any(|home| home.table == Table::Top && home.view == Some(structure))
    }

    /// True if an import writes its marks into the file of this list. If this device views the family's structures
    /// through structures of its own, only its own files get marks, because the family's files also belong to other
    /// devices.
    pub(crate) fn is_marked(&self, home: usize) -> bool {
        !(self.all[home].is_shared && self.all.iter().any(|home| home.view.is_some()))
    }

    /// Indices of the structures.
    pub(crate) fn structures(&self) -> impl Iterator<Item = usize> {
        (0..self.all.len()).filter(|index| self.all[*index].table == Table::Top)
    }

    /// Returns the sub-structure of this name.
    pub(crate) fn substructure(&self, name: &str) -> Option<usize> {
        let is_it = |home: &Home| matches!(home.table, Table::Substructure(_)) && home.name() == name;
        self.all.iter().position(is_it)
    }

    /// Returns the structure's own list, and the lists of its blocks.
    pub(crate) fn lists(&self, structure: usize) -> Vec<usize> {
        let blocks = self.all[structure].raw.blocks.iter().filter_map(|name| {
            let is_it = |home: &Home| matches!(home.table, Table::Block(_)) && home.name() == name.get_ref();
            self.all.iter().position(is_it)
        });
        blocks.chain([structure]).collect()
    }

    /// Returns all parts of a structure: its lists, and the sub-structures in them.
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

/// Returns the name of a register in the structure of `view`.
pub(crate) fn called_there(entry: &raw::Entry) -> Option<&str> {
    entry.view_name.as_ref().or(entry.name.as_ref()).map(|name| name.get_ref().as_str())
}

impl Home {
    pub(crate) fn name(&self) -> &str {
        self.raw.name.get_ref()
    }

    /// True if the manual or the vendor's library states the offsets.
    pub(crate) fn is_confirmed(&self) -> bool {
        !matches!(self.raw.offsets, raw::Provenance::Inferred(_))
    }

    /// Returns the size in bytes.
    pub(crate) fn size(&self) -> u32 {
        self.raw.size.as_ref().map_or(0, |size| *size.get_ref())
    }

    /// Returns the present offsets of the registers; `None` for padding.
    pub(crate) fn offsets(&self) -> Vec<Option<u32>> {
        let entries = self.raw.register.iter().map(toml::Spanned::get_ref);
        entries
            .map(|entry| entry.name.as_ref().and(entry.offset.as_ref()).map(|offset| *offset.get_ref()))
            .collect()
    }
}
