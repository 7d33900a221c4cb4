//! Links in a document: from a section or kind to its page, and from a name of a file or folder to the file. Only files
//! that exist are linked (D-875).

use super::document::Document;
use super::outline::Outline;
use super::pages::{PagePlace, Pages};
use super::scenario::ScriptView;
use super::table::header_of;
use super::tables::TableKind;
use crate::devices::folder;
use crate::script::check::{ArgumentKind, is_plant_text};
use crate::script::without_dots;
use core::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::{DeArray, DeTable, DeValue};

/// A link from a range of bytes to a place in a file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Link {
    pub(super) range: Range<usize>,
    pub(super) target: PagePlace,
}

impl Link {
    fn to_file(range: Range<usize>, file: PathBuf) -> Option<Self> {
        let file = without_dots(&file);
        file.is_file().then_some(Link { range, target: PagePlace { file, line: None } })
    }
}

/// Returns the links in a TOML file.
pub(super) fn of_table(document: &Document, kind: &TableKind, pages: &Pages) -> Vec<Link> {
    let text = document.text.as_str();
    let directory = document.path.parent().unwrap_or(Path::new(""));
    let to_page = |range, target: Option<PagePlace>| Some(Link { range, target: target? });
    let sections = sections(text).into_iter();
    let mut found: Vec<_> =
        sections.filter_map(|(range, section)| to_page(range, pages.of_section(kind, &section))).collect();
    // The parser also returns what it has read of an incomplete file.
    let (table, _) = DeTable::parse_recoverable(text);
    let mut texts = Vec::new();
    texts_of_table(table.get_ref(), "", text, &mut texts);
    for Named { key, value, range } in texts {
        let link = match (kind, key.as_str()) {
            (TableKind::Plant, "device.kind") => device_folder(directory, &value)
                .and_then(|folder| Link::to_file(range.clone(), folder.join("device.toml")))
                .or_else(|| to_page(range, pages.of_kind(&value))),
            (TableKind::Plant, "plc.option.card" | "device.option.card") => device_folder(directory, &value)
                .and_then(|folder| Link::to_file(range, folder.join("device.toml"))),
            (TableKind::Plant, "device.module.kind" | "bus.kind") => to_page(range, pages.of_kind(&value)),
            (TableKind::Plant, "fault.kind") => to_page(range, pages.of_fault(&value)),
            (TableKind::Layout(folder), "structures" | "area.structure.name") => {
                Link::to_file(range, folder.join(format!("{value}.toml")))
            }
            (TableKind::Layout(folder), "family") => {
                Link::to_file(range, folder.join("..").join(&value).join("family.toml"))
            }
            (TableKind::Layout(folder), "parts" | "objects" | "gsd") => {
                Link::to_file(range, folder.join(&value))
            }
            _ => None,
        };
        found.extend(link);
    }
    found
}

/// Returns the links in a script: to its plant, and to the scripts that it imports.
pub(super) fn of_script(view: &ScriptView<'_>) -> Vec<Link> {
    let Outline { imports, calls, .. } = view.outline;
    let imported = imports.iter().filter_map(|it| Link::to_file(it.path.clone(), view.imported(&it.path)));
    let named = calls.iter().flat_map(|call| view.named_texts(call));
    let plants = named.filter(|named| named.kind == ArgumentKind::Plant).filter_map(|named| {
        let name = view.text.get(named.range.clone()).filter(|name| !is_plant_text(name))?;
        Link::to_file(named.range, view.directory().join(name))
    });
    imported.chain(plants).collect()
}

/// Returns the folder that the key `kind` of a device names: a path with `/`, or a name in the search path.
fn device_folder(directory: &Path, kind: &str) -> Option<PathBuf> {
    if kind.contains('/') { Some(directory.join(kind)) } else { folder::search(kind) }
}

/// Returns the headers of a file: for each, its range and the names in it, joined by dots.
fn sections(text: &str) -> Vec<(Range<usize>, String)> {
    let mut at = 0;
    let mut found = Vec::new();
    for line in text.split_inclusive('\n') {
        if let Some(names) = header_of(line) {
            let header = line.split('#').next().unwrap_or_default();
            let start = at + header.len() - header.trim_start().len();
            let end = start + header.trim().len();
            found.push((start..end, names.join(".")));
        }
        at += line.len();
    }
    found
}

/// A text value of a TOML file.
struct Named {
    /// Names of the tables around the value and its key, joined by dots.
    key: String,
    value: String,
    /// Range between the quotes.
    range: Range<usize>,
}

fn texts_of_table(table: &DeTable<'_>, prefix: &str, text: &str, found: &mut Vec<Named>) {
    for (key, value) in table {
        let name = key.get_ref();
        let key = if prefix.is_empty() { name.to_string() } else { format!("{prefix}.{name}") };
        texts_of_value(value, &key, text, found);
    }
}

fn texts_of_value(value: &toml::Spanned<DeValue<'_>>, key: &str, text: &str, found: &mut Vec<Named>) {
    match value.get_ref() {
        DeValue::String(content) => {
            let Range { start, end } = value.span();
            // Escapes and texts of several lines are not names of files or kinds.
            let inner = start + 1..end.saturating_sub(1);
            if text.get(inner.clone()) == Some(&**content) {
                found.push(Named { key: key.to_owned(), value: content.to_string(), range: inner });
            }
        }
        DeValue::Array(array) => texts_of_array(array, key, text, found),
        DeValue::Table(table) => texts_of_table(table, key, text, found),
        _ => {}
    }
}

fn texts_of_array(array: &DeArray<'_>, key: &str, text: &str, found: &mut Vec<Named>) {
    array.iter().for_each(|value| texts_of_value(value, key, text, found));
}
