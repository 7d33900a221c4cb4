//! Stops of a script for a debugger. An engine without a debugger calls nothing of this module.

use super::Bench;
use super::ScenarioError;
use super::caught::Caught;
use super::engine::{Stage, reader, value_text};
use super::imports::{module_file, without_first_line};
use crate::input_file;
use core::cell::{Cell, RefCell};
use core::mem::{Discriminant, discriminant};
use rhai::debugger::DebuggerCommand;
use rhai::{
    AST, ASTNode, Dynamic, Engine, EvalAltResult, EvalContext, Expr, ImmutableString, OptimizationLevel,
    Position, Scope, Stmt,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Steps that an expression of the debugger may take.
const STEPS_OF_EXPRESSION: u64 = 100_000;
/// Deepest nesting of an expression of the debugger.
const DEEPEST_EXPRESSION: usize = 32;

/// A function of a script, and the line that it executes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DebugFrame {
    /// Name of the function; empty outside of functions.
    pub function: String,
    /// The file with the line.
    pub file: PathBuf,
    /// Line of the position, counted from 1; 0 if it is not known.
    pub line: usize,
    /// Column of the position, counted from 1; 0 if it is not known.
    pub column: usize,
}

/// Reason for a stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum StopReason {
    /// The script stops at its first statement.
    Entry,
    /// The end of a step.
    Step,
    /// A line with a breakpoint.
    Breakpoint,
    /// The debugger has requested a pause.
    Pause,
    /// The scenario fails with this message.
    Failure(String),
}

/// Next action of a script that has stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Resume {
    /// Run to the next breakpoint.
    Continue,
    /// Run to the next line of this function or of a caller.
    Over,
    /// Run to the next line of any function.
    Into,
    /// Run to the next line of a caller.
    Out,
    /// The script must end.
    End,
}

/// A place at which a script can stop.
pub(crate) struct Place<'a> {
    /// Number of functions in the call stack; 0 outside of functions.
    pub depth: usize,
    /// The file with the line.
    pub file: &'a Path,
    /// The line, from 1.
    pub line: usize,
}

/// Decision of a debugger at a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Visit {
    /// The script runs on, unless a step ends here, or there is a breakpoint or a pause.
    Run,
    /// The script does not stop.
    Pass,
    /// The script stops.
    Stop(StopReason),
}

/// Ends a script because the debugger has disconnected. The script cannot catch it.
#[derive(Clone, Copy)]
pub(super) struct DebuggerLeft;

/// A debugger, called in the thread of the script.
pub(crate) trait ScriptDebugger {
    /// True if the script stops at its first statement.
    fn stops_on_entry(&self) -> bool;

    /// Called at each place, in the order in which the script visits the places. The state has no variables.
    fn visit(&self, place: &Place<'_>, state: &mut StoppedScript<'_>) -> Visit;

    /// Takes a request for a pause. Returns true once for each request.
    fn takes_pause(&self) -> bool;

    /// True if a line of a file has a breakpoint.
    fn has_breakpoint(&self, file: &Path, line: usize) -> bool;

    /// Waits at a stop. The frames begin with the innermost function.
    fn wait(&self, reason: StopReason, frames: &[DebugFrame], state: &mut StoppedScript<'_>) -> Resume;
}

/// Variables and plant of a script that has stopped.
pub(crate) struct StoppedScript<'a> {
    variables: Vec<(String, Dynamic)>,
    stage: &'a Rc<RefCell<Stage>>,
}

