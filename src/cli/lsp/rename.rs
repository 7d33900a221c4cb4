//! All occurrences of a function in scripts: its definition, its calls, and the calls in scripts that import it.

use super::document::Document;
use super::outline::Outline;
use super::scenario::ScriptView;
use super::tokens::{Token, TokenKind};
use crate::script::check;
use core::ops::Range;
use std::path::{Path, PathBuf};

/// Maximum number of scripts in the editor's folder that are searched for imports.
const MOST_SCRIPTS: usize = 500;
/// Built-in functions with an argument that names another function.
const TAKE_NAMES: [&str; 4] = ["Fn", "is_def_fn", "after", "at"];

/// Returns the function of this script at a position: its name, and the range of the name.
pub(super) fn function_at(view: &ScriptView<'_>, offset: usize) -> Option<(String, Range<usize>)> {
    let index = view.outline.token_at(offset)?;
    let token = &view.outline.tokens.all[index];
    let range = match token.kind {
        TokenKind::Text => token.content(view.text)?,
        _ => token.range.clone(),
    };
    let name = view.text.get(range.clone())?;
    view.outline.function(name)?;
    places(view.text, view.outline, name, None).contains(&range).then(|| (name.to_owned(), range))
}

/// Returns all occurrences of the function `name` in its own script, or in a script that imports it under `alias`.
pub(super) fn places(text: &str, outline: &Outline, name: &str, alias: Option<&str>) -> Vec<Range<usize>> {
    let all = &outline.tokens.all;
    let is = |index: Option<usize>, wanted: &str| {
        index.and_then(|index| all.get(index)).is_some_and(|token| token.is(text, wanted))
    };
    let place = |(index, token): (usize, &Token)| match (token.kind, alias) {
        (TokenKind::Word, None) if token.text(text) == name => {
            let before = index.checked_sub(1);
            let is_call = is(Some(index + 1), "(") && !is(before, "::");
            // A name after `let` is a variable.
            (is_call || is(before, "fn")).then(|| token.range.clone())
        }
        (TokenKind::Word, Some(alias)) if token.text(text) == name => {
            let is_of_module = is(index.checked_sub(1), "::") && is(index.checked_sub(2), alias);
            is_of_module.then(|| token.range.clone())
        }
        (TokenKind::Text, None) => {
            let content = token.content(text).filter(|content| text.get(content.clone()) == Some(name))?;
            let call = outline.calls.iter().find(|call| {
                let within = |tokens: &Range<usize>| *tokens == (index..index + 1);
                call.arguments.iter().any(within)
            })?;
            TAKE_NAMES.contains(&all.get(call.name)?.text(text)).then_some(content)
        }
        _ => None,
    };
    all.iter().enumerate().filter_map(place).collect()
}

/// Checks the new name of a function.
///
/// # Errors
/// The script cannot have a function of this name; the error has the reason and a valid name.
pub(super) fn check_name(view: &ScriptView<'_>, name: &str) -> Result<(), String> {
    let is_name = name.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
        && name.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
    if !is_name {
        return Err(format!(
            "`{name}` is no name of a function; use letters, digits and `_`, a letter or `_` first"
        ));
    }
    let is_reserved = rhai::Engine::new_raw().compile(format!("fn {name}() {{ }}")).is_err();
    if is_reserved || check::is_of_language(name) {
        return Err(format!("`{name}` is a word of the language; use another name"));
    }
    if view.outline.function(name).is_some() || view.verbs.iter().any(|verb| verb.name == name) {
        return Err(format!("there is a verb or function `{name}` already; use another name"));
    }
    Ok(())
}

/// Returns the scripts below a folder, except hidden ones.
pub(super) fn scripts_below(root: &Path) -> Vec<PathBuf> {
    let (mut found, mut next) = (Vec::new(), vec![root.to_owned()]);
    let mut looked_at = 0;
    while let Some(directory) = next.pop().filter(|_| looked_at < MOST_SCRIPTS && found.len() < MOST_SCRIPTS)
    {
        looked_at += 1;
        let mut entries: Vec<_> = std::fs::read_dir(directory).into_iter().flatten().flatten().collect();
        entries.sort_by_key(std::fs::DirEntry::file_name);
        for entry in entries {
            let path = entry.path();
            let is_hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
            match entry.file_type() {
                Ok(kind) if kind.is_dir() && !is_hidden => next.push(path),
                Ok(kind) if kind.is_file() && path.extension().is_some_and(|it| it == "rhai") => {
                    found.push(path)
                }
                _ => {}
            }
        }
    }
    found
}

/// Returns all occurrences of a function of the script `defined` in another script that imports it.
pub(super) fn places_of_import(other: &Document, defined: &Path, name: &str) -> Vec<Range<usize>> {
    let view = ScriptView::of(other);
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let mut imports = view.outline.imports.iter();
    let import = imports.find(|import| real(&view.imported(&import.path)) == real(defined));
    let alias = import.and_then(|import| import.alias.as_deref());
    alias.map(|alias| places(view.text, view.outline, name, Some(alias))).unwrap_or_default()
}
