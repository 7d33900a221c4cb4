//! The TOML files that the language server checks: plant files, and the files in the folder of a device.

use super::complete::Proposal;
use super::document::Document;
use super::judge::Mistake;
use super::schema::Schema;
use super::table::{Slot, TablePlace};
use crate::cli::complete::PlcScope;
use crate::devices::folder::{FolderError, edited};
use crate::journal::Names;
use crate::layout::DeviceFit;
use crate::plant::PlantConfig;
use core::ops::Range;
use lsp_types::CompletionItemKind;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Purpose of a TOML file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum TableKind {
    Plant,
    /// A file of the layout of the device in this folder.
    Layout(PathBuf),
    /// `handshakes.toml` in this folder.
    Handshakes(PathBuf),
}

impl TableKind {
    /// Determines the kind of a file; `None` for files of other programs (D-840).
    pub(super) fn of(document: &Document) -> Option<Self> {
        let name = document.path.file_name()?.to_str()?;
        let directory = document.path.parent()?;
        if name == "device.toml"
            || directory.join("device.toml").is_file() && !is_plant(document.text.as_str())
        {
            return Some(match name {
                "handshakes.toml" => Self::Handshakes(directory.to_owned()),
                _ => Self::Layout(directory.to_owned()),
            });
        }
        (name == "plant.toml" || is_plant(document.text.as_str())).then_some(Self::Plant)
    }

    /// Returns the errors in the file.
    pub(super) fn mistakes(
        &self,
        document: &Document,
        edits: impl Fn(&Path) -> BTreeMap<PathBuf, String>,
    ) -> Vec<Mistake> {
        let text = document.text.as_str();
        match self {
            Self::Plant => plant(document),
            Self::Layout(dir) => of_folder(document, edited::check_layout(dir, edits(dir))),
            Self::Handshakes(dir) => of_folder(document, edited::check_handshakes(dir, text)),
        }
    }

    /// Returns the keys and values that fit at a position, and the range that each of them replaces.
    pub(super) fn proposals(&self, document: &Document, offset: usize) -> (Vec<Proposal>, Range<usize>) {
        let place = TablePlace::at(document.text.as_str(), offset);
        let found = match self {
            Self::Handshakes(dir) => handshake_proposals(dir, &place),
            _ => self.schema(document).map(|schema| schema.proposals(&place)).unwrap_or_default(),
        };
        (found, place.word)
    }

    /// Returns the description of the key at a position, and the range of the key.
    pub(super) fn description(&self, document: &Document, offset: usize) -> Option<(String, Range<usize>)> {
        let text = document.text.as_str();
        self.schema(document)?.description(&TablePlace::at(text, offset), text)
    }

    fn schema(&self, document: &Document) -> Option<Schema> {
        let name = document.path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        match self {
            Self::Plant => Some(Schema::of_plants()),
            Self::Layout(_) => Some(Schema::of_layout(name, document.text.as_str())),
            Self::Handshakes(_) => None,
        }
    }
}

/// True if the text has a section of a plant, or names the schema of plant files.
fn is_plant(text: &str) -> bool {
    text.lines().any(|line| {
        let line = line.trim_start();
        ["[[plc]]", "[[device]]", "[[bus]]"].iter().any(|section| line.starts_with(section))
            || line.starts_with("#:schema") && line.contains("plant.schema.json")
    })
}

/// Returns the error of a plant file, or its warnings.
fn plant(document: &Document) -> Vec<Mistake> {
    let (text, path) = (document.text.as_str(), &document.path);
    let directory = path.parent().unwrap_or(Path::new(""));
    match PlantConfig::parse_from(directory, &path.display().to_string(), text) {
        Ok(config) => {
            let doubts = config.doubts(text).into_iter();
            doubts.map(|(line, doubt)| Mistake::warning(document.text.line(line), doubt.text)).collect()
        }
        Err(error) => vec![Mistake::error(document.text.line(error.line()), error.message())],
    }
}

/// Returns the error of a folder. An error in another file of the folder is shown at the first line.
pub(super) fn of_folder(document: &Document, checked: Result<(), FolderError>) -> Vec<Mistake> {
    let Err(error) = checked else { return Vec::new() };
    let (path, range, what) = match &error {
        FolderError::Layout(error) => {
            let at = document.text.byte_at(error.at.line, error.at.column);
            let rest = document.text.as_str()[at..].lines().next().unwrap_or_default();
            // Marks the text from the error to the end of the value or line.
            let end = rest.find([',', '}', '#']).unwrap_or(rest.len());
            let range = at..at + rest[..end].trim_end().len();
            let range = if range.is_empty() { document.text.line(Some(error.at.line)) } else { range };
            (error.at.file.clone(), range, error.reason.to_string())
        }
        FolderError::Table { path, line, what } | FolderError::Script { path, line, what } => {
            (path.clone(), document.text.line(Some(*line)), what.clone())
        }
        other => return vec![Mistake::error(document.text.line(Some(1)), other.to_string())],
    };
    let is_here = path.file_name() == document.path.file_name();
    vec![if is_here {
        Mistake::error(range, what)
    } else {
        Mistake::error(document.text.line(Some(1)), error.to_string())
    }]
}

/// Proposes keys for the tables of `handshakes.toml`, and the registers of the saved layout.
fn handshake_proposals(dir: &Path, place: &TablePlace) -> Vec<Proposal> {
    let key = place.path.last().map_or("", String::as_str);
    match place.slot {
        Slot::Nothing => Vec::new(),
        Slot::Header => {
            let tables = edited::handshake_keys("").into_iter();
            tables.map(|name| Proposal::new(format!("[[{name}]]"), "", CompletionItemKind::STRUCT)).collect()
        }
        Slot::Key => {
            let keys = edited::handshake_keys(key).into_iter().filter(|key| !place.given.contains(key));
            keys.map(|key| Proposal::new(key, "", CompletionItemKind::PROPERTY)).collect()
        }
        Slot::Value if matches!(key, "register" | "acknowledge" | "from" | "to") => {
            let Ok(layout) = edited::layout(dir) else { return Vec::new() };
            let device = DeviceFit::unknown(layout);
            let names = Names { plcs: vec![String::new()], buses: Vec::new(), devices: vec![device] };
            let found = super::complete::registers(&PlcScope::of(&names), "").into_iter();
            found.map(|proposal| Proposal { label: format!("\"{}\"", proposal.label), ..proposal }).collect()
        }
        Slot::Value => Vec::new(),
    }
}
