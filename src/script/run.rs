//! Runs scenario scripts.

use super::caught::Caught;
use super::complaint::{complaint, cut, in_words, misread};
use super::engine::{Skipped, Stage, engine, value_text};
use super::failure::{Failure, FailureKind, ScriptLocation};
use super::imports::{Imports, module_file};
use super::printed::Printed;
use super::report::{Mistake, Outcome, Report};
use super::{Bench, ScenarioError};
use crate::devices::folder::stack_position;
use crate::input_file;
use crate::namesakes::Namesakes;
#[cfg(feature = "cli")]
use crate::plant::PlantConfig;
use crate::time::short;
use crate::whole_script;
use core::cell::{Cell, RefCell};
use rhai::{Dynamic, Engine, EvalAltResult, ParseError, Scope};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::{Duration, Instant, SystemTime};

/// Number of steps of a script between two checks of the real time.
const OPERATIONS_PER_LOOK: u64 = 8;
/// Deepest nesting of function calls in a script.
const MOST_CALLS: usize = 64;
/// Deepest nesting of expressions in a script and in its functions.
const DEEPEST_EXPRESSION: usize = 64;

/// Stack size, in bytes, of a thread that runs scripts. It is enough for calls and expressions of this depth.
#[cfg(any(test, feature = "cli"))]
const STACK: usize = 16 << 20;
/// Stack, in bytes, that a script may use, for example by nested `eval`, which does not count as a call. The rest of
/// the stack is for a single step, such as a compilation, during which the stack is not checked.
const MOST_STACK: usize = 12 << 20;

/// Runs `work` in a thread with the stack that scripts need. A panic in `work` continues in the caller.
///
/// # Errors
/// The operating system cannot start another thread.
#[cfg(any(test, feature = "cli"))]
pub(crate) fn with_stack<T: Send>(work: impl FnOnce() -> T + Send) -> std::io::Result<T> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, work)?;
        Ok(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })
}

/// Starts a thread with the stack that scripts need. The thread ends with the process at the latest.
///
/// # Errors
/// The system refuses another thread.
#[cfg(feature = "cli")]
pub(crate) fn spawn_with_stack(work: impl FnOnce() + Send + 'static) -> std::io::Result<()> {
    std::thread::Builder::new().stack_size(STACK).spawn(work).map(drop)
}

/// Maximum length of a message, in characters. Only messages that contain text of a script can be longer.
const LONGEST_TEXT: usize = 2000;
/// Longest line of a script in a report.
const LONGEST_SOURCE: usize = 200;

/// Limits after which a scenario counts as endless.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Maximum number of steps of the script. A verb counts as a single step, even if it waits.
    pub operations: u64,
    /// Emulated time in microseconds.
    pub time_us: u64,
    /// Maximum real time. It is checked between steps of the script, so a single long step may exceed it.
    pub real: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self { operations: 10_000_000, time_us: Bench::LIMIT_US, real: Duration::from_secs(600) }
    }
}

/// Runs a scenario script on `bench`, or on a new plant if `bench` is `None`. Printed lines go to `print` immediately,
/// and are also in the report.
pub fn run_file(
    file: &Path,
    bench: Option<Bench>,
    limits: Limits,
    print: impl FnMut(&str) + 'static,
) -> Report {
    let directory = directory_of(file);
    run_on(file, Stage::new(bench, directory, limits.time_us), limits, print, engine_as_it_is)
}

/// The plant of a script that names none, or the error in it, and a name of the plant for messages.
#[cfg(feature = "cli")]
pub(crate) type UnnamedPlant = (String, Result<PlantConfig, String>);

/// Returns the directory of a script.
fn directory_of(file: &Path) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).to_owned()
}

/// Does the same as [`run_file`], and passes each section with its emulated time in microseconds to `sections` at once.
///
/// A script that does not call the verb `plant` runs in the plant of the parameter `plant`, or fails with its error. The
/// report uses the name that is given with it.
#[cfg(feature = "cli")]
pub(crate) fn run_observed(
    file: &Path,
    bench: Option<Bench>,
    plant: Option<UnnamedPlant>,
    limits: Limits,
    print: impl FnMut(&str) + 'static,
    sections: impl FnMut(&str, u64) + 'static,
) -> Report {
    let mut stage = Stage::new(bench, directory_of(file), limits.time_us);
    if let Some((name, plant)) = plant {
        stage.set_unnamed(&name, plant);
    }
    stage.on_section(sections);
    run_on(file, stage, limits, print, engine_as_it_is)
}

