//! The thread of the debugged scenario, and the questions that it answers while the scenario is stopped.

use super::history::{Direction, History};
use super::session::Event;
use crate::layout::Fit;
use crate::script::debug::{DebugFrame, Place, Resume, ScriptDebugger, StopReason, StoppedScript, Visit};
use crate::script::{Bench, Limits, UnnamedPlant, run_debugged, spawn_with_stack};
use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::mpsc::{self, Receiver, Sender, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};

/// Reference of the variables of the script.
pub(super) const VARIABLES: u64 = 1;
/// Reference of the areas of registers.
pub(super) const AREAS: u64 = 2;
/// Reference of the first area.
const FIRST_AREA: u64 = 1000;
/// Maximum number of printed lines that wait for the editor. If there are more, the scenario waits. This keeps the
/// queue short, because a request of the editor is answered after the lines in the queue.
const MOST_LINES: usize = 64;
/// Maximum number of variables in one answer; the editor requests more.
const MOST_VARIABLES: usize = 2000;

/// Requests of the editor that also concern a running script.
#[derive(Default)]
pub(super) struct Shared {
    /// Lines with breakpoints, by the real path of the file.
    pub breakpoints: Mutex<BTreeMap<PathBuf, BTreeSet<usize>>>,
    /// True if the user has requested a pause.
    pub pause: AtomicBool,
}

/// A question to a stopped script.
pub(super) enum Question {
    /// Up to `count` children of the object `reference`, from number `start` on; a count of 0 means all children.
    Variables { reference: u64, start: usize, count: usize },
    /// The value of a register or of an expression.
    Evaluate(String),
    /// A write of a register of an area.
    Poke { reference: u64, name: String, value: String },
}

/// A command for a stopped script.
pub(super) enum Command {
    Ask(Question, SyncSender<Result<Value, String>>),
    Resume(Resume),
    /// The scenario goes back to an earlier place.
    Back(Direction),
}

/// A scenario that the editor starts.
pub(super) struct Launch {
    pub program: PathBuf,
    pub stop_on_entry: bool,
    /// False if the editor runs the scenario without debugging: only a pause stops it.
    pub is_debugged: bool,
    /// The plant, if the scenario names none and gets another one than the built-in plant.
    pub device: Option<UnnamedPlant>,
    pub time_us: u64,
}

/// Starts the scenario. Its events go to `events`. For each [`Event::Output`], the caller must receive once from the
/// result. While [`MOST_LINES`] outputs are not received, a scenario that prints waits.
pub(super) fn start(
    launch: Launch,
    shared: Arc<Shared>,
    commands: Receiver<Command>,
    events: Sender<Event>,
) -> std::io::Result<Receiver<()>> {
    let (lines, printed) = mpsc::sync_channel(MOST_LINES);
    spawn_with_stack(move || {
        let Launch { program, stop_on_entry, is_debugged, device, time_us } = launch;
        // No limit of real time or of steps: a stop takes real time, and the user can pause an endless script in the
        // editor.
        let limits = Limits { operations: 0, time_us, real: core::time::Duration::MAX };
        let stop_on_entry = stop_on_entry && is_debugged;
        let (paths, history) = (RefCell::default(), RefCell::default());
        let stopper = Stopper { shared, commands, events, lines, stop_on_entry, is_debugged, paths, history };
        let stopper = Rc::new(stopper);
        loop {
            stopper.history.borrow_mut().begin();
            let printing = Rc::clone(&stopper);
            let print = move |line: &str| {
                // A run that repeats an earlier one prints the same lines again. The editor has them already.
                if !printing.history.borrow().goes_back() {
                    printing.print(line.to_owned());
                }
            };
            let debugger: Rc<dyn ScriptDebugger> = Rc::<Stopper>::clone(&stopper);
            let report = run_debugged(&program, device.clone(), limits, print, debugger);
            if !stopper.history.borrow_mut().takes_end() {
                let _ = stopper.events.send(Event::Ended(Box::new(report)));
                return;
            }
        }
    })?;
    Ok(printed)
}