impl StoppedScript<'_> {
    /// The local variables of the innermost function, as names and texts, the latest first.
    pub(crate) fn variables(&self) -> Vec<(String, String)> {
        self.variables.iter().rev().map(|(name, value)| (name.clone(), value_text(value))).collect()
    }

    /// Calls `act` with the plant. Before the first verb this is the plant that the first verb will use.
    ///
    /// # Errors
    /// The plant is refused, `act` returns an error, or the script calls `plant` and this verb has not run.
    pub(crate) fn plant<T>(
        &mut self,
        act: impl FnOnce(&mut Bench) -> Result<T, ScenarioError>,
    ) -> Result<T, String> {
        let mut stage = self.stage.try_borrow_mut().map_err(|_| "the plant executes a verb".to_owned())?;
        stage.bench_of_debugger().and_then(act).map_err(|error| error.to_string())
    }

    /// Emulated time in microseconds; 0 before the first verb.
    pub(crate) fn time_us(&mut self) -> u64 {
        self.stage.try_borrow_mut().map_or(0, |mut stage| stage.now_us())
    }

    /// The value of a register with its meaning, or the value of an expression that only reads. Such an expression can
    /// use the verbs `peek`, `describe` and `now`, and copies of the variables.
    ///
    /// # Errors
    /// The text is neither a register nor such an expression.
    pub(crate) fn evaluate(&mut self, text: &str) -> Result<String, String> {
        if let Ok(text) = self.plant(|bench| bench.describe(text.trim())) {
            return Ok(text);
        }
        let mut engine = reader(self.stage);
        engine.set_max_operations(STEPS_OF_EXPRESSION);
        engine.set_max_expr_depths(DEEPEST_EXPRESSION, DEEPEST_EXPRESSION);
        engine.set_max_string_size(1 << 16);
        engine.set_max_array_size(1 << 16);
        engine.set_max_map_size(1 << 16);
        engine.disable_symbol("eval");
        let mut scope = Scope::new();
        for (name, value) in &self.variables {
            scope.push_dynamic(name.as_str(), value.flatten_clone());
        }
        let value = engine.eval_expression_with_scope::<Dynamic>(&mut scope, text);
        value.map(|value| value_text(&value)).map_err(|error| {
            let of_verb = match &*error {
                EvalAltResult::ErrorRuntime(thrown, _) => thrown.clone().try_cast::<Caught>(),
                _ => None,
            };
            let what = of_verb.map_or_else(|| error.to_string(), |error| error.message());
            match self.plant(|_| Ok(())) {
                Ok(()) => what,
                Err(missing) => format!("{what}; {missing}"),
            }
        })
    }
}

/// The lines of a script on which a breakpoint may be set: those on which a statement begins.
///
/// # Errors
/// The text is not a script; the message has the reason.
pub(crate) fn lines_of_statements(text: &str) -> Result<BTreeSet<usize>, String> {
    let mut lines = BTreeSet::new();
    each_statement(text, |stmt| {
        if !is_structure(stmt) {
            lines.extend(stmt.position().line());
        }
    })?;
    Ok(lines)
}

/// The expressions that are a whole statement, by their positions. The engine reports these expressions, but not their
/// statements. The first part of an interpolated text has the position of the text, but is another kind of expression.
type Expressions = BTreeMap<Position, Discriminant<Expr>>;

fn expression_statements(text: &str) -> Result<Expressions, String> {
    let mut found = Expressions::new();
    each_statement(text, |stmt| {
        if let Stmt::Expr(expr) = stmt {
            found.insert(expr.position(), discriminant(&**expr));
        }
    })?;
    Ok(found)
}

/// Calls `act` with each statement of a script and its functions.
fn each_statement(text: &str, mut act: impl FnMut(&Stmt)) -> Result<(), String> {
    let mut engine = Engine::new();
    engine.set_optimization_level(OptimizationLevel::None);
    engine.set_max_expr_depths(64, 64);
    let ast = engine.compile(without_first_line(text)).map_err(|error| error.to_string())?;
    ast.walk(&mut |path| {
        if let Some(ASTNode::Stmt(stmt)) = path.last() {
            act(stmt);
        }
        true
    });
    Ok(())
}

/// True if a script or one of its functions calls a function with this name.
pub(super) fn calls(ast: &AST, name: &str) -> bool {
    let mut found = false;
    ast.walk(&mut |path| {
        found |= match path.last() {
            Some(ASTNode::Stmt(Stmt::FnCall(call, _)) | ASTNode::Expr(Expr::FnCall(call, _))) => {
                call.name == name
            }
            _ => false,
        };
        !found
    });
    found
}

/// True for a statement that only contains other statements. A stop at it would be a second stop in the same line.
fn is_structure(stmt: &Stmt) -> bool {
    matches!(stmt, Stmt::Block(..) | Stmt::Noop(..))
}