/// Does the same as [`run_file`] under a debugger, which also stops where the scenario fails.
///
/// A script that does not call the verb `plant` runs in the plant of the parameter `plant`, or fails with its error. The
/// report uses the name that is given with it.
#[cfg(feature = "cli")]
pub(crate) fn run_debugged(
    file: &Path,
    plant: Option<UnnamedPlant>,
    limits: Limits,
    print: impl FnMut(&str) + 'static,
    debugger: Rc<dyn super::debug::ScriptDebugger>,
) -> Report {
    let directory = directory_of(file);
    let mut stage = Stage::new(None, directory.clone(), limits.time_us);
    if let Some((name, plant)) = plant {
        stage.set_unnamed(&name, plant);
    }
    run_on(file, stage, limits, print, |engine, stage| {
        let last = super::debug::attach(engine, Rc::clone(&debugger), file, &directory, stage);
        let stage = Rc::clone(stage);
        Some(Box::new(move |outcome: &Outcome| {
            let (what, at) = match outcome {
                Outcome::Failed(failure) => (failure.what.clone(), failure.location.as_ref()),
                Outcome::Broken(mistake) => (mistake.what.clone(), Some(&mistake.location)),
                _ => return,
            };
            let mut frames = last.take();
            // The debugger has not stopped at this position: the failure may be in a later part of the line, or in a
            // file that does not compile.
            if let Some(at) = at {
                let (file, line) = (PathBuf::from(&at.file), at.line.map_or(0, |line| line as usize));
                match frames.first_mut() {
                    Some(top) if top.file == file => top.line = line,
                    _ => {
                        frames =
                            vec![super::debug::DebugFrame { function: String::new(), file, line, column: 0 }]
                    }
                }
            }
            super::debug::stop_on_failure(&*debugger, what, &frames, &stage);
        }))
    })
}

/// Called with the outcome of a script, before the plant is dropped.
type AtEnd = Option<Box<dyn FnOnce(&Outcome)>>;

/// Prepares nothing: the engine of a script runs without a debugger.
fn engine_as_it_is(_: &mut Engine, _: &Rc<RefCell<Stage>>) -> AtEnd {
    None
}

fn run_on(
    file: &Path,
    stage: Stage,
    limits: Limits,
    print: impl FnMut(&str) + 'static,
    prepare: impl FnOnce(&mut Engine, &Rc<RefCell<Stage>>) -> AtEnd,
) -> Report {
    let (started, start) = (SystemTime::now(), Instant::now());
    let directory = directory_of(file);
    let stage = Rc::new(RefCell::new(stage));
    let printed = Rc::new(RefCell::new(Printed::new(print)));
    let imported = Rc::default();
    let outcome = match input_file::read(file, input_file::LONGEST_SCRIPT) {
        Ok(text) => {
            let mut engine = engine(&stage);
            limit(&mut engine, limits, start);
            let printing = Rc::clone(&printed);
            engine.on_print(move |line| printing.borrow_mut().line(line));
            let printing = Rc::clone(&printed);
            engine.on_debug(move |line, _, _| printing.borrow_mut().line(line));
            let at_end = prepare(&mut engine, &stage);
            let outcome = run_text(&mut engine, file, &text, &directory, &stage, &imported, limits);
            if let Some(at_end) = at_end {
                at_end(&outcome);
            }
            outcome
        }
        Err(reason) => broken(&reason, place(file, None)),
    };
    let mut stage = stage.borrow_mut();
    let mut reads = imported.take();
    reads.extend(stage.plant_files());
    let report = Report {
        file: file.to_owned(),
        plant: stage.plant_name(),
        outcome,
        expectations: stage.expectations(),
        emulated_us: Some(stage.elapsed_us()),
        journal_hash: stage.journal_hash(),
        started,
        took: start.elapsed(),
        printed: printed.borrow_mut().take(),
        steps: stage.steps(),
        findings: stage.found(),
        plots: stage.plots(),
        reads,
    };
    stage.forget_saved();
    report
}

