//! A document that the editor has open.

use super::outline::Outline;
use super::place::path_of;
use super::text::Text;
use crate::input_file;
use lsp_types::{TextDocumentContentChangeEvent, Uri};
use std::path::PathBuf;

/// A document that the editor has open.
pub(super) struct Document {
    pub(super) uri: Uri,
    pub(super) path: PathBuf,
    /// The editor's version number of the document.
    pub(super) version: i32,
    pub(super) text: Text,
    /// The parts of a script; empty for other files and for texts that are too long.
    pub(super) outline: Outline,
}

impl Document {
    pub(super) fn new(uri: Uri, version: i32, text: String) -> Self {
        let path = path_of(&uri);
        let mut document = Self { uri, path, version, text: Text::new(text), outline: Outline::of("") };
        document.read();
        document
    }

    /// Applies the changes of the editor in their order.
    pub(super) fn change(&mut self, version: i32, changes: Vec<TextDocumentContentChangeEvent>) {
        self.version = version;
        changes.into_iter().for_each(|change| self.text.apply(change));
        self.read();
    }

    fn read(&mut self) {
        let text = if self.is_script() && !self.is_too_long() { self.text.as_str() } else { "" };
        self.outline = Outline::of(text);
    }

    pub(super) fn is_script(&self) -> bool {
        self.path.extension().is_some_and(|extension| extension == "rhai")
    }

    pub(super) fn is_table(&self) -> bool {
        self.path.extension().is_some_and(|extension| extension == "toml")
    }

    /// True if the file is longer than the limit of commram.
    pub(super) fn is_too_long(&self) -> bool {
        let longest = if self.is_script() { input_file::LONGEST_SCRIPT } else { 1 << 20 };
        self.text.as_str().len() as u64 > longest
    }
}
