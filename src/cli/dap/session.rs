//! The session of an editor: the answer to each request, and the events of the scenario.

use super::history::Direction;
use super::script::{self, AREAS, Command, Launch, Question, Shared, VARIABLES, real_path};
use crate::cli::test::scenario::{plant_of, unnamed_plant};
use crate::cli::test::verdict;
use crate::input_file;
use crate::script::debug::{DebugFrame, Resume, StopReason, lines_of_statements};
use crate::script::{Bench, Outcome, Report};
use crate::time::{self, seconds};
use core::iter;
use core::sync::atomic::Ordering;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, PoisonError};

/// The only thread of a scenario.
const THREAD: u64 = 1;

/// Something for the session.
pub(super) enum Event {
    /// A message of the editor.
    Message(Value),
    /// The editor has closed the connection, or has sent data that are not a message (the error).
    Closed(Option<io::Error>),
    /// The scenario has printed this text.
    Output(String),
    /// The scenario has stopped at an emulated time in microseconds.
    Stopped { reason: StopReason, frames: Vec<DebugFrame>, time_us: u64 },
    /// The scenario has ended.
    Ended(Box<Report>),
}

/// Action after an event.
#[derive(Debug)]
pub(super) enum Next {
    Continue,
    /// The editor has ended the session.
    End,
    /// The connection has failed.
    Fail(io::Error),
}

/// A stop of the scenario.
struct Stop {
    reason: StopReason,
    frames: Vec<DebugFrame>,
    time_us: u64,
}

/// State of the scenario.
enum State {
    /// The editor has not requested a scenario.
    Waiting,
    /// The editor has requested a scenario; it runs after `configurationDone`.
    Ready(Box<Launch>),
    Running(Sender<Command>),
    Stopped(Sender<Command>, Stop),
    Over,
}

/// The session of an editor.
pub(super) struct Session {
    state: State,
    shared: Arc<Shared>,
    events: Sender<Event>,
    /// Has an item for each [`Event::Output`] of the scenario.
    printed: Option<Receiver<()>>,
    is_configured: bool,
    /// Number of the first line and of the first column for this editor.
    first_line: usize,
    first_column: usize,
    /// Number of the last message to the editor.
    sent: u64,
}

impl Session {
    pub(super) fn new(events: Sender<Event>) -> Self {
        Self {
            state: State::Waiting,
            shared: Arc::default(),
            events,
            printed: None,
            is_configured: false,
            first_line: 1,
            first_column: 1,
            sent: 0,
        }
    }

    /// Acts on an event; messages to the editor are added to `answers`.
    pub(super) fn take(&mut self, event: Event, answers: &mut Vec<Value>) -> Next {
        if matches!(event, Event::Output(_)) {
            // The scenario may print another line.
            let _ = self.printed.as_ref().map(Receiver::try_recv);
        }
        match event {
            Event::Message(message) => return self.message(&message, answers),
            Event::Closed(None) => return Next::End,
            Event::Closed(Some(reason)) => return Next::Fail(reason),
            // After `terminate`, the editor expects no further events of the scenario.
            _ if matches!(self.state, State::Over) => {}
            Event::Output(line) => self.output(answers, "stdout", &line),
            Event::Stopped { reason, frames, time_us } => self.stopped(reason, frames, time_us, answers),
            Event::Ended(mut report) => {
                // `commram test` has an option that allows a scenario without expectations. The adapter has none, so
                // the message has no remedy.
                report.refuse_empty_with("");
                if let Some(text) = problem(&report.outcome) {
                    self.output(answers, "stderr", &text);
                }
                let code =
                    verdict(iter::once(&report.outcome)).map_or_else(|error| error.exit_code(), |()| 0);
                self.end(code, answers);
            }
        }
        Next::Continue
    }

    fn stopped(
        &mut self,
        reason: StopReason,
        frames: Vec<DebugFrame>,
        time_us: u64,
        answers: &mut Vec<Value>,
    ) {
        let State::Running(commands) = core::mem::replace(&mut self.state, State::Over) else { return };
        let (name, text) = match &reason {
            StopReason::Entry => ("entry", None),
            StopReason::Step => ("step", None),
            StopReason::Breakpoint => ("breakpoint", None),
            StopReason::Pause => ("pause", None),
            StopReason::Failure(text) => ("exception", Some(text.clone())),
        };
        let mut body = json!({
            "reason": name,
            "description": format!("{name} at {} emulated", seconds(time_us)),
            // Not part of the protocol: the extension for VS Code shows the time in its status.
            "emulatedTime": seconds(time_us),
            "threadId": THREAD,
            "allThreadsStopped": true,
        });
        if let (Some(text), Some(fields)) = (text, body.as_object_mut()) {
            fields.insert("text".to_owned(), text.into());
        }
        self.state = State::Stopped(commands, Stop { reason, frames, time_us });
        self.event("stopped", body, answers);
    }

