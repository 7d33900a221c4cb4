//! Finds the errors in a script. The messages are those of the engine and of the verbs.

use super::document::Document;
use super::outline::{Call, Outline};
use super::scenario::{ScriptKind, ScriptView};
use super::scenes::Scene;
use crate::input_file;
use crate::layout::did_you_mean;
use crate::script::check::{self, ArgumentKind, Checker};
use core::ops::Range;
use lsp_types::{Diagnostic, DiagnosticSeverity};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Maximum number of errors that are shown for a document.
const MOST: usize = 200;

/// An error at some bytes of a document.
pub(super) struct Mistake {
    pub(super) range: Range<usize>,
    pub(super) severity: DiagnosticSeverity,
    pub(super) what: String,
}

impl Mistake {
    pub(super) fn error(range: Range<usize>, what: impl Into<String>) -> Self {
        Self { range, severity: DiagnosticSeverity::ERROR, what: what.into() }
    }

    pub(super) fn warning(range: Range<usize>, what: impl Into<String>) -> Self {
        Self { range, severity: DiagnosticSeverity::WARNING, what: what.into() }
    }

    /// Converts the error to a diagnostic of the Language Server Protocol.
    pub(super) fn shown(self, document: &Document) -> Diagnostic {
        let Self { range, severity, what } = self;
        Diagnostic {
            range: document.text.range(&range),
            severity: Some(severity),
            source: Some("commram".to_owned()),
            message: what,
            ..Diagnostic::default()
        }
    }
}

/// Data for the check of a script.
pub(super) struct Judge<'a> {
    pub(super) view: &'a ScriptView<'a>,
    pub(super) checker: &'a Checker,
    /// The plant of the script; `None` if the script does not determine its plant, or if the plant was refused.
    pub(super) scene: Option<&'a mut Scene>,
    /// The error message, if the plant was refused.
    pub(super) refusal: Option<String>,
    /// Function that returns the text of another script.
    pub(super) read: &'a dyn Fn(&Path) -> Option<String>,
}

