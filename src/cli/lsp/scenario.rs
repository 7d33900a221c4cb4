//! The meaning of a script: the purpose of the script, its plant, and the objects that its texts name.

use super::document::Document;
use super::outline::{Call, Outline};
use super::scenes::{PlantName, folder_of};
use super::tokens::{Token, TokenKind};
use crate::devices::folder::DEFINITIONS as FIRMWARE;
use crate::script::check::{ArgumentKind, is_plant_text};
use crate::script::without_dots;
use crate::script::{DEFINITIONS, Value, Verb, defined};
use core::ops::Range;
use std::path::{Path, PathBuf};

/// Purpose of a script. The purpose determines which verbs and which plant the script has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScriptKind {
    Scenario,
    /// `exercise.rhai` of a device: the verbs of a scenario, and `pass`.
    Exercise,
    /// Firmware of a device in a folder.
    Firmware,
}

impl ScriptKind {
    /// Determines the kind of a script from its path.
    pub(super) fn of(path: &Path) -> Self {
        let name = path.file_name().unwrap_or_default();
        let is_beside_device = path.parent().is_some_and(|directory| directory.join("device.toml").is_file());
        match is_beside_device {
            true if name == "exercise.rhai" => Self::Exercise,
            true => Self::Firmware,
            false => Self::Scenario,
        }
    }

    /// Returns the verbs that such a script can call.
    pub(super) fn verbs(self) -> Vec<Verb> {
        match self {
            Self::Scenario => defined(DEFINITIONS),
            Self::Exercise => defined(DEFINITIONS).into_iter().chain(defined(PASS)).collect(),
            Self::Firmware => defined(FIRMWARE),
        }
    }
}

/// The declaration of the verb that `commram soak` adds.
const PASS: &str =
    "/// Advances the clock by a number of microseconds, perhaps in several steps.\nfn pass(us: int);";