fn run_text(
    engine: &mut Engine,
    file: &Path,
    text: &str,
    directory: &Path,
    stage: &Rc<RefCell<Stage>>,
    imported: &Rc<RefCell<Vec<PathBuf>>>,
    limits: Limits,
) -> Outcome {
    let ast = match whole_script::compile(engine, text) {
        Ok(ast) => ast,
        Err(ParseError(reason, position)) => {
            let place = place(file, position.line());
            let what = misread(&reason, place.source.as_deref().unwrap_or_default());
            return broken(&what, place);
        }
    };
    let own = Namesakes::of(&file.display().to_string(), &ast);
    engine.set_module_resolver(Imports::new(file, directory, Rc::clone(imported), own));
    #[cfg(feature = "cli")]
    stage.borrow_mut().set_calls_plant(super::debug::calls(&ast, "plant"));
    let mut scope = Scope::new();
    // A constant for the last argument of the verbs about frames.
    scope.push_constant("extended", true);
    match engine.run_ast_with_scope(&mut scope, &ast) {
        Ok(()) => {
            let end = stage.borrow_mut().end();
            end.map_or_else(
                |error| judge(&error, wanted_at(&error, file, directory), stage),
                |()| Outcome::Passed,
            )
        }
        Err(error) => ended(&error, file, directory, stage, limits),
    }
}

/// Longest text of a script, and longest texts of a value together, in bytes.
pub(super) const LONGEST_TEXTS: usize = 1 << 20;
/// Maximum number of entries in all maps of a value.
pub(super) const MOST_ENTRIES: usize = 1 << 16;

/// Reason for the end of a script that has taken too many steps.
#[derive(Clone, Copy)]
struct TooManySteps;

/// Reason for the end of a script that is nested too deep.
#[derive(Clone, Copy)]
struct TooDeep;

/// Returns a function that checks the stack. The function returns true if the stack has grown by more than a script may
/// use.
pub(super) fn stack_guard() -> impl Fn() -> bool {
    let bottom = stack_position();
    move || bottom.abs_diff(stack_position()) > MOST_STACK
}

pub(super) fn limit(engine: &mut Engine, limits: Limits, start: Instant) {
    // Steps are counted here, because the engine does not count the steps of a closure that a function such as
    // `for_each` calls.
    let count = Cell::new(0_u64);
    let is_too_deep = stack_guard();
    engine.on_progress(move |_| {
        let operations = count.get().saturating_add(1);
        count.set(operations);
        if limits.operations > 0 && operations > limits.operations {
            return Some(Dynamic::from(TooManySteps));
        }
        if is_too_deep() {
            return Some(Dynamic::from(TooDeep));
        }
        let look = operations.is_multiple_of(OPERATIONS_PER_LOOK);
        (look && start.elapsed() >= limits.real).then_some(Dynamic::UNIT)
    });
    engine.set_max_call_levels(MOST_CALLS);
    engine.set_max_expr_depths(DEEPEST_EXPRESSION, DEEPEST_EXPRESSION);
    engine.set_max_string_size(LONGEST_TEXTS);
    engine.set_max_array_size(1 << 20);
    engine.set_max_map_size(MOST_ENTRIES);
}

/// Returns the outcome of the scenario after an error of the engine.
pub(super) fn ended(
    error: &EvalAltResult,
    file: &Path,
    directory: &Path,
    stage: &Rc<RefCell<Stage>>,
    limits: Limits,
) -> Outcome {
    let place = innermost(error, file, directory);
    match error.unwrap_inner() {
        EvalAltResult::ErrorRuntime(thrown, _) => match thrown.clone().try_cast::<Caught>() {
            Some(Caught(error)) => judge(&error, place, stage),
            None => failed(
                FailureKind::Throw,
                &in_words(&format!("the script throws {}", value_text(thrown))),
                place,
                stage,
            ),
        },
        EvalAltResult::ErrorTerminated(reason, _) if reason.is::<Skipped>() => {
            let Skipped(reason) = reason.clone().cast();
            Outcome::Skipped(cut(reason, LONGEST_TEXT))
        }
        #[cfg(feature = "cli")]
        EvalAltResult::ErrorTerminated(reason, _) if reason.is::<super::debug::DebuggerLeft>() => {
            Outcome::NotRun("the debugger has ended the scenario".to_owned())
        }
        EvalAltResult::ErrorTerminated(reason, _) if reason.is::<TooManySteps>() => {
            let text = format!(
                "the script does not end: stopped after {} steps (--max-operations)",
                limits.operations
            );
            failed(FailureKind::Endless, &text, place, stage)
        }
        EvalAltResult::ErrorTerminated(reason, _) if reason.is::<TooDeep>() => {
            broken(&"calls and `eval` are nested too deep here, deeper than a script may", place)
        }
        EvalAltResult::ErrorTerminated(..) => {
            let text = format!(
                "the script does not end: stopped after {} of real time (--max-real-time)",
                short(u64::try_from(limits.real.as_micros()).unwrap_or(u64::MAX))
            );
            failed(FailureKind::Endless, &text, place, stage)
        }
        other => {
            let what = complaint(other, place.source.as_deref().unwrap_or_default());
            broken(&what, place)
        }
    }
}

