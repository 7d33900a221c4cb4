//! Runs scenario scripts.

use super::engine::{Stage, engine};
use super::imports::{Imports, module_file};
use super::printed::Printed;
use super::{Bench, Failure, ScenarioError};
use crate::handed_in;
use crate::time::short;
use core::cell::RefCell;
use rhai::{Dynamic, Engine, EvalAltResult, ParseError, Scope};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Steps of a script between two looks at the real time.
const OPERATIONS_PER_LOOK: u64 = 8;
/// Deepest nesting of function calls in a script.
const MOST_CALLS: usize = 64;
/// Deepest nesting of expressions in a script and in its functions.
const DEEPEST_EXPRESSION: usize = 64;

/// What a scenario may use up before it counts as endless.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Steps of the script; waiting and stepping count as one.
    pub operations: u64,
    /// Emulated time in microseconds.
    pub time_us: u64,
    /// Real time. Looked at between the steps of the script, so that a single long one may take more.
    pub real: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self { operations: 10_000_000, time_us: Bench::LIMIT_US, real: Duration::from_secs(600) }
    }
}

/// How a scenario ended.
#[derive(Debug, Serialize, Deserialize)]
pub enum Outcome {
    /// All expectations were met.
    Passed,
    /// The plant did not behave as expected.
    Failed(Box<Failure>),
    /// The script is wrong: it cannot be read or compiled, or uses a verb wrongly. The text says where and why.
    Broken(String),
    /// It was not run to its end: its process crashed or was killed. The text says what is known. Only somebody else than
    /// that process can tell.
    Died(String),
}

/// What has become of a scenario.
#[derive(Debug, Serialize, Deserialize)]
pub struct Report {
    /// The script, as named; who gets the report from another process knows it.
    #[serde(skip)]
    pub file: PathBuf,
    /// How it ended.
    pub outcome: Outcome,
    /// Emulated time that it took, in microseconds; nobody knows it of a scenario that died.
    pub emulated_us: Option<u64>,
    /// Real time that it took.
    pub took: Duration,
    /// What it printed, up to 1 MiB; who gets the report from another process has had it already.
    #[serde(skip)]
    pub printed: String,
}

impl Report {
    /// The scenario's name: its file without directory and extension.
    pub fn name(&self) -> String {
        self.file.file_stem().unwrap_or(self.file.as_os_str()).to_string_lossy().into_owned()
    }
}

/// Runs a scenario script: on `bench` if there is one, else on a plant of its own. What it prints is handed to `print`
/// as it comes, and is in the report.
pub fn run_file(
    file: &Path,
    bench: Option<Bench>,
    limits: Limits,
    print: impl FnMut(&str) + 'static,
) -> Report {
    let start = Instant::now();
    let directory = file.parent().unwrap_or(Path::new("")).to_owned();
    let stage = Rc::new(RefCell::new(Stage::new(bench, directory.clone(), limits.time_us)));
    let printed = Rc::new(RefCell::new(Printed::new(print)));
    let outcome = match handed_in::read(file, handed_in::LONGEST_SCRIPT) {
        Ok(text) => {
            let (mut engine, _) = engine(&stage);
            limit(&mut engine, limits, start);
            engine.set_module_resolver(Imports::new(file, &directory));
            let printing = Rc::clone(&printed);
            engine.on_print(move |line| printing.borrow_mut().line(line));
            let printing = Rc::clone(&printed);
            engine.on_debug(move |line, _, _| printing.borrow_mut().line(line));
            run_text(&engine, file, &text, &directory, &stage, limits)
        }
        Err(reason) => Outcome::Broken(format!("{}: {reason}", file.display())),
    };
    Report {
        file: file.to_owned(),
        outcome,
        emulated_us: Some(stage.borrow_mut().elapsed_us()),
        took: start.elapsed(),
        printed: printed.borrow_mut().take(),
    }
}

fn run_text(
    engine: &Engine,
    file: &Path,
    text: &str,
    directory: &Path,
    stage: &Rc<RefCell<Stage>>,
    limits: Limits,
) -> Outcome {
    let ast = match engine.compile(text) {
        Ok(ast) => ast,
        Err(ParseError(reason, position)) => {
            let place = Place { file: file.to_owned(), line: position.line() };
            return broken(&reason, &place);
        }
    };
    let mut scope = Scope::new();
    // The last argument of the verbs about frames, by its name.
    scope.push_constant("extended", true);
    match engine.run_ast_with_scope(&mut scope, &ast) {
        Ok(()) => {
            let end = stage.borrow_mut().end();
            let place = Place { file: file.to_owned(), line: None };
            end.map_or_else(|error| judge(&error, &place, stage), |()| Outcome::Passed)
        }
        Err(error) => ended(&error, file, directory, stage, limits),
    }
}