/// A text of a script that names an object of the plant, with the range between its quotes.
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

    /// Returns the name of a call.
    pub(super) fn name(&self, call: &Call) -> &'a str {
        self.outline.tokens.all.get(call.name).map_or("", |token| token.text(self.text))
    }

    /// Returns the verbs that a call may mean. Functions of modules and of the script itself are not verbs.
    pub(super) fn verbs_of(&self, call: &Call) -> Vec<&Verb> {
        let name = self.name(call);
        if call.module.is_some() || call.is_method || self.outline.function(name).is_some() {
            return Vec::new();
        }
        self.verbs.iter().filter(|verb| verb.name == name).collect()
    }

    /// Returns the parameter of the verb for an argument. If several verbs have this name, a verb with the correct number of
    /// arguments and types that fit is preferred. Returns `None` if several such verbs have different parameters here.
    pub(super) fn parameter(&self, call: &Call, argument: usize) -> Option<&'static str> {
        let verbs = self.verbs_of(call);
        let fits = verbs.iter().filter(|verb| self.fits(call, verb));
        let mut names: Vec<_> = fits.filter_map(|verb| verb.parameters.get(argument)).collect();
        names.dedup_by_key(|(name, _)| *name);
        if names.is_empty() {
            names.extend(verbs.iter().find_map(|verb| verb.parameters.get(argument)));
        }
        let [(name, _)] = names.as_slice() else { return None };
        Some(name)
    }

    /// True if the number of arguments and the types of the literal arguments are those of the verb.
    fn fits(&self, call: &Call, verb: &Verb) -> bool {
        let fits = |(tokens, (_, ty)): (&Range<usize>, &(&str, &str))| {
            let Some([token]) = self.outline.tokens.all.get(tokens.clone()) else { return true };
            match token.kind {
                TokenKind::Number => !matches!(*ty, "bool" | "String"),
                TokenKind::Text | TokenKind::Template => !matches!(*ty, "bool" | "int"),
                _ => true,
            }
        };
        verb.parameters.len() == call.arguments.len() && call.arguments.iter().zip(&verb.parameters).all(fits)
    }

    /// Returns the kind of object that an argument names.
    pub(super) fn argument_kind(&self, call: &Call, argument: usize) -> Option<ArgumentKind> {
        ArgumentKind::of(self.name(call), self.parameter(call, argument)?)
    }

    /// Returns all texts in the arguments of a verb that name an object, including the elements of arrays.
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
            // A text in the code of another text is no element of the array.
            let mut depth = 0_usize;
            let literals = literals.iter().filter(|token| {
                depth = depth.saturating_sub(usize::from(token.ends_code(self.text)));
                depth += usize::from(token.begins_code(self.text));
                depth == 0
            });
            let ranges = literals.filter_map(|token| token.content(self.text));
            Some(ranges.map(|range| NamedText { kind, range }).collect::<Vec<_>>())
        });
        texts.flatten().collect()
    }

    /// Returns the register of the call, if the script contains it as a literal text.
    pub(super) fn register_of(&self, call: &Call) -> Option<&'a str> {
        let found = self.named_texts(call).into_iter().find(|named| named.kind == ArgumentKind::Register);
        found.and_then(|named| self.text.get(named.range))
    }

    /// Returns the value of an argument with its range, if the argument is a literal number or text.
    pub(super) fn value(&self, call: &Call, argument: usize) -> Option<(Value, Range<usize>)> {
        let tokens = self.outline.tokens.all.get(call.arguments.get(argument)?.clone())?;
        let (first, token) = match tokens {
            [token] => (token, token),
            [minus, token] if minus.is(self.text, "-") && token.kind == TokenKind::Number => (minus, token),
            _ => return None,
        };
        let value = match token.kind {
            TokenKind::Number => Value::Number(number(self.text.get(first.range.start..token.range.end)?)?),
            TokenKind::Text => Value::Text(self.text.get(token.content(self.text)?)?.to_owned()),
            _ => return None,
        };
        Some((value, first.range.start..token.range.end))
    }

    /// True if the script only defines functions for other scripts: no statement outside of them acts on a plant.
    pub(super) fn is_part(&self) -> bool {
        let acts =
            |call: &Call| call.is_outside && (call.module.is_some() || !self.verbs_of(call).is_empty());
        !self.outline.functions.is_empty() && !self.outline.calls.iter().any(acts)
    }

    /// Returns the plant that the script names; `None` if the script only defines functions for scripts that name a
    /// plant.
    pub(super) fn plant(&self) -> Option<PlantName> {
        let mut calls = self.outline.calls.iter();
        let named = calls.find(|call| self.name(call) == "plant" && !self.verbs_of(call).is_empty());
        if let Some(call) = named {
            // If the script computes the name of the plant, the server cannot determine it.
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
            return Some(PlantName::Text { text: text.to_owned(), directory: self.directory() });
        }
        (!text.is_empty()).then(|| PlantName::File(without_dots(&self.directory().join(text))))
    }

    /// If the script belongs to the firmware of a device, returns the folder of the device and the name of the script.
    pub(super) fn part_of_firmware(&self) -> Option<(&'a Path, &'a str)> {
        let is_firmware = self.kind == ScriptKind::Firmware;
        Some((self.path.parent()?, self.path.file_name()?.to_str()?)).filter(|_| is_firmware)
    }

    /// Returns the directory to which paths in the script are relative.
    pub(super) fn directory(&self) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).to_owned()
    }

    /// Returns the path of the imported script. A script that only defines functions can also import a script by its path
    /// from the directory of the scenario, which the server searches in the directories above.
    pub(super) fn imported(&self, path: &Range<usize>) -> PathBuf {
        let path = self.text.get(path.clone()).unwrap_or_default();
        let directory = self.directory();
        let at = |directory: &Path| without_dots(&directory.join(path)).with_extension("rhai");
        let beside = at(&directory);
        if path.is_empty() || beside.is_file() || self.kind != ScriptKind::Scenario || !self.is_part() {
            return beside;
        }
        let mut above = directory.ancestors().skip(1).map(at);
        above.find(|file| file.is_file()).unwrap_or(beside)
    }

    /// Returns the file of the module in a call `module::name(...)`.
    pub(super) fn module_file(&self, call: &Call) -> Option<PathBuf> {
        let alias = self.outline.tokens.all.get(call.module?)?.text(self.text);
        let import = self.outline.imports.iter().find(|import| import.alias.as_deref() == Some(alias))?;
        Some(self.imported(&import.path))
    }
}

/// Parses a number in the syntax of the language, with or without a sign.
fn number(text: &str) -> Option<i64> {
    if let Some(digits) = text.strip_prefix('-') {
        return number(digits.trim_start())?.checked_neg();
    }
    let digits = text.replace('_', "");
    let radix = |prefix: &str, radix| {
        digits.strip_prefix(prefix).and_then(|rest| i64::from_str_radix(rest, radix).ok())
    };
    radix("0x", 16).or_else(|| radix("0b", 2)).or_else(|| radix("0o", 8)).or_else(|| digits.parse().ok())
}