fn judge(error: &ScenarioError, place: ScriptLocation, stage: &Rc<RefCell<Stage>>) -> Outcome {
    match (error, error.failure_kind()) {
        (ScenarioError::Failed(failure), _) => failure_at((**failure).clone(), place),
        (error, Some(kind)) => failed(kind, &error.to_string(), place, stage),
        (error, None) => broken(error, place),
    }
}

/// Returns a failure that no expectation has caused.
fn failed(kind: FailureKind, what: &str, place: ScriptLocation, stage: &Rc<RefCell<Stage>>) -> Outcome {
    match stage.borrow_mut().failure(what) {
        Some(failure) => failure_at(Failure { kind, ..failure }, place),
        None => broken(&what, place),
    }
}

/// Returns a failure in a line of a script, with its texts shortened to a readable length.
fn failure_at(failure: Failure, place: ScriptLocation) -> Outcome {
    let what = cut(failure.what, LONGEST_TEXT);
    let section = failure.section.map(|section| cut(section, LONGEST_SOURCE));
    Outcome::Failed(Box::new(Failure { what, section, location: Some(place), ..failure }))
}

/// The script is wrong.
pub(super) fn broken(why: &dyn core::fmt::Display, location: ScriptLocation) -> Outcome {
    Outcome::Broken(Box::new(Mistake { what: cut(why.to_string(), LONGEST_TEXT), location }))
}

/// Location of a line of a script.
pub(super) fn place(file: &Path, line: Option<usize>) -> ScriptLocation {
    let text = |line: usize| {
        let text = input_file::read(file, input_file::LONGEST_SCRIPT).ok()?;
        text.lines().nth(line.checked_sub(1)?).map(|text| text.trim().to_owned())
    };
    ScriptLocation {
        file: file.display().to_string(),
        line: line.and_then(|line| u32::try_from(line).ok()),
        column: None,
        source: line.and_then(text).map(|text| cut(text, LONGEST_SOURCE)),
    }
}

/// Returns the location of the requirement that was not met at the end of a script.
fn wanted_at(error: &ScenarioError, file: &Path, directory: &Path) -> ScriptLocation {
    let at = match error {
        // A location with a column is in Rust code, not in the script.
        ScenarioError::Failed(failure) => failure.location.as_ref().filter(|at| at.column.is_none()),
        _ => None,
    };
    let line = |at: &ScriptLocation| at.line.map(|line| line as usize);
    match at {
        Some(at) if at.file.is_empty() => place(file, line(at)),
        Some(at) => place(&module_file(&at.file, directory), line(at)),
        None => place(file, None),
    }
}