/// A line that a function executes.
#[derive(Default)]
struct Line {
    source: Option<String>,
    /// The line, from 1; 0 if it is not known.
    line: usize,
    /// The calls that this line has begun: column and name.
    calls: Vec<(usize, ImmutableString)>,
}

impl Line {
    /// Notes a statement, or a call with its column and name. Returns true if it begins another line, or begins the
    /// same line again.
    ///
    /// The engine reports each call, but not a statement that consists only of a call. In a loop with such a statement,
    /// a call is repeated, so the line begins again. Calls in the arguments of a call are not repeated.
    fn begins(&mut self, source: Option<&str>, line: usize, call: Option<(usize, ImmutableString)>) -> bool {
        let is_new = self.line != line
            || self.source.as_deref() != source
            || call.as_ref().is_none_or(|call| self.calls.contains(call));
        if is_new {
            *self = Self { source: source.map(str::to_owned), line, calls: Vec::new() };
        }
        self.calls.extend(call);
        is_new
    }
}

/// Decides at each statement whether the script stops.
struct Stepper {
    debugger: Rc<dyn ScriptDebugger>,
    directory: PathBuf,
    scenario: PathBuf,
    stage: Rc<RefCell<Stage>>,
    /// The present step with the depth of the function in which it began.
    step: Cell<(Resume, usize)>,
    is_first: Cell<bool>,
    /// The last line of each function in the call stack, the outermost first.
    lines: RefCell<Vec<Line>>,
    /// The expressions of each script that are whole statements.
    expressions: RefCell<BTreeMap<String, Expressions>>,
    /// The functions at the last statement, for a failure.
    last: Rc<RefCell<Vec<DebugFrame>>>,
}

/// Attaches a debugger to the engine of a scenario. The result has the functions at the last statement.
pub(super) fn attach(
    engine: &mut Engine,
    debugger: Rc<dyn ScriptDebugger>,
    scenario: &Path,
    directory: &Path,
    stage: &Rc<RefCell<Stage>>,
) -> Rc<RefCell<Vec<DebugFrame>>> {
    // The engine must not optimize: otherwise some lines of the file would not exist in the program.
    engine.set_optimization_level(OptimizationLevel::None);
    let last = Rc::default();
    let stepper = Stepper {
        debugger,
        directory: directory.to_owned(),
        scenario: scenario.to_owned(),
        stage: Rc::clone(stage),
        step: Cell::new((Resume::Continue, 0)),
        is_first: Cell::new(true),
        lines: RefCell::default(),
        expressions: RefCell::default(),
        last: Rc::clone(&last),
    };
    #[expect(deprecated, reason = "Rhai marks an interface that may change; `~1.27` in Cargo.toml keeps it")]
    engine.register_debugger(
        |_, debugger| debugger,
        move |context, _, node, source, position| stepper.visit(&context, node, source, position),
    );
    last
}

/// A stop after the failure of a scenario. The variables no longer exist; the plant has the state that it had at the
/// failure.
pub(super) fn stop_on_failure(
    debugger: &dyn ScriptDebugger,
    what: String,
    frames: &[DebugFrame],
    stage: &Rc<RefCell<Stage>>,
) {
    let mut state = StoppedScript { variables: Vec::new(), stage };
    let _ = debugger.wait(StopReason::Failure(what), frames, &mut state);
}