    /// Reports the end of the scenario to the editor.
    fn end(&mut self, code: u8, answers: &mut Vec<Value>) {
        // A script that is stopped ends as soon as the sender of its commands is dropped.
        self.state = State::Over;
        self.event("exited", json!({ "exitCode": code }), answers);
        self.event("terminated", json!({}), answers);
    }

    fn message(&mut self, message: &Value, answers: &mut Vec<Value>) -> Next {
        // The adapter sends no requests to the editor, so it expects no responses. It ignores all messages except
        // requests.
        if message["type"] != "request" {
            return Next::Continue;
        }
        let command = message["command"].as_str().unwrap_or_default();
        let outcome = self.answer(command, &message["arguments"]);
        self.sent += 1;
        let mut response = json!({
            "seq": self.sent,
            "type": "response",
            "request_seq": message["seq"].as_u64().unwrap_or(0),
            "command": command,
            "success": outcome.is_ok(),
        });
        if let Some(fields) = response.as_object_mut() {
            match &outcome {
                Ok(body) => fields.insert("body".to_owned(), body.clone()),
                Err(text) => {
                    let error = json!({ "id": 1, "format": "{text}", "variables": { "text": text }, "showUser": true });
                    fields.insert("body".to_owned(), json!({ "error": error }));
                    fields.insert("message".to_owned(), text.clone().into())
                }
            };
        }
        answers.push(response);
        if outcome.is_err() {
            return Next::Continue;
        }
        match command {
            "initialize" => self.event("initialized", json!({}), answers),
            "launch" | "configurationDone" => self.start(answers),
            "terminate" if !matches!(self.state, State::Over) => {
                self.shared.pause.store(true, Ordering::Relaxed);
                self.end(1, answers);
            }
            "disconnect" => return Next::End,
            _ => {}
        }
        Next::Continue
    }

    fn answer(&mut self, command: &str, arguments: &Value) -> Result<Value, String> {
        match command {
            "initialize" => {
                let first = |name: &str| usize::from(arguments[name].as_bool().unwrap_or(true));
                (self.first_line, self.first_column) = (first("linesStartAt1"), first("columnsStartAt1"));
                Ok(json!({
                    "supportsConfigurationDoneRequest": true,
                    "supportsEvaluateForHovers": true,
                    "supportsExceptionInfoRequest": true,
                    "supportsSetVariable": true,
                    "supportsStepBack": true,
                    "supportsTerminateRequest": true,
                }))
            }
            "launch" => self.launch(arguments),
            "configurationDone" => {
                self.is_configured = true;
                Ok(json!({}))
            }
            "setBreakpoints" => self.set_breakpoints(arguments),
            "setExceptionBreakpoints" | "terminate" | "disconnect" => Ok(json!({})),
            "threads" => Ok(json!({ "threads": [{ "id": THREAD, "name": "scenario" }] })),
            "pause" => match self.state {
                State::Running(_) => {
                    self.shared.pause.store(true, Ordering::Relaxed);
                    Ok(json!({}))
                }
                _ => Err("pause: no scenario runs".to_owned()),
            },
            "continue" => {
                self.resume(Resume::Continue)?;
                Ok(json!({ "allThreadsContinued": true }))
            }
            "next" => self.resume(Resume::Over),
            "stepIn" => self.resume(Resume::Into),
            "stepOut" => self.resume(Resume::Out),
            "stepBack" => self.send(Command::Back(Direction::Step)),
            "reverseContinue" => self.send(Command::Back(Direction::Breakpoint)),
            "stackTrace" => self.stack_trace(arguments),
            "scopes" => self.scopes(arguments),
            "variables" => self.ask(Question::Variables {
                reference: number(arguments, "variablesReference")?,
                start: count(arguments, "start"),
                count: count(arguments, "count"),
            }),
            "setVariable" => self.ask(Question::Poke {
                reference: number(arguments, "variablesReference")?,
                name: text(arguments, "name")?,
                value: text(arguments, "value")?,
            }),
            "evaluate" => self.ask(Question::Evaluate(text(arguments, "expression")?)),
            "exceptionInfo" => match self.stop()? {
                Stop { reason: StopReason::Failure(text), .. } => Ok(json!({
                    "exceptionId": "failure", "description": text, "breakMode": "always",
                })),
                _ => Err("exceptionInfo: the scenario has not failed".to_owned()),
            },
            other => Err(format!("this adapter has no request `{other}`")),
        }
    }

