//! An error in a script: its place and its description.

use super::budget::{Exceeded, LONGEST_TIME, MOST_OPERATIONS};
use super::engine::{most_elements, most_entries, most_texts, too_deep};
use super::functions::Functions;
use crate::layout::{DeviceLayout, did_you_mean};
use crate::plain_text::without_interpreted;
use crate::plc_spelling::Dialect;
use core::fmt;
use rhai::{AST, Engine, EvalAltResult, ParseError, ParseErrorType, Position};

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

    /// Returns an error of a running script. Its line is that of the innermost call. `given` is the number of arguments
    /// with which the emulator has called the function of the script.
    pub(super) fn ran(
        error: &EvalAltResult,
        engine: &Engine,
        files: &[(String, String)],
        given: usize,
    ) -> Self {
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
        let what = match at {
            EvalAltResult::ErrorFunctionNotFound(signature, position) => {
                Missing { engine, files, file: &file, position: *position, given }.description(signature)
            }
            other => description(other),
        };
        Mistake { file, line, what: shortened(what) }
    }
}

/// A call for which there is no function.
struct Missing<'a> {
    engine: &'a Engine,
    files: &'a [(String, String)],
    /// File with the call.
    file: &'a str,
    position: Position,
    /// Number of arguments if the emulator has called the function.
    given: usize,
}

impl Missing<'_> {
    /// Describes the error. `signature` has the form `name (type, type)`, or is the name if the emulator has called the
    /// function.
    fn description(&self, signature: &str) -> String {
        let (name, types) = signature.split_once(" (").unwrap_or((signature, ""));
        let types = types.trim_end_matches(')');
        if !name.starts_with(|letter: char| letter.is_ascii_alphabetic() || letter == '_') {
            return format!("`{name}` does not go with {}", types.replace(", ", " and "));
        }
        let count = match name.len() == signature.len() {
            true => self.given,
            false => types.split(", ").filter(|ty| !ty.is_empty()).count(),
        };
        let (own, verbs) = (self.functions(name), Functions::verbs());
        // The value before the point is no argument of a function of the script.
        let of_own = count.saturating_sub(self.is_method().into());
        let last = name.rsplit("::").next().unwrap_or(name);
        let checked = own.check_arguments(last, of_own).and_then(|()| verbs.check_arguments(name, count));
        checked.err().unwrap_or_else(|| {
            let near = did_you_mean(name, verbs.names().chain(own.names()));
            format!("there is no function {signature}{near}")
        })
    }

    /// Returns the functions of the file with the call, or, for a name with a module, those of the other files.
    fn functions(&self, name: &str) -> Functions {
        let is_qualified = name.contains("::");
        let files = self.files.iter().filter(|(file, _)| (file == self.file) != is_qualified);
        let asts = files.filter_map(|(_, text)| self.engine.compile(text).ok());
        Functions::of(&asts.fold(AST::empty(), |all, ast| all.merge(&ast)))
    }

    /// True if the call is that of a method: there is a point before its name.
    fn is_method(&self) -> bool {
        let text = self.files.iter().find(|(file, _)| file == self.file).map(|(_, text)| text.as_str());
        let (Some(text), Some(line), Some(column)) = (text, self.position.line(), self.position.position())
        else {
            return false;
        };
        let before = text.lines().nth(line - 1).map(|line| line.chars().take(column - 1).collect::<String>());
        before.is_some_and(|before| before.trim_end().ends_with('.'))
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