/// The debugger in the thread of the script.
struct Stopper {
    shared: Arc<Shared>,
    commands: Receiver<Command>,
    events: Sender<Event>,
    /// Has an item for each printed line that the session has not taken.
    lines: SyncSender<()>,
    stop_on_entry: bool,
    is_debugged: bool,
    /// Real paths of the files.
    paths: RefCell<BTreeMap<PathBuf, PathBuf>>,
    history: RefCell<History>,
}

impl ScriptDebugger for Stopper {
    fn stops_on_entry(&self) -> bool {
        self.stop_on_entry
    }

    fn visit(&self, place: &Place<'_>, state: &mut StoppedScript<'_>) -> Visit {
        let mut history = self.history.borrow_mut();
        history.visit(place.depth, place.line);
        if !history.goes_back() {
            return Visit::Run;
        }
        for (register, value) in history.changes_here() {
            // An error is ignored: the same change has succeeded at this place in an earlier run.
            let _ = state.plant(|bench| bench.poke(register, value));
        }
        if self.takes_pause() {
            history.stay();
            return Visit::Stop(StopReason::Pause);
        }
        let decision = history.decide(|| self.has_breakpoint(place.file, place.line));
        if history.takes_difference() {
            let text =
                "the scenario or its imports have changed since the start: this stop is at another line\n";
            self.print(text.to_owned());
        }
        decision
    }

    fn takes_pause(&self) -> bool {
        self.shared.pause.load(Ordering::Relaxed) && self.shared.pause.swap(false, Ordering::Relaxed)
    }

    fn has_breakpoint(&self, file: &Path, line: usize) -> bool {
        if !self.is_debugged {
            return false;
        }
        let breakpoints = self.shared.breakpoints.lock().unwrap_or_else(PoisonError::into_inner);
        if breakpoints.is_empty() {
            return false;
        }
        let mut paths = self.paths.borrow_mut();
        let real = match paths.get(file) {
            Some(real) => real,
            None => paths.entry(file.to_owned()).or_insert_with(|| real_path(file)),
        };
        breakpoints.get(real).is_some_and(|lines| lines.contains(&line))
    }

    fn wait(&self, reason: StopReason, frames: &[DebugFrame], state: &mut StoppedScript<'_>) -> Resume {
        if !self.is_debugged && matches!(reason, StopReason::Failure(_)) {
            return Resume::Continue;
        }
        if self.history.borrow_mut().has_searched() {
            return Resume::End;
        }
        let is_failure = matches!(reason, StopReason::Failure(_));
        if !self.reports_stop(&reason, frames, state) {
            return Resume::End;
        }
        loop {
            match self.commands.recv() {
                Ok(Command::Ask(question, reply)) => {
                    let _ = reply.send(answer(question, state, &self.history));
                }
                Ok(Command::Resume(resume)) => return resume,
                Ok(Command::Back(direction)) => {
                    if self.history.borrow_mut().turns(direction, is_failure) {
                        return Resume::End;
                    }
                    // No place is before the first one.
                    if !self.reports_stop(&reason, frames, state) {
                        return Resume::End;
                    }
                }
                // The session has ended.
                Err(_) => return Resume::End,
            }
        }
    }
}

impl Stopper {
    /// Sends a line to the editor. Waits while too many lines are on their way.
    fn print(&self, line: String) {
        // If the session has ended, the process ends, too.
        let _ = self.lines.send(());
        let _ = self.events.send(Event::Output(line));
    }

    /// Reports a stop to the session; false if the session has ended.
    fn reports_stop(
        &self,
        reason: &StopReason,
        frames: &[DebugFrame],
        state: &mut StoppedScript<'_>,
    ) -> bool {
        let (reason, frames, time_us) = (reason.clone(), frames.to_vec(), state.time_us());
        self.events.send(Event::Stopped { reason, frames, time_us }).is_ok()
    }
}

/// The path of a file without links; the path as it is if there is no such file.
pub(super) fn real_path(file: &Path) -> PathBuf {
    file.canonicalize().unwrap_or_else(|_| file.to_owned())
}