fn limit(engine: &mut Engine, limits: Limits, start: Instant) {
    engine.set_max_operations(limits.operations);
    engine.on_progress(move |operations| {
        let look = operations.is_multiple_of(OPERATIONS_PER_LOOK);
        (look && start.elapsed() >= limits.real).then_some(Dynamic::UNIT)
    });
    engine.set_max_call_levels(MOST_CALLS);
    engine.set_max_expr_depths(DEEPEST_EXPRESSION, DEEPEST_EXPRESSION);
    engine.set_max_string_size(1 << 20);
    engine.set_max_array_size(1 << 20);
    engine.set_max_map_size(1 << 16);
}

/// What an error of the engine says about the scenario.
fn ended(
    error: &EvalAltResult,
    file: &Path,
    directory: &Path,
    stage: &Rc<RefCell<Stage>>,
    limits: Limits,
) -> Outcome {
    let place = innermost(error, file, directory);
    let inner = error.unwrap_inner();
    let what = match inner {
        EvalAltResult::ErrorRuntime(thrown, _) => match thrown.clone().try_cast::<Rc<ScenarioError>>() {
            Some(error) => return judge(&error, &place, stage),
            None => format!("the script throws {thrown}"),
        },
        EvalAltResult::ErrorTooManyOperations(_) => {
            let text = format!(
                "the script does not end: stopped after {} operations (--max-operations)",
                limits.operations
            );
            return failed(&text, &place, stage);
        }
        EvalAltResult::ErrorTerminated(..) => {
            let text = format!(
                "the script does not end: stopped after {} of real time (--max-real-time)",
                short(u64::try_from(limits.real.as_micros()).unwrap_or(u64::MAX))
            );
            return failed(&text, &place, stage);
        }
        other => {
            let mut other = other.to_string();
            // The position is told in our own way.
            if let Some(end) = other.rfind(" (line ") {
                other.truncate(end);
            }
            other
        }
    };
    broken(&what, &place)
}

fn judge(error: &ScenarioError, place: &Place, stage: &Rc<RefCell<Stage>>) -> Outcome {
    match error {
        ScenarioError::Failed(failure) => {
            let mut failure = failure.clone();
            failure.location = Some(place.long());
            Outcome::Failed(failure)
        }
        error if error.is_failure() => failed(&error.to_string(), place, stage),
        error => broken(error, place),
    }
}

/// A failure without expectation.
fn failed(what: &str, place: &Place, stage: &Rc<RefCell<Stage>>) -> Outcome {
    match stage.borrow_mut().failure(what) {
        Some(mut failure) => {
            failure.location = Some(place.long());
            Outcome::Failed(Box::new(failure))
        }
        None => broken(&what, place),
    }
}

/// The script is wrong.
fn broken(why: &dyn core::fmt::Display, place: &Place) -> Outcome {
    Outcome::Broken(format!("{}: {why}{}", place.short(), place.quote()))
}

/// A line of a script.
struct Place {
    file: PathBuf,
    line: Option<usize>,
}

impl Place {
    /// `master.rhai:12`
    fn short(&self) -> String {
        let line = self.line.map(|line| format!(":{line}")).unwrap_or_default();
        format!("{}{line}", self.file.display())
    }

    /// The line's text.
    fn text(&self) -> Option<String> {
        let line = self.line?.checked_sub(1)?;
        let text = handed_in::read(&self.file, handed_in::LONGEST_SCRIPT).ok()?;
        text.lines().nth(line).map(|text| text.trim().to_owned())
    }

    /// `master.rhai:12: expect(...)`
    fn long(&self) -> String {
        self.text().map_or_else(|| self.short(), |text| format!("{}: {text}", self.short()))
    }

    /// The line's text on a line of its own.
    fn quote(&self) -> String {
        self.text().map(|text| format!("\n  line      {text}")).unwrap_or_default()
    }
}

/// Where an error comes from: the innermost line of a script.
fn innermost(error: &EvalAltResult, file: &Path, directory: &Path) -> Place {
    let mut place = Place { file: file.to_owned(), line: error.position().line() };
    let mut at = error;
    while let EvalAltResult::ErrorInFunctionCall(_, source, inner, _)
    | EvalAltResult::ErrorInModule(source, inner, _) = at
    {
        if !source.is_empty() {
            place.file = module_file(source, directory);
        }
        place.line = inner.position().line().or(place.line);
        at = inner;
    }
    place
}
