//! An error in a script: its place and its description.

use super::budget::{Exceeded, LONGEST_TIME, MOST_OPERATIONS};
use super::engine::{most_elements, most_entries, most_texts, too_deep};
use crate::layout::DeviceLayout;
use crate::plain_text::without_interpreted;
use crate::plc_spelling::Dialect;
use core::fmt;
use rhai::{EvalAltResult, ParseError, ParseErrorType};

/// Longest description in bytes.
const LONGEST: usize = 160;

/// The reason why a script is refused or has stopped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Mistake {
    /// Name of the file in the folder.
    pub(super) file: String,
    /// Line of the mistake, from 1; `None` if the line is not known.
    pub(super) line: Option<usize>,
    /// Description of the error.
    pub(super) what: String,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}: {}", self.file, self.what),
            None => write!(f, "{}: {}", self.file, self.what),
        }
    }
}

impl Mistake {
    /// Returns an error that is not about a particular line.
    pub(super) fn new(what: impl Into<String>) -> Self {
        Mistake { file: super::MAIN.to_owned(), line: None, what: what.into() }
    }

    /// Returns an error for a text that is not a script.
    pub(super) fn misread(file: &str, text: &str, layout: &'static DeviceLayout, error: &ParseError) -> Self {
        let line = error.position().line();
        let hint = line.and_then(|line| text.lines().nth(line - 1)).and_then(|line| spelled(line, layout));
        let what = hint.unwrap_or_else(|| match error.err_type() {
            ParseErrorType::ExprTooDeep => too_deep(),
            other => other.to_string(),
        });
        Mistake { file: file.to_owned(), line, what: shortened(what) }
    }

    /// Returns an error of a running script. Its line is that of the innermost call.
    pub(super) fn ran(error: &EvalAltResult) -> Self {
        let (mut file, mut line) = (super::MAIN.to_owned(), error.position().line());
        let mut at = error;
        while let EvalAltResult::ErrorInFunctionCall(_, source, inner, _)
        | EvalAltResult::ErrorInModule(source, inner, _) = at
        {
            if !source.is_empty() {
                file.clone_from(source);
            }
            line = inner.position().line().or(line);
            at = inner;
        }
        Mistake { file, line, what: shortened(description(at)) }
    }
}

/// Finds the first spelling of a PLC language in a line, and names the right spelling.
fn spelled(line: &str, layout: &'static DeviceLayout) -> Option<String> {
    let is_register = |word: &str| layout.target(word).is_ok();
    let is_verb = |word: &str| super::verbs::NAMES.contains(&word);
    let store = "write(\"register\", value)";
    Dialect { store, is_register: &is_register, is_verb: &is_verb }.mistake(line)
}

/// Returns the error without its position.
fn description(error: &EvalAltResult) -> String {
    match error {
        EvalAltResult::ErrorTerminated(reason, _) => match reason.clone().try_cast::<Exceeded>() {
            Some(Exceeded::Stack) => "calls are nested too deep here".to_owned(),
            Some(Exceeded::Time) => format!(
                "the script is too slow: it takes more than {} s of processor time within a millisecond",
                LONGEST_TIME.as_secs()
            ),
            _ => format!("the script does not end: it takes more than {} steps", MOST_OPERATIONS),
        },
        EvalAltResult::ErrorRuntime(thrown, _) => thrown.to_string(),
        EvalAltResult::ErrorFunctionNotFound(signature, _) => {
            let (name, types) = signature.split_once(" (").unwrap_or((signature, ""));
            if !name.starts_with(|letter: char| letter.is_ascii_alphabetic() || letter == '_') {
                return format!(
                    "`{name}` does not go with {}",
                    types.trim_end_matches(')').replace(", ", " and ")
                );
            }
            let near = crate::layout::did_you_mean(name, super::verbs::NAMES.iter().copied());
            format!("there is no function {signature}{near}")
        }
        EvalAltResult::ErrorDataTooLarge(what, _) => match what.as_str() {
            "Length of string" => most_texts(),
            "Size of object map" => most_entries(),
            _ => most_elements(),
        },
        EvalAltResult::ErrorStackOverflow(_) => "calls are nested too deep here".to_owned(),
        EvalAltResult::ErrorModuleNotFound(name, _) => {
            format!("the folder has no script `{name}` to import; it lies beside {}", super::MAIN)
        }
        EvalAltResult::ErrorParsing(reason, _) => reason.to_string(),
        other => {
            let mut text = other.to_string();
            if let Some(end) = text.rfind(" (line ") {
                text.truncate(end);
            }
            text
        }
    }
}

/// Shortens a text that comes from a script, because such a text may have any length.
fn shortened(mut text: String) -> String {
    if text.len() > LONGEST {
        text.truncate(text.floor_char_boundary(LONGEST - 3));
        text.push_str("...");
    }
    without_interpreted(&text)
}
