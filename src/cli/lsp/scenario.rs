//! What a script means: its plant, and the meaning of its texts.

use super::document::Document;
use super::outline::{Call, Outline};
use super::place::without_dots;
use super::scenes::{PlantName, folder_of};
use super::tokens::{Token, TokenKind};
use crate::devices::folder::DEFINITIONS as FIRMWARE;
use crate::script::check::{ArgumentKind, is_plant_text};
use crate::script::{DEFINITIONS, Value, Verb, defined};
use core::ops::Range;
use std::path::{Path, PathBuf};

/// Purpose of a script. It decides which verbs and which plant the script has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScriptKind {
    Scenario,
    /// `exercise.rhai` of a device: the verbs of a scenario, and `pass`.
    Exercise,
    /// Firmware of a device in a folder.
    Firmware,
}

impl ScriptKind {
    /// The kind of the script in a file.
    pub(super) fn of(path: &Path) -> Self {
        let name = path.file_name().unwrap_or_default();
        let is_beside_device = path.parent().is_some_and(|directory| directory.join("device.toml").is_file());
        match is_beside_device {
            true if name == "exercise.rhai" => Self::Exercise,
            true => Self::Firmware,
            false => Self::Scenario,
        }
    }

    /// The verbs that such a script can call.
    pub(super) fn verbs(self) -> Vec<Verb> {
        match self {
            Self::Scenario => defined(DEFINITIONS),
            Self::Exercise => defined(DEFINITIONS).into_iter().chain(defined(PASS)).collect(),
            Self::Firmware => defined(FIRMWARE),
        }
    }
}

/// The verb that `commram soak` adds.
const PASS: &str =
    "/// Advances the clock by a number of microseconds, perhaps in several steps.\nfn pass(us: int);";

/// A text of a script that names something, with the bytes between its quotes.
pub(super) struct NamedText {
    pub(super) kind: ArgumentKind,
    pub(super) range: Range<usize>,
}

/// A script with the data for its check.
pub(super) struct ScriptView<'a> {
    pub(super) text: &'a str,
    pub(super) outline: &'a Outline,
    pub(super) kind: ScriptKind,
    pub(super) verbs: Vec<Verb>,
    pub(super) path: &'a Path,
}

impl<'a> ScriptView<'a> {
    pub(super) fn of(document: &'a Document) -> Self {
        let kind = ScriptKind::of(&document.path);
        let (text, outline, path) = (document.text.as_str(), &document.outline, document.path.as_path());
        Self { text, outline, kind, verbs: kind.verbs(), path }
    }