impl Judge<'_> {
    /// Returns all errors, in no particular order.
    pub(super) fn mistakes(&mut self, document: &Document) -> Vec<Mistake> {
        let mut found = self.misreadings(document);
        if self.view.kind != ScriptKind::Firmware {
            let refusal = self.refusal.take();
            found.extend(refusal.map(|what| Mistake::error(self.plant_range(document), what)));
        }
        found.extend(self.imports());
        // Scripts repeat registers and times, so each text is checked only once.
        let mut judged = BTreeMap::new();
        let mut modules = BTreeMap::new();
        for call in &self.view.outline.calls {
            found.extend(self.call(call, &mut modules));
            found.extend(self.arguments(call, &mut judged));
            if found.len() >= MOST {
                break;
            }
        }
        found.truncate(MOST);
        found
    }

    /// Returns the error of the parser. If a `${` is not closed, the parser reports the error at a later place, so the
    /// result is the place of the `${`.
    fn misreadings(&self, document: &Document) -> Vec<Mistake> {
        let Some(misreading) = self.misreading(document) else { return Vec::new() };
        let unclosed = &self.view.outline.tokens.unclosed;
        let is_earlier = unclosed.first().is_none_or(|code| misreading.range.end <= code.start);
        let missing = |code: &Range<usize>| {
            Mistake::error(
                code.start..code.start + 2,
                "the code in this text does not end; write `}` after it",
            )
        };
        is_earlier.then_some(misreading).into_iter().chain(unclosed.iter().map(missing)).collect()
    }

    /// Returns the error of the parser.
    fn misreading(&self, document: &Document) -> Option<Mistake> {
        let check::Misreading { line, column, what } = self.checker.misreading(self.view.text)?;
        let whole = document.text.line(line);
        let range = match (line, column) {
            (Some(line), Some(column)) => {
                let at = document.text.byte_at(line, column);
                let token = self
                    .view
                    .outline
                    .token_at(at)
                    .map(|token| self.view.outline.tokens.all[token].range.clone());
                token.filter(|token| token.start >= whole.start && token.end <= whole.end.max(at))
            }
            _ => None,
        };
        Some(Mistake::error(range.unwrap_or(whole), what))
    }

    /// Returns the range where an error of the plant is shown: the argument of the verb `plant`, otherwise the first
    /// line.
    fn plant_range(&self, document: &Document) -> Range<usize> {
        let mut calls = self.view.outline.calls.iter();
        let call = calls.find(|call| self.view.name(call) == "plant" && !self.view.verbs_of(call).is_empty());
        let token = call.and_then(|call| self.view.outline.tokens.all.get(call.arguments.first()?.start));
        // If the plant is written in the script, only its first line is marked.
        let first = token.map(|token| {
            let length = token.text(self.view.text).lines().next().unwrap_or_default().len();
            token.range.start..token.range.start + length
        });
        first.unwrap_or_else(|| document.text.line(Some(1)))
    }

    fn imports(&self) -> Vec<Mistake> {
        let missing = |import: &super::outline::Import| {
            let name = self.view.text.get(import.path.clone())?;
            let is_missing = !name.is_empty() && (self.read)(&self.view.imported(&import.path)).is_none();
            let what = format!("there is no script `{name}` to import");
            is_missing.then(|| Mistake::error(import.path.clone(), what))
        };
        self.view.outline.imports.iter().filter_map(missing).chain(self.namesake()).collect()
    }

    /// Returns the error of functions that this script and imported ones would mix up, at the import that leads to them.
    fn namesake(&self) -> Option<Mistake> {
        let view = self.view;
        // The check of the device's folder finds those of a firmware.
        if view.kind == ScriptKind::Firmware || view.outline.imports.is_empty() {
            return None;
        }
        let found = self.checker.namesakes(view.path, view.text, self.read)?;
        let mut imports = view.outline.imports.iter();
        let import = imports.find(|import| view.text.get(import.path.clone()) == Some(&found.path))?;
        Some(Mistake::error(import.path.clone(), found.what))
    }

    /// Returns the error in the name of a call, or in the number of its arguments. `modules` caches imported scripts.
    fn call(&self, call: &Call, modules: &mut BTreeMap<PathBuf, Option<Outline>>) -> Option<Mistake> {
        let view = self.view;
        let name = view.name(call);
        let at = view.outline.tokens.all.get(call.name)?.range.clone();
        if call.is_method {
            return None;
        }
        if call.module.is_some() {
            let file = view.module_file(call)?;
            let read = || (self.read)(&file).map(|text| Outline::of(&text));
            let outline = modules.entry(file.clone()).or_insert_with(read).as_ref()?;
            if outline.function(name).is_some() {
                return None;
            }
            let near = did_you_mean(name, outline.functions.iter().map(|function| function.name.as_str()));
            let file = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            return Some(Mistake::error(at, format!("{file} has no function `{name}`{near}")));
        }
        let verbs = view.verbs_of(call);
        if !verbs.is_empty() {
            let verbs: Vec<_> = verbs.into_iter().cloned().collect();
            let what =
                check::argument_count(&verbs, name, call.arguments.len()).filter(|_| call.is_closed)?;
            return Some(Mistake::error(at, what));
        }
        let is_own = view.outline.function(name).is_some() || view.outline.variables.contains(name);
        // The engine for firmware has other verbs than the engine for scenarios. Both engines have the keywords of the
        // language.
        let is_known = match view.kind {
            ScriptKind::Firmware => self.checker.knows(name) && !is_verb_of_scenarios(name),
            _ => self.checker.knows(name),
        };
        (!is_own && !is_known).then(|| Mistake::error(at, check::unknown_function(name, &view.verbs)))
    }

    /// Returns the errors in the texts and values of a call.
    fn arguments<'t>(
        &mut self,
        call: &Call,
        judged: &mut BTreeMap<(ArgumentKind, &'t str), Option<String>>,
    ) -> Vec<Mistake>
    where
        Self: 't,
    {
        let view = self.view;
        let Some(scene) = self.scene.as_deref_mut() else { return Vec::new() };
        if view.kind == ScriptKind::Firmware {
            return Vec::new();
        }
        let mut found = Vec::new();
        for named in view.named_texts(call) {
            let Some(text) = view.text.get(named.range.clone()) else { continue };
            let refused = judged.entry((named.kind, text)).or_insert_with(|| {
                check::argument(&mut scene.bench, named.kind, text).err().map(|error| error.to_string())
            });
            found.extend(refused.clone().map(|what| Mistake::error(named.range, what)));
        }
        let has_kind_value =
            |argument: &usize| view.argument_kind(call, *argument) == Some(ArgumentKind::Value);
        let is_pattern = (0..call.arguments.len()).any(|at| view.parameter(call, at) == Some("mask"));
        let arguments = (0..call.arguments.len()).filter(has_kind_value);
        let values: Vec<_> = arguments.filter_map(|argument| view.value(call, argument)).collect();
        if values.is_empty() {
            return found;
        }
        let place = view.register_of(call).and_then(|register| scene.bench.find(register).ok());
        let refused = |(value, range)| {
            let what = check::refused_value(place.as_ref()?.place(), &value, is_pattern)?;
            Some(Mistake::error(range, what))
        };
        found.extend(values.into_iter().filter_map(refused));
        found
    }
}

fn is_verb_of_scenarios(name: &str) -> bool {
    crate::script::verbs().iter().any(|verb| verb.name == name)
}

/// Returns the error for a file beyond the limit of the checker.
pub(super) fn too_long(document: &Document) -> Mistake {
    let most = input_file::LONGEST_SCRIPT >> 10;
    let what = match document.is_script() {
        true => format!("a script has at most {most} KiB; import a part of it"),
        false => "the file is too long to be checked while it is edited: 1 MiB at most".to_owned(),
    };
    Mistake::warning(document.text.line(Some(1)), what)
}
