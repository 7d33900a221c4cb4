//! The files of one layout, and positions in them.

use crate::error::{Error, Location, Reason};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

/// Every file that has been read, with its number.
pub(crate) struct Sources {
    dir: PathBuf,
    reach: Reach,
    /// Texts that replace the contents of files.
    edits: BTreeMap<PathBuf, String>,
    files: Vec<(PathBuf, String)>,
}

/// Files that a layout may consist of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reach {
    /// The files may be in the directory itself, and in the directory of a family next to it.
    Family,
    /// The files must be in the directory itself and must not be links, because the author of the directory is unknown.
    Folder,
}

/// A place: file number and byte position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SourcePlace {
    pub file: usize,
    pub byte: usize,
}

/// Maximum size of a layout file in bytes, 25 times the largest existing one.
const LONGEST: u64 = 1 << 20;
/// Maximum size of all files of a layout in bytes, 20 times the largest existing layout.
const LONGEST_LAYOUT: usize = 2 << 20;

/// Reads the text of a file. Refuses a file without an end, and a file that blocks.
fn read(path: &Path) -> io::Result<String> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file"));
    }
    let mut text = String::new();
    fs::File::open(path)?.take(LONGEST + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LONGEST {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, "it has more than 1 MiB"));
    }
    Ok(text)
}

impl Sources {
    pub(crate) fn new(dir: &Path) -> Self {
        Self { dir: dir.to_owned(), reach: Reach::Family, edits: BTreeMap::new(), files: Vec::new() }
    }

    /// Creates sources that must all be in the folder `dir` itself.
    pub(crate) fn of_folder(dir: &Path) -> Self {
        Self { reach: Reach::Folder, ..Self::new(dir) }
    }

    /// True if all files must lie in the directory.
    pub(crate) fn is_folder(&self) -> bool {
        self.reach == Reach::Folder
    }

    /// Returns the text of a file that is not a part of the layout. `None` if the file does not exist.
    pub(crate) fn read_text(&self, name: &str) -> Result<Option<String>, Error> {
        self.confine(name).map_err(|reason| self.error_of(name, None, reason))?;
        match read(&self.dir.join(name)) {
            Ok(text) => Ok(Some(text)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(self.error_of(name, None, Reason::Unreadable(error.to_string()))),
        }
    }

    /// Refuses a file outside of the folder, which its name or a link would reach.
    fn confine(&self, name: &str) -> Result<(), Reason> {
        let mut path = self.dir.clone();
        for part in Path::new(name).components() {
            let Component::Normal(part) = part else { return Err(Reason::OutsideFolder(name.to_owned())) };
            path.push(part);
            if fs::symlink_metadata(&path).is_ok_and(|found| found.is_symlink()) {
                return Err(Reason::LinkInFolder(path.display().to_string()));
            }
        }
        Ok(())
    }

    /// Returns the same sources, with texts that replace the contents of some files.
    pub(crate) fn edited(self, edits: BTreeMap<PathBuf, String>) -> Self {
        Self { edits, ..self }
    }

    /// Returns every file that was read, with its text.
    pub(crate) fn into_files(self) -> Vec<(PathBuf, String)> {
        self.files
    }

    /// Reads and parses `name`, which may be in a directory beside this one (`../other/name`), and returns its number
    /// with the content. `from` is the place that names the file; the error about a missing file names this place.
    pub(crate) fn parse<T: DeserializeOwned>(
        &mut self,
        name: &str,
        from: Option<SourcePlace>,
    ) -> Result<(usize, T), Error> {
        if self.is_folder() {
            self.confine(name).map_err(|reason| self.error_of(name, from, reason))?;
        }
        let path = match (name.strip_prefix("../"), self.dir.parent()) {
            (Some(beside), Some(parent)) => parent.join(beside),
            _ => self.dir.join(name),
        };
        let text = self.edits.get(&path).cloned().map_or_else(|| read(&path), Ok);
        let text = text.map_err(|error| {
            let why = if from.is_some() { format!("{}: {error}", path.display()) } else { error.to_string() };
            self.error_of(name, from, Reason::Unreadable(why))
        })?;
        if self.files.iter().map(|(_, text)| text.len()).sum::<usize>() + text.len() > LONGEST_LAYOUT
            && let Some(at) = from
        {
            return Err(self.error(at, Reason::LayoutTooLong { most: LONGEST_LAYOUT >> 20 }));
        }
        self.files.push((path, text));
        let file = self.files.len() - 1;
        let value = toml::from_str(&self.files[file].1).map_err(|error| {
            let byte = error.span().unwrap_or(0..0).start;
            self.error(SourcePlace { file, byte }, Reason::Syntax(error.message().to_owned()))
        })?;
        Ok((file, value))
    }

    /// Returns the error of file `name`, at the place that names the file, if there is such a place.
    fn error_of(&self, name: &str, from: Option<SourcePlace>, reason: Reason) -> Error {
        match from {
            Some(at) => self.error(at, reason),
            None => Error {
                at: Location { file: self.dir.join(name), line: 1, column: 1 },
                reason: Box::new(reason),
            },
        }
    }

    pub(crate) fn error(&self, at: SourcePlace, reason: Reason) -> Error {
        let (path, text) = &self.files[at.file];
        let before = &text[..at.byte.min(text.len())];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Error {
            at: Location {
                file: path.clone(),
                line: before.matches('\n').count() + 1,
                column: before[line_start..].chars().count() + 1,
            },
            reason: Box::new(reason),
        }
    }
}

/// Returns the place where `span` begins.
pub(crate) fn at(file: usize, span: Range<usize>) -> SourcePlace {
    SourcePlace { file, byte: span.start }
}