fn answer(
    question: Question,
    state: &mut StoppedScript<'_>,
    history: &RefCell<History>,
) -> Result<Value, String> {
    match question {
        Question::Variables { reference: VARIABLES, start, count } => {
            let all = state.variables().into_iter().map(|(name, value)| {
                json!({ "name": name, "value": value, "evaluateName": name, "variablesReference": 0 })
            });
            Ok(json!({ "variables": page(all, start, count) }))
        }
        Question::Variables { reference: AREAS, start, count } => {
            let areas = state.plant(|bench| Ok(areas(bench)))?;
            let all = areas.iter().zip(FIRST_AREA..).map(|(area, reference)| {
                json!({
                    "name": area.name,
                    "value": area.doc,
                    "variablesReference": reference,
                    "indexedVariables": area.registers.len(),
                })
            });
            Ok(json!({ "variables": page(all, start, count) }))
        }
        Question::Variables { reference, start, count } => {
            let area = area(state, reference)?;
            let all = area.registers.iter().map(|name| {
                let full = format!("{}.{name}", area.name);
                let value = described(state, &full).unwrap_or_else(|error| error);
                json!({ "name": name, "value": value, "evaluateName": full, "variablesReference": 0 })
            });
            Ok(json!({ "variables": page(all, start, count) }))
        }
        Question::Evaluate(text) => {
            let result = state.evaluate(&text)?;
            Ok(json!({ "result": result, "variablesReference": 0 }))
        }
        Question::Poke { reference, name, value } => {
            if reference < FIRST_AREA {
                return Err(format!("{name}: only a register can be changed, not a variable of the script"));
            }
            let full = format!("{}.{name}", area(state, reference)?.name);
            state.plant(|bench| bench.poke(&full, value.trim()))?;
            history.borrow_mut().change(&full, value.trim());
            Ok(json!({ "value": described(state, &full)? }))
        }
    }
}

/// The value of a register with its meaning.
fn described(state: &mut StoppedScript<'_>, register: &str) -> Result<String, String> {
    let text = state.plant(|bench| bench.describe(register))?;
    Ok(text.split_once(" = ").map_or_else(|| text.clone(), |(_, value)| value.to_owned()))
}

fn page(all: impl Iterator<Item = Value>, start: usize, count: usize) -> Vec<Value> {
    let count = if count == 0 { MOST_VARIABLES } else { count.min(MOST_VARIABLES) };
    all.skip(start).take(count).collect()
}

/// An area of registers.
struct AreaView {
    /// Name of the register, with its PLC if the instance has several.
    name: String,
    doc: String,
    /// Names of the registers in the area.
    registers: Vec<String>,
}

fn area(state: &mut StoppedScript<'_>, reference: u64) -> Result<AreaView, String> {
    let mut areas = state.plant(|bench| Ok(areas(bench)))?;
    let index = reference.checked_sub(FIRST_AREA).and_then(|index| usize::try_from(index).ok());
    let index = index.filter(|index| *index < areas.len());
    index.map(|index| areas.swap_remove(index)).ok_or_else(|| {
        format!("variablesReference {reference}: unknown; right is a number of an answer to `scopes` or `variables`")
    })
}

/// The areas of the plant that have registers.
fn areas(bench: &Bench) -> Vec<AreaView> {
    let names = bench.names();
    let mut all = Vec::new();
    for (plc, fitted) in names.plcs.iter().zip(&names.devices) {
        let prefix = if names.plcs.len() > 1 { format!("{plc}:") } else { String::new() };
        for area in fitted.device().named_areas().filter(|area| fitted.area(area) != Fit::Empty) {
            let registers: Vec<_> =
                fitted.used_registers(area).map(|register| register.path().to_string()).collect();
            if !registers.is_empty() {
                all.push(AreaView {
                    name: format!("{prefix}{}", area.name),
                    doc: area.doc.to_owned(),
                    registers,
                });
            }
        }
    }
    all
}