impl Stepper {
    fn visit(
        &self,
        context: &EvalContext<'_, '_, '_, '_, '_, '_>,
        node: ASTNode<'_>,
        source: Option<&str>,
        position: Position,
    ) -> Result<DebuggerCommand, Box<EvalAltResult>> {
        let Some(line) = position.line() else { return Ok(DebuggerCommand::StepInto) };
        let calls = context.debugger().map_or(&[][..], |debugger| debugger.call_stack());
        let call = match node {
            ASTNode::Stmt(stmt) if is_structure(stmt) => return Ok(DebuggerCommand::StepInto),
            ASTNode::Stmt(_) => None,
            ASTNode::Expr(Expr::FnCall(call, _) | Expr::MethodCall(call, _)) => Some(call.name.clone()),
            ASTNode::Expr(Expr::Dot(..)) => Some(ImmutableString::new()),
            ASTNode::Expr(expr) if self.is_statement(source, position, expr) => Some(ImmutableString::new()),
            _ => return Ok(DebuggerCommand::StepInto),
        };
        let call = call.map(|name| (position.position().unwrap_or(0), name));
        let depth = calls.len();
        let mut lines = self.lines.borrow_mut();
        lines.resize_with(depth + 1, Line::default);
        if !lines.last_mut().is_some_and(|here| here.begins(source, line, call)) {
            return Ok(DebuggerCommand::StepInto);
        }
        drop(lines);
        let file = self.file(source);
        let Some(reason) = self.reason(depth, &file, line) else {
            *self.last.borrow_mut() = self.frames(context, source, position);
            return Ok(DebuggerCommand::StepInto);
        };
        let frames = self.frames(context, source, position);
        let variables =
            context.scope().iter().map(|(name, _, value)| (name.to_owned(), value.flatten_clone()));
        let mut state = StoppedScript { variables: variables.collect(), stage: &self.stage };
        let resume = self.debugger.wait(reason, &frames, &mut state);
        *self.last.borrow_mut() = frames;
        if resume == Resume::End {
            return Err(EvalAltResult::ErrorTerminated(Dynamic::from(DebuggerLeft), position).into());
        }
        self.step.set((resume, depth));
        Ok(DebuggerCommand::StepInto)
    }

    fn reason(&self, depth: usize, file: &Path, line: usize) -> Option<StopReason> {
        let is_first = self.is_first.replace(false);
        let mut state = StoppedScript { variables: Vec::new(), stage: &self.stage };
        match self.debugger.visit(&Place { depth, file, line }, &mut state) {
            Visit::Pass => return None,
            Visit::Stop(reason) => return Some(reason),
            Visit::Run => {}
        }
        if is_first && self.debugger.stops_on_entry() {
            return Some(StopReason::Entry);
        }
        if self.debugger.takes_pause() {
            return Some(StopReason::Pause);
        }
        if self.debugger.has_breakpoint(file, line) {
            return Some(StopReason::Breakpoint);
        }
        let (step, from) = self.step.get();
        let is_end = match step {
            Resume::Into => true,
            Resume::Over => depth <= from,
            Resume::Out => depth < from,
            Resume::Continue | Resume::End => false,
        };
        is_end.then_some(StopReason::Step)
    }

    /// True if an expression at this position of a script is a whole statement.
    fn is_statement(&self, source: Option<&str>, position: Position, expr: &Expr) -> bool {
        let source = source.unwrap_or_default();
        let mut known = self.expressions.borrow_mut();
        if !known.contains_key(source) {
            let text = input_file::read(&self.file(Some(source)), input_file::LONGEST_SCRIPT);
            let found = text.ok().and_then(|text| expression_statements(&text).ok()).unwrap_or_default();
            known.insert(source.to_owned(), found);
        }
        known.get(source).and_then(|found| found.get(&position)) == Some(&discriminant(expr))
    }

    fn file(&self, source: Option<&str>) -> PathBuf {
        match source {
            None | Some("") => self.scenario.clone(),
            Some(source) => module_file(source, &self.directory),
        }
    }

    /// The functions that run, the innermost first. An entry of the call stack has the file of the called function, but
    /// the position of its caller, so these are combined here.
    fn frames(
        &self,
        context: &EvalContext<'_, '_, '_, '_, '_, '_>,
        source: Option<&str>,
        position: Position,
    ) -> Vec<DebugFrame> {
        let calls = context.debugger().map_or(&[][..], |debugger| debugger.call_stack());
        let frame = |function: &str, source: Option<&str>, position: Position| DebugFrame {
            function: function.to_owned(),
            file: self.file(source),
            line: position.line().unwrap_or(0),
            column: position.position().unwrap_or(0),
        };
        let mut at = position;
        let mut source = source;
        let mut frames = Vec::with_capacity(calls.len() + 1);
        for (index, call) in calls.iter().enumerate().rev() {
            frames.push(frame(&call.fn_name, source, at));
            at = call.pos;
            source = index
                .checked_sub(1)
                .and_then(|below| calls.get(below))
                .and_then(|call| call.source.as_deref());
        }
        frames.push(frame("", source, at));
        frames
    }
}
