//! Translates errors of the TOML reader into terms of a plant file: keys, and ranges of numbers.

use crate::layout::did_you_mean;
use core::ops::Range;

/// Names of types in messages of the reader, each with a description for users.
const TYPES: &[(&str, &str)] = &[
    ("u8", "a whole number from 0 to 255"),
    ("u16", "a whole number from 0 to 65535"),
    ("u32", "a whole number from 0 to 4294967295"),
    ("u64", "a whole number, 0 or more"),
    ("usize", "a whole number, 0 or more"),
    ("i8", "a whole number from -128 to 127"),
    ("i16", "a whole number from -32768 to 32767"),
    ("i32", "a whole number from -2147483648 to 2147483647"),
    ("i64", "a whole number"),
    ("f32", "a number"),
    ("f64", "a number"),
    ("a boolean", "true or false"),
    ("a sequence", "a list in brackets"),
];

/// A section, for messages about its keys.
pub(super) struct Section {
    /// Name of the section, as between the double brackets.
    pub name: &'static str,
    /// Keys that are removed before the section is parsed. The messages of the parser therefore do not list
    /// them.
    pub before: &'static [&'static str],
    /// Ranges of the section's keys in the text, without the keys of inner tables.
    pub keys: Vec<Range<usize>>,
}

/// Describes an error of the reader. `place` is its range in `text`.
pub(super) fn describe(message: &str, text: &str, place: Option<Range<usize>>, section: &Section) -> String {
    if let Some((key, known)) = unknown_key(message) {
        let is_own = place.as_ref().is_some_and(|place| section.keys.contains(place));
        let before = if is_own { section.before } else { &[] };
        let known: Vec<_> = before.iter().copied().chain(known).collect();
        let of = match is_own {
            true => format!("; the keys of [[{}]] are: ", section.name),
            false => "; the keys here are: ".to_owned(),
        };
        let hint = did_you_mean(key, known.iter().copied());
        return format!("unknown field `{key}`{hint}{of}{}", known.join(", "));
    }
    let Some((front, expected)) = message.rsplit_once("expected ") else { return message.to_owned() };
    let Some((_, right)) = TYPES.iter().find(|(name, _)| *name == expected) else {
        return message.to_owned();
    };
    let key = place.and_then(|place| key_before(text, place.start));
    let key = key.map(|key| format!("{key}: ")).unwrap_or_default();
    format!("{key}{front}expected {right}")
}

/// Returns the unknown key of a message, and the known keys.
fn unknown_key(message: &str) -> Option<(&str, Vec<&str>)> {
    let rest = message.strip_prefix("unknown field `")?;
    let (key, rest) = rest.split_once('`')?;
    // The message encloses each name in backquotes, so every second part is a name.
    Some((key, rest.split('`').skip(1).step_by(2).collect()))
}

/// Returns the key of the value that begins at `start`.
fn key_before(text: &str, start: usize) -> Option<&str> {
    let before = text.get(..start)?.trim_end().strip_suffix('=')?.trim_end();
    let is_key = |sign: char| sign.is_ascii_alphanumeric() || matches!(sign, '_' | '-' | '.');
    let key = &before[before.trim_end_matches(is_key).len()..];
    (!key.is_empty()).then_some(key)
}