    /// The name of a call.
    pub(super) fn name(&self, call: &Call) -> &'a str {
        self.outline.tokens.all.get(call.name).map_or("", |token| token.text(self.text))
    }

    /// The verbs that a call may mean: none for functions of modules and of the script itself.
    pub(super) fn verbs_of(&self, call: &Call) -> Vec<&Verb> {
        let name = self.name(call);
        if call.module.is_some() || call.is_method || self.outline.function(name).is_some() {
            return Vec::new();
        }
        self.verbs.iter().filter(|verb| verb.name == name).collect()
    }

    /// Returns the parameter of the verb for an argument. If several verbs have this name, the verb with the correct
    /// number of arguments is preferred.
    pub(super) fn parameter(&self, call: &Call, argument: usize) -> Option<&'static str> {
        let verbs = self.verbs_of(call);
        let fits = verbs.iter().find(|verb| verb.parameters.len() == call.arguments.len());
        let verb = fits.into_iter().chain(&verbs).find(|verb| verb.parameters.len() > argument)?;
        verb.parameters.get(argument).map(|(name, _)| *name)
    }

    /// What an argument names.
    pub(super) fn argument_kind(&self, call: &Call, argument: usize) -> Option<ArgumentKind> {
        ArgumentKind::of(self.name(call), self.parameter(call, argument)?)
    }

    /// All texts in the arguments of verbs that name something, also the elements of arrays.
    pub(super) fn named_texts(&self, call: &Call) -> Vec<NamedText> {
        let texts = (0..).zip(&call.arguments).filter_map(|(argument, tokens)| {
            let kind = self.argument_kind(call, argument)?;
            let tokens = self.outline.tokens.all.get(tokens.clone())?;
            let is_array = tokens.first().is_some_and(|token| token.is(self.text, "["));
            let literals: &[Token] = match (tokens, kind) {
                (_, ArgumentKind::Registers | ArgumentKind::Value | ArgumentKind::Rules) if is_array => {
                    tokens
                }
                ([_], _) => tokens,
                _ => &[],
            };
            let ranges = literals.iter().filter_map(|token| token.content(self.text));
            Some(ranges.map(|range| NamedText { kind, range }).collect::<Vec<_>>())
        });
        texts.flatten().collect()
    }

    /// The text of the call's register, if it is written there.
    pub(super) fn register_of(&self, call: &Call) -> Option<&'a str> {
        let found = self.named_texts(call).into_iter().find(|named| named.kind == ArgumentKind::Register);
        found.and_then(|named| self.text.get(named.range))
    }

    /// The value that an argument is, with its bytes, if it is a number or text.
    pub(super) fn value(&self, call: &Call, argument: usize) -> Option<(Value, Range<usize>)> {
        let tokens = self.outline.tokens.all.get(call.arguments.get(argument)?.clone())?;
        let [token] = tokens else { return None };
        let value = match token.kind {
            TokenKind::Number => Value::Number(number(token.text(self.text))?),
            TokenKind::Text => Value::Text(self.text.get(token.content(self.text)?)?.to_owned()),
            _ => return None,
        };
        Some((value, token.range.clone()))
    }

    /// True if the script only shares functions: nothing outside of them acts on a plant.
    pub(super) fn is_part(&self) -> bool {
        let acts =
            |call: &Call| call.is_outside && (call.module.is_some() || !self.verbs_of(call).is_empty());
        !self.outline.functions.is_empty() && !self.outline.calls.iter().any(acts)
    }

    /// The plant that the script names; `None` if it shares functions with scripts that name one.
    pub(super) fn plant(&self) -> Option<PlantName> {
        let mut calls = self.outline.calls.iter();
        let named = calls.find(|call| self.name(call) == "plant" && !self.verbs_of(call).is_empty());
        if let Some(call) = named {
            // A name that the script computes is not known here.
            let token = self.outline.tokens.all.get(call.arguments.first()?.start)?;
            return self.plant_named(self.text.get(token.content(self.text)?)?);
        }
        if self.kind != ScriptKind::Scenario || folder_of(self.path).is_some() {
            return folder_of(self.path).map(PlantName::Device);
        }
        (!self.is_part()).then_some(PlantName::BuiltIn)
    }

    fn plant_named(&self, text: &str) -> Option<PlantName> {
        if is_plant_text(text) {
            return Some(PlantName::Text(text.to_owned()));
        }
        (!text.is_empty()).then(|| PlantName::File(without_dots(&self.directory().join(text))))
    }

    /// The folder and the name of a script of a device's firmware.
    pub(super) fn part_of_firmware(&self) -> Option<(&'a Path, &'a str)> {
        let is_firmware = self.kind == ScriptKind::Firmware;
        Some((self.path.parent()?, self.path.file_name()?.to_str()?)).filter(|_| is_firmware)
    }

    /// The directory from which the script names files.
    pub(super) fn directory(&self) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).to_owned()
    }

    /// The file that an import names.
    pub(super) fn imported(&self, path: &Range<usize>) -> PathBuf {
        let path = self.directory().join(self.text.get(path.clone()).unwrap_or_default());
        without_dots(&path).with_extension("rhai")
    }

    /// The file of the module of a call `module::name(...)`.
    pub(super) fn module_file(&self, call: &Call) -> Option<PathBuf> {
        let alias = self.outline.tokens.all.get(call.module?)?.text(self.text);
        let import = self.outline.imports.iter().find(|import| import.alias.as_deref() == Some(alias))?;
        Some(self.imported(&import.path))
    }
}

/// A number of the language.
fn number(text: &str) -> Option<i64> {
    let digits = text.replace('_', "");
    let radix = |prefix: &str, radix| {
        digits.strip_prefix(prefix).and_then(|rest| i64::from_str_radix(rest, radix).ok())
    };
    radix("0x", 16).or_else(|| radix("0b", 2)).or_else(|| radix("0o", 8)).or_else(|| digits.parse().ok())
}