    fn launch(&mut self, arguments: &Value) -> Result<Value, String> {
        if !matches!(self.state, State::Waiting) {
            return Err("launch: a session has one scenario; start another session".to_owned());
        }
        let program = PathBuf::from(text(arguments, "program")?);
        if !program.is_file() {
            return Err(format!("program: {} is not a file; name a scenario", program.display()));
        }
        let time_us = match &arguments["maxTime"] {
            Value::Null => Bench::LIMIT_US,
            Value::String(text) => time::parse(text).map_err(|error| format!("maxTime: {error}"))?,
            other => return Err(format!("maxTime: {other} is no time; right is a text such as \"1h\"")),
        };
        let device = match &arguments["device"] {
            Value::Null => unnamed_plant(None, &program),
            Value::String(dir) => {
                let (name, plant) = plant_of(Path::new(dir)).map_err(|error| format!("device: {error}"))?;
                Some((name, Ok(plant)))
            }
            other => return Err(format!("device: {other} is no text; name the folder of a device")),
        };
        let stop_on_entry = arguments["stopOnEntry"] == true;
        let is_debugged = arguments["noDebug"] != true;
        self.state = State::Ready(Box::new(Launch { program, stop_on_entry, is_debugged, device, time_us }));
        Ok(json!({}))
    }

    /// Starts the scenario if the editor has sent everything.
    fn start(&mut self, answers: &mut Vec<Value>) {
        if !self.is_configured || !matches!(self.state, State::Ready(_)) {
            return;
        }
        let State::Ready(launch) = core::mem::replace(&mut self.state, State::Over) else { return };
        let (commands, received) = mpsc::channel();
        match script::start(*launch, Arc::clone(&self.shared), received, self.events.clone()) {
            Ok(printed) => {
                self.printed = Some(printed);
                self.state = State::Running(commands);
            }
            Err(error) => {
                self.output(answers, "stderr", &format!("the scenario cannot start: {error}"));
                self.end(1, answers);
            }
        }
    }

    fn set_breakpoints(&mut self, arguments: &Value) -> Result<Value, String> {
        let file = PathBuf::from(text(&arguments["source"], "path")?);
        let requested = arguments["breakpoints"].as_array().map(Vec::as_slice).unwrap_or_default();
        let base = self.first_line;
        let lines = requested.iter().map(|point| count(point, "line").saturating_add(1 - base));
        let lines: Vec<_> = lines.collect();
        let possible = input_file::read(&file, input_file::LONGEST_SCRIPT)
            .map_err(|error| error.to_string())
            .and_then(|text| lines_of_statements(&text));
        let mut set = BTreeSet::new();
        let answers: Vec<_> = lines
            .into_iter()
            .map(|line| match possible.as_ref().map(|possible| possible.range(line..).next()) {
                Ok(Some(moved)) => {
                    set.insert(*moved);
                    json!({ "verified": true, "line": moved - (1 - base) })
                }
                Ok(None) => {
                    json!({ "verified": false, "message": "no statement begins at or after this line" })
                }
                Err(error) => json!({ "verified": false, "message": error }),
            })
            .collect();
        let mut all = self.shared.breakpoints.lock().unwrap_or_else(PoisonError::into_inner);
        if set.is_empty() {
            all.remove(&real_path(&file));
        } else {
            all.insert(real_path(&file), set);
        }
        Ok(json!({ "breakpoints": answers }))
    }

    fn stop(&self) -> Result<&Stop, String> {
        match &self.state {
            State::Stopped(_, stop) => Ok(stop),
            State::Running(_) => Err("the scenario runs; pause it first".to_owned()),
            State::Waiting | State::Ready(_) => Err("the scenario has not started".to_owned()),
            State::Over => Err("the scenario has ended".to_owned()),
        }
    }