/// Location of an error: the innermost line of a script.
fn innermost(error: &EvalAltResult, file: &Path, directory: &Path) -> ScriptLocation {
    let (mut file, mut line) = (file.to_owned(), error.position().line());
    let mut at = error;
    while let EvalAltResult::ErrorInFunctionCall(_, source, inner, _)
    | EvalAltResult::ErrorInModule(source, inner, _) = at
    {
        if !source.is_empty() {
            file = module_file(source, directory);
        }
        line = inner.position().line().or(line);
        at = inner;
    }
    place(&file, line)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs a script from a temporary file, in a thread with the stack that scripts need.
    fn outcome(bytes: &[u8], limits: Limits) -> Outcome {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("own.rhai");
        std::fs::write(&file, bytes).unwrap();
        with_stack(|| run_file(&file, None, limits, |_| {}).outcome).unwrap()
    }

    #[test]
    fn a_script_that_evaluates_itself_is_refused() {
        for text in [
            "let s = \"eval(s)\";\neval(s);",
            "let s = \"let t = s; eval(t)\";\neval(s);",
            "let s = \"[eval(s)]\";\neval(s);",
            "let s = \"if true { eval(s) }\";\neval(s);",
        ] {
            let outcome = outcome(text.as_bytes(), Limits::default());
            let Outcome::Broken(mistake) = outcome else { panic!("{text}: {outcome:?}") };
            assert!(mistake.what.contains("nested too deep"), "{text}: {mistake}");
        }
    }

    #[test]
    fn a_script_with_an_open_comment_is_refused() {
        let outcome = outcome(b"step(\"1ms\");\n/* open IF\nexpect_that(false, \"\");", Limits::default());
        let Outcome::Broken(mistake) = outcome else { panic!("{outcome:?}") };
        assert!(mistake.what.contains("'*/' to end this comment"), "{mistake}");
        assert_eq!(mistake.location.line, Some(2));
    }

    #[test]
    fn times_of_all_verbs_can_be_microseconds() {
        let text = b"expect_no_frame(\"drives\", 0x501, 2000); expect_no_frame(\"drives\", 0x501, 1000, extended);\n\
                     expect_no_frame(\"drives\", 0x501, 0x7FF, 500); step(500); expect_that(now() == 4000, `${now()}`);";
        let outcome = outcome(text, Limits::default());
        assert!(matches!(outcome, Outcome::Passed), "{outcome:?}");
    }

    /// The registers that cover each other are named by the state of the port, which an earlier record has changed.
    #[test]
    fn a_part_of_the_journal_names_the_same_registers() {
        let text = br#"poke("node2.w_CPU_CONTROL", 1); wait("node2.w_OPTION_STATUS", 2, "1ms"); let t = now();
            step("1ms"); poke("node2.b_BT_1", 0x1C); let part = journal(t + 1); let all = journal(0);
            expect_that(part.len() > 0 && part[0].text.contains("b_BT_1 ("), part[0].text);
            for i in 0..part.len() { expect_that(part[i] == all[all.len() - part.len() + i], `${part[i]}`); }"#;
        let outcome = outcome(text, Limits::default());
        assert!(matches!(outcome, Outcome::Passed), "{outcome:?}");
    }

    #[test]
    fn a_wait_during_which_the_plant_goes_back_takes_no_time() {
        let text = br#"let s = save(); step("5ms"); let us = wait_until(|| { back_to(s); true }, "1ms");
            expect_that(us == 0, `${us}`);"#;
        let outcome = outcome(text, Limits::default());
        assert!(matches!(outcome, Outcome::Passed), "{outcome:?}");
    }

    #[test]
    fn scripts_that_would_call_each_others_functions_are_refused() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("own.rhai");
        let own = |text: &str| {
            std::fs::write(&file, text).unwrap();
            with_stack(|| run_file(&file, None, Limits::default(), |_| {}).outcome).unwrap()
        };
        let part = "fn helper() { 1 } fn run() { helper() }";
        std::fs::write(directory.path().join("a.rhai"), part).unwrap();
        std::fs::write(directory.path().join("b.rhai"), part).unwrap();
        let both = own("import \"a\" as a;\nimport \"b\" as b; expect_that(a::run() == 1, \"\");");
        let Outcome::Broken(mistake) = both else { panic!("{both:?}") };
        assert!(mistake.what.contains("functions `helper` with 0 parameters in a and b"), "{mistake}");
        assert!(mistake.location.file.ends_with("b.rhai"), "{mistake}");
        let one = own("import \"a\" as a; fn run() { a::run() } expect_that(run() == 1, \"\");");
        assert!(matches!(one, Outcome::Passed), "{one:?}");
    }

    /// Every script ends with an outcome, reads no other file, and leaves no file.
    #[test]
    fn fuzz_scenario() {
        let limits = Limits { operations: 2_000, time_us: 20_000, real: Duration::from_secs(5) };
        crate::fuzz("scenario", |bytes| {
            let outcome = outcome(bytes, limits);
            assert!(!matches!(outcome, Outcome::Died(_) | Outcome::NotRun(_)), "{outcome:?}");
        });
    }
}
