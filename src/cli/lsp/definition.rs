//! The definition of a name: a line in a device's folder, an imported script, or a function.

use super::outline::Outline;
use super::scenario::ScriptView;
use super::scenes::Scene;
use super::text::Text;
use crate::devices::folder::in_slot;
use crate::layout::{DeviceFit, RegisterRef, split_plc};
use crate::script::check::ArgumentKind;
use crate::script::without_dots;
use core::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// A range in a file.
pub(super) struct Target {
    /// Path of the file; `None` for the script itself.
    pub(super) path: Option<PathBuf>,
    pub(super) range: lsp_types::Range,
}

/// Returns the definition of the name at a position.
pub(super) fn at(
    view: &ScriptView<'_>,
    document: &Text,
    scene: Option<&mut Scene>,
    read: &dyn Fn(&Path) -> Option<String>,
    offset: usize,
) -> Option<Target> {
    let outline = view.outline;
    let token = &outline.tokens.all[outline.token_at(offset)?];
    if let Some(import) = outline.imports.iter().find(|import| is_within(&import.path, offset)) {
        return begin_of(view.imported(&import.path));
    }
    let name = token.content(view.text).map_or(token.text(view.text), |content| &view.text[content]);
    if let Some(call) = outline.calls.iter().find(|call| outline.tokens.all[call.name] == *token) {
        if call.module.is_some() {
            let file = view.module_file(call)?;
            let text = read(&file)?;
            let at = Outline::of(&text).function(name)?.at.clone();
            return Some(Target { path: Some(file), range: Text::new(text).range(&at) });
        }
        let function = outline.function(name)?;
        return Some(Target { path: None, range: document.range(&function.at) });
    }
    let mut named = outline.calls.iter().flat_map(|call| view.named_texts(call));
    if let Some(named) = named.find(|named| is_within(&named.range, offset)) {
        return match named.kind {
            ArgumentKind::Register | ArgumentKind::Registers | ArgumentKind::RegisterOrArea => {
                register(scene?, view.text.get(named.range)?)
            }
            ArgumentKind::Plant => {
                begin_of(without_dots(&view.directory().join(view.text.get(named.range)?)))
            }
            _ => None,
        };
    }
    let function = outline.function(name)?;
    Some(Target { path: None, range: document.range(&function.at) })
}

fn is_within(range: &Range<usize>, offset: usize) -> bool {
    range.start <= offset && offset <= range.end
}

fn begin_of(path: PathBuf) -> Option<Target> {
    path.is_file().then(|| Target { path: Some(path), range: lsp_types::Range::default() })
}

/// Returns the line that defines a register, in the files of its device's folder.
fn register(scene: &mut Scene, text: &str) -> Option<Target> {
    let (plc, name) = split_plc(text);
    let find = |(_, fitted): (String, DeviceFit)| {
        let found = fitted.register(name).ok()?;
        Some((in_slot::card_of(fitted.device(), found.area.name), found))
    };
    let (card, found) = scene.scope.each(text).into_iter().find_map(find)?;
    // A name without a prefix is valid only if there is one PLC, so the first PLC is meant.
    let plc = plc.map_or_else(|| scene.bench.names().plcs.first().cloned(), |plc| Some(plc.to_owned()))?;
    let read = |dir: &PathBuf| commram_layoutc::read_folder(dir).ok();
    let layout = match card {
        None => read(scene.folders.get(&plc)?)?,
        Some(card) => scene.folders.values().filter_map(read).find(|it| it.device.name == card.name)?,
    };
    in_files(&layout.inputs, &found)
}

/// Returns the line that defines a register, in the files of a layout. The register's structure is searched first, then
/// other structures and blocks with a register of this name.
pub(super) fn in_files(inputs: &[(PathBuf, String)], register: &RegisterRef) -> Option<Target> {
    let (structure, wanted) = (register.structure().name, register.register.name);
    let entries = inputs.iter().flat_map(|(path, text)| {
        let table = DeTable::parse(text).map(|table| names_of(table.get_ref())).unwrap_or_default();
        table.into_iter().map(move |(owner, name, range)| (owner, name, path, text, range))
    });
    let mut entries: Vec<_> = entries.filter(|(_, name, ..)| name == wanted).collect();
    entries.sort_by_key(|(owner, ..)| owner != structure);
    let (_, _, path, text, range) = entries.into_iter().next()?;
    Some(Target { path: Some(path.clone()), range: Text::new(text.clone()).range(&range) })
}

/// Returns the names of all registers in a file: for each, the structure, the name, and the range of bytes.
fn names_of(table: &DeTable<'_>) -> Vec<(String, String, Range<usize>)> {
    let text_at = |table: &DeTable<'_>, key: &str| {
        table.get(key).and_then(|it| it.get_ref().as_str().map(str::to_owned))
    };
    let mut found = Vec::new();
    let own = text_at(table, "name").unwrap_or_default();
    for (key, value) in table {
        for element in value.get_ref().as_array().into_iter().flat_map(|array| array.iter()) {
            let DeValue::Table(inner) = element.get_ref() else { continue };
            if key.get_ref() == "register" {
                let name = inner
                    .get("name")
                    .and_then(|name| Some((name.get_ref().as_str()?.to_owned(), name.span())));
                found.extend(name.map(|(name, span)| (own.clone(), name, span)));
            } else {
                found.extend(names_of(inner));
            }
        }
    }
    found
}
