//! Devices of folders: sections with a path as `kind`.

use super::PlantError;
use super::file::{Source, line_of};
use crate::devices;
use crate::devices::folder::{self, Folder};
use core::ops::Range;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::DeValue;

/// The device folders that a plant file names.
pub(super) struct Folders<'a> {
    source: Source<'a>,
    /// The directory at which relative paths begin.
    base: &'a Path,
    /// Each folder that was read, by its absolute path. Many devices of a plant can have the same folder.
    read: HashMap<PathBuf, &'static Folder>,
    /// Ranges of relative paths in the text, each with the absolute path.
    places: Vec<(Range<usize>, String)>,
}

impl<'a> Folders<'a> {
    pub(super) fn new(source: Source<'a>, base: &'a Path) -> Self {
        Folders { source, base, read: HashMap::new(), places: Vec::new() }
    }

    /// Returns the folder of a device, if its section names a folder by path, or by name in the search path.
    /// Removes `kind` from the section. If the program itself contains a device of this name, that device has
    /// priority over a folder.
    ///
    /// # Errors
    /// [`PlantError::Folder`] with the line of the path.
    pub(super) fn of(
        &mut self,
        section: &mut Spanned<DeValue<'_>>,
    ) -> Result<Option<(&'static Folder, PathBuf)>, PlantError> {
        let DeValue::Table(table) = section.get_mut() else { return Ok(None) };
        let path = |kind: &Spanned<DeValue<'_>>| {
            let kind = kind.get_ref().as_str()?;
            if folder::is_path(kind) {
                return Some(PathBuf::from(kind));
            }
            devices::find(kind).is_none().then(|| folder::search(kind))?
        };
        let Some(path) = table.get("kind").and_then(path) else { return Ok(None) };
        let Some(kind) = table.remove("kind") else { return Ok(None) };
        let Source { file, text } = self.source;
        if let Some(option) = table.get("option") {
            let card = toml::Value::String(kind.get_ref().as_str().unwrap_or_default().to_owned());
            return Err(PlantError::Syntax {
                file: file.to_owned(),
                line: Some(line_of(text, option.span().start)),
                what: format!(
                    "an option card is a section of its PLC: write [[plc.option]] with slot = 1 and card = {card} \
                     instead of this [[device]]"
                ),
            });
        }
        self.find(&path, kind.span()).map(Some)
    }

    /// Returns the folder of an option card.
    ///
    /// # Errors
    /// [`PlantError::Folder`] or [`PlantError::Kind`] with the line of the path.
    pub(super) fn of_card(
        &mut self,
        card: &Spanned<String>,
    ) -> Result<(&'static Folder, PathBuf), PlantError> {
        let kind = card.get_ref();
        let path = if folder::is_path(kind) { Some(PathBuf::from(kind)) } else { folder::search(kind) };
        if let Some(path) = path {
            return self.find(&path, card.span());
        }
        let Source { file, text } = self.source;
        let known = folder::names_in_search_path();
        let known = known.into_iter().chain(["a path with a '/'".to_owned()]).collect::<Vec<_>>().join(", ");
        let line = line_of(text, card.span().start);
        Err(PlantError::Kind { file: file.to_owned(), line, what: "option card", kind: kind.clone(), known })
    }

    /// Returns the folder at `path`, which is at `place` in the text.
    fn find(&mut self, path: &Path, place: Range<usize>) -> Result<(&'static Folder, PathBuf), PlantError> {
        let Source { file, text } = self.source;
        let refused =
            |source| PlantError::Folder { file: file.to_owned(), line: line_of(text, place.start), source };
        let path = path.to_string_lossy();
        let dir = folder::find(self.base, &path).map_err(refused)?;
        let known = match self.read.get(&dir) {
            Some(known) => known,
            None => {
                let read = folder::load(&dir).map_err(refused)?;
                self.read.insert(dir.clone(), read);
                read
            }
        };
        let absolute = toml::Value::String(dir.display().to_string()).to_string();
        self.places.push((place, absolute));
        Ok((known, dir))
    }

    /// Returns the text of the plant file with absolute paths, so that it means the same plant in any working
    /// directory.
    pub(super) fn absolute(mut self, text: &str) -> String {
        self.places.sort_by_key(|(place, _)| place.start);
        let mut whole = text.to_owned();
        for (place, path) in self.places.into_iter().rev() {
            whole.replace_range(place, &path);
        }
        whole
    }
}
