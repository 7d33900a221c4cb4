//! Translates error messages of the script engine into terms of the scenario language.

use super::spelling;
use super::verb::{Verb, verbs};
use crate::layout::did_you_mean;
use crate::plural::plural;
use rhai::{Engine, EvalAltResult, FLOAT, INT};
use std::borrow::Cow;

/// The engine's name for the type of a text, in messages about unknown calls.
const TEXT: &str = "&str | ImmutableString | String";

/// Gives number types the names of the scenario language instead of Rust names, in errors that a script catches and in
/// `type_of`.
pub(super) fn name_types(engine: &mut Engine) {
    engine.register_type_with_name::<INT>("integer").register_type_with_name::<FLOAT>("float");
}

/// Returns the message for users: replaces the internal type name that the engine prints.
pub(super) fn in_words(message: &str) -> Cow<'_, str> {
    if message.contains(TEXT) { message.replace(TEXT, "string").into() } else { message.into() }
}

/// Names of types in the engine, each with the name for messages.
const TYPES: [(&str, &str); 19] = [
    (TEXT, "a text"),
    ("string", "a text"),
    ("integer", "an integer"),
    ("i64", "an integer"),
    ("float", "a number with decimals"),
    ("f64", "a number with decimals"),
    ("bool", "a bool"),
    ("char", "a character"),
    ("array", "an array"),
    ("map", "a map"),
    ("Fn", "a function"),
    ("()", "nothing"),
    ("Block", "a function block"),
    ("Snapshot", "a snapshot"),
    ("Error", "an error"),
    ("blob", "bytes"),
    ("timestamp", "a time stamp"),
    ("range", "a range"),
    ("range=", "a range"),
];

/// Returns the name of a type of the engine in messages; other names are unchanged.
pub(super) fn kind(name: &str) -> &str {
    TYPES.iter().find(|(known, _)| *known == name).map_or(name, |(_, kind)| kind)
}

/// Returns the error without its position; `line` is the text of the script's line.
pub(super) fn complaint(error: &EvalAltResult, line: &str) -> String {
    match error {
        EvalAltResult::ErrorFunctionNotFound(signature, _) => no_function(signature),
        EvalAltResult::ErrorVariableNotFound(name, _) => spelling::mistake(line)
            .unwrap_or_else(|| format!("there is no variable `{name}`{}", with_underscores(line))),
        EvalAltResult::ErrorParsing(reason, _) => misread(reason, line),
        EvalAltResult::ErrorModuleNotFound(name, _) => format!("there is no script `{name}` to import"),
        EvalAltResult::ErrorMismatchDataType(wanted, given, _)
        | EvalAltResult::ErrorMismatchOutputType(wanted, given, _)
            if !wanted.is_empty() && !given.is_empty() =>
        {
            format!("here is {}, where {} is needed", kind(given), kind(wanted))
        }
        other => {
            let mut text = other.to_string();
            // The report shows the location separately, so the position in the engine's message is removed.
            if let Some(end) = text.rfind(" (line ") {
                text.truncate(end);
            }
            text
        }
    }
}

/// Returns the error that no function has this signature, which has the form `name (type, type)`.
fn no_function(signature: &str) -> String {
    let (name, types) = signature.split_once(" (").unwrap_or((signature, ""));
    let types = types.strip_suffix(')').unwrap_or(types);
    let given: Vec<_> = types.split(", ").filter(|ty| !ty.is_empty()).map(kind).collect();
    let is_name =
        |name: &str| name.chars().all(|letter| letter.is_alphanumeric() || letter == '_' || letter == ':');
    if !is_name(name) {
        return format!("`{name}` does not go with {}", given.join(" and "));
    }
    no_function_among(name, &given, &verbs())
}

/// Returns the error that no function has this name, or none accepts arguments of the `given` types. If the user may
/// have meant one of `verbs`, the error names it.
pub(super) fn no_function_among(name: &str, given: &[&str], verbs: &[Verb]) -> String {
    if let Some(right) = spelling::call(name) {
        return format!("there is no verb or function `{name}`; write {right}");
    }
    let near = did_you_mean(name, verbs.iter().map(|verb| verb.name));
    match given {
        [] => format!("there is no verb or function `{name}`{near}"),
        given => format!("there is no verb or function `{name}` of {}{near}", given.join(", ")),
    }
}

/// Returns the error of the parser in a line.
pub(super) fn misread(reason: &dyn core::fmt::Display, line: &str) -> String {
    spelling::mistake(line).unwrap_or_else(|| format!("{reason}{}", with_underscores(line)))
}

/// Suggests the name with underscores if a line has a verb with hyphens. The engine reads `expect-that` as a
/// subtraction, and in `wait-until` it finds the keyword `until`. Returns an empty text for other lines.
fn with_underscores(line: &str) -> String {
    let meant = verbs()
        .into_iter()
        .map(|verb| verb.name)
        .find(|name| name.contains('_') && line.contains(&name.replace('_', "-")));
    meant.map_or_else(String::new, |name| format!("; the verb is `{name}`, with `_`"))
}

/// Returns the beginning of a text of any length, in characters.
pub(super) fn cut(text: String, most: usize) -> String {
    match text.char_indices().nth(most) {
        None => text,
        Some((end, _)) => {
            let more = text[end..].chars().count();
            format!("{}... ({})", &text[..end], plural(more as u64, "more character"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_cut_between_characters() {
        assert_eq!(cut("äöü".to_owned(), 3), "äöü");
        assert_eq!(cut("äöüß!".to_owned(), 3), "äöü... (2 more characters)");
    }

    #[test]
    fn types_are_named_in_words() {
        assert_eq!(no_function("+ (integer, ())"), "`+` does not go with an integer and nothing");
        assert_eq!(no_function("a::b ()"), "there is no verb or function `a::b`");
        let message = no_function("expct (&str | ImmutableString | String, Block)");
        assert!(
            message.starts_with("there is no verb or function `expct` of a text, a function block"),
            "{message}"
        );
    }
}