    fn resume(&mut self, resume: Resume) -> Result<Value, String> {
        self.send(Command::Resume(resume))
    }

    /// Sends a command after which the scenario runs.
    fn send(&mut self, command: Command) -> Result<Value, String> {
        self.stop()?;
        if let State::Stopped(commands, _) = core::mem::replace(&mut self.state, State::Over) {
            // An error is ignored: if the thread has ended, its last event will arrive.
            let _ = commands.send(command);
            self.state = State::Running(commands);
        }
        Ok(json!({}))
    }

    fn ask(&self, question: Question) -> Result<Value, String> {
        self.stop()?;
        let State::Stopped(commands, _) = &self.state else { return Err(String::new()) };
        let (reply, received) = mpsc::sync_channel(1);
        let ended = "the scenario has ended";
        commands.send(Command::Ask(question, reply)).map_err(|_| ended.to_owned())?;
        received.recv().map_err(|_| ended.to_owned())?
    }

    fn stack_trace(&self, arguments: &Value) -> Result<Value, String> {
        let stop = self.stop()?;
        let (start, levels) = (count(arguments, "startFrame"), count(arguments, "levels"));
        let levels = if levels == 0 { usize::MAX } else { levels };
        let frame = |(index, frame): (usize, &DebugFrame)| {
            let path = real_path(&frame.file);
            let function = if frame.function.is_empty() { "(scenario)" } else { &frame.function };
            let time = if index == 0 { format!(" at {}", seconds(stop.time_us)) } else { String::new() };
            json!({
                "id": index,
                "name": format!("{function}{time}"),
                "source": {
                    "name": path.file_name().map(|name| name.to_string_lossy()),
                    "path": path.display().to_string(),
                },
                "line": frame.line.saturating_sub(1 - self.first_line),
                "column": frame.column.saturating_sub(1 - self.first_column),
            })
        };
        let frames: Vec<_> = stop.frames.iter().enumerate().skip(start).take(levels).map(frame).collect();
        Ok(json!({ "stackFrames": frames, "totalFrames": stop.frames.len() }))
    }

    fn scopes(&self, arguments: &Value) -> Result<Value, String> {
        let stop = self.stop()?;
        let frame = count(arguments, "frameId");
        let registers = json!({ "name": "Registers (a change is a poke)", "variablesReference": AREAS, "expensive": true });
        let mut scopes = vec![registers];
        // The engine shows the variables of the innermost function; after a failure they are gone.
        if frame == 0 && !matches!(stop.reason, StopReason::Failure(_)) {
            let variables = json!({
                "name": "Variables", "presentationHint": "locals", "variablesReference": VARIABLES, "expensive": false,
            });
            scopes.insert(0, variables);
        }
        Ok(json!({ "scopes": scopes }))
    }

    fn output(&mut self, answers: &mut Vec<Value>, category: &str, text: &str) {
        let text = format!("{}\n", text.trim_end_matches('\n'));
        self.event("output", json!({ "category": category, "output": text }), answers);
    }

    fn event(&mut self, name: &str, body: Value, answers: &mut Vec<Value>) {
        self.sent += 1;
        answers.push(json!({ "seq": self.sent, "type": "event", "event": name, "body": body }));
    }
}

/// The problem of a scenario that has not passed.
fn problem(outcome: &Outcome) -> Option<String> {
    match outcome {
        Outcome::Failed(failure) => Some(failure.to_string()),
        Outcome::Broken(mistake) => Some(mistake.to_string()),
        Outcome::Died(text) | Outcome::NotRun(text) => Some(text.clone()),
        Outcome::Passed => None,
        Outcome::Skipped(reason) => Some(format!("skipped: {reason}")),
    }
}

/// A text among the arguments of a request.
fn text(arguments: &Value, name: &str) -> Result<String, String> {
    arguments[name].as_str().map(str::to_owned).ok_or_else(|| format!("`{name}` is missing; right is a text"))
}

/// A number among the arguments of a request.
fn number(arguments: &Value, name: &str) -> Result<u64, String> {
    arguments[name].as_u64().ok_or_else(|| format!("`{name}` is missing; right is a number"))
}

/// A count or index among the arguments of a request; 0 if it is missing.
fn count(arguments: &Value, name: &str) -> usize {
    arguments[name].as_u64().and_then(|number| usize::try_from(number).ok()).unwrap_or(0)
}
