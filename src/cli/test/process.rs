//! One scenario, one process: whatever it does to itself, the others and the report are none the worse for it.

use super::LimitArgs;
use super::scenario::Message;
use crate::cli::demo::command;
use crate::cli::error::CliError;
use crate::script::{Outcome, Report};
use crate::time::short;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// How much longer than its real time a process may take: it must start, and it ends itself when its script comes to a
/// next step.
const GRACE: Duration = Duration::from_secs(10);
/// Pause between two looks whether everything is to end.
const POLL: Duration = Duration::from_millis(20);
/// Longest line that a process may send. What it prints is at most 1 MiB, six times that in JSON.
const LONGEST_LINE: u64 = 16 << 20;
/// How much of its complaints is kept.
const COMPLAINTS: usize = 4096;

/// How scenarios are run.
pub(crate) struct Setting {
    /// The instance to run on.
    pub attach: Option<String>,
    /// What each may use up.
    pub limits: LimitArgs,
    /// Whether those that expect nothing pass.
    pub allow_empty: bool,
}

/// Runs a scenario in a process of its own, until told to `stop`.
pub(crate) fn run(file: &Path, setting: &Setting, stop: impl Fn() -> bool) -> Report {
    let mut report = match Scenario::start(file, setting) {
        Ok(scenario) => scenario.watch(file, setting.limits.max_real_time, stop),
        Err(error) => died(file, &error.to_string()),
    };
    if !setting.allow_empty {
        report.refuse_empty();
    }
    report
}

/// The report about a scenario whose process cannot tell anything.
pub(crate) fn died(file: &Path, why: &str) -> Report {
    Report::bare(file.to_owned(), Outcome::Died(format!("{}: {why}", file.display())))
}

/// A process under way. It is killed when this value is dropped.
struct Scenario {
    child: Child,
    began: SystemTime,
    started: Instant,
    messages: Receiver<Message<'static>>,
    complaints: Option<JoinHandle<String>>,
}

impl Scenario {
    fn start(file: &Path, setting: &Setting) -> Result<Self, CliError> {
        let failed = |reason| CliError::Process { reason };
        let LimitArgs { max_operations, max_time, max_real_time, max_memory } = setting.limits;
        let mut command = command("test-scenario")?;
        command.args(["--max-operations", &max_operations.to_string()]);
        command.args(["--max-time", &format!("{max_time}us")]);
        command.args(["--max-real-time", &format!("{max_real_time}us")]);
        command.args(["--max-memory", &max_memory.to_string()]);
        if let Some(instance) = &setting.attach {
            command.args(["--attach", instance]);
        }
        command.arg("--").arg(file).stdout(Stdio::piped()).stderr(Stdio::piped());
        let (send, messages) = mpsc::channel();
        let (began, started) = (SystemTime::now(), Instant::now());
        let child = command.spawn().map_err(failed)?;
        let mut this = Self { child, began, started, messages, complaints: None };
        let (out, err) = (this.child.stdout.take(), this.child.stderr.take());
        let thread = || std::thread::Builder::new();
        let receive = move || {
            for message in out.into_iter().flat_map(read_messages) {
                if send.send(message).is_err() {
                    return;
                }
            }
        };
        thread().spawn(receive).map_err(failed)?;
        let complain = move || err.map(read_complaints).unwrap_or_default();
        this.complaints = Some(thread().spawn(complain).map_err(failed)?);
        Ok(this)
    }

    /// Takes what it tells, until it has ended or must end.
    fn watch(mut self, file: &Path, max_real_us: u64, stop: impl Fn() -> bool) -> Report {
        let longest = Duration::from_micros(max_real_us).saturating_add(GRACE);
        let (mut printed, mut ended, mut killed) = (String::new(), None, None);
        loop {
            match self.messages.recv_timeout(POLL) {
                Ok(Message::Printed(text)) => printed.push_str(&text),
                Ok(Message::Ended(report)) => ended = Some(report),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) if killed.is_some() => {}
                Err(RecvTimeoutError::Timeout) if stop() => killed = Some("interrupted".to_owned()),
                Err(RecvTimeoutError::Timeout) if self.started.elapsed() > longest => {
                    killed = Some(format!(
                        "killed, because after {} of real time (--max-real-time) it was still at the same step",
                        short(max_real_us)
                    ));
                }
                Err(RecvTimeoutError::Timeout) => continue,
            }
            if killed.is_some() {
                // It may have ended by itself.
                let _ = self.child.kill();
            }
        }
        let status = self.end();
        let (started, took) = (self.began, self.started.elapsed());
        match ended {
            Some(report) => Report { file: file.to_owned(), printed, ..*report },
            None => {
                let why = killed.unwrap_or_else(|| died_of(&status, &self.complaints()));
                Report { printed, started, took, ..died(file, &why) }
            }
        }
    }

    /// Its end, which is at hand: it has closed its output.
    fn end(&mut self) -> io::Result<ExitStatus> {
        let since = Instant::now();
        while since.elapsed() < GRACE {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.child.kill()?;
        self.child.wait()
    }

    /// What it has complained about; it must have ended.
    fn complaints(&mut self) -> String {
        // That thread does not panic.
        self.complaints.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}

impl Drop for Scenario {
    fn drop(&mut self) {
        // Both fail if it has ended, as it mostly has.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Why a process has not told how its scenario ended.
fn died_of(status: &io::Result<ExitStatus>, complaints: &str) -> String {
    let status = match status {
        Ok(status) => status.to_string(),
        Err(reason) => reason.to_string(),
    };
    let complaints: String = complaints.lines().map(|line| format!("\n  {line}")).collect();
    format!("its process has not come to the end of the scenario ({status}){complaints}")
}

/// What a process tells, until it ends or says something that cannot be understood.
fn read_messages(out: impl Read) -> impl Iterator<Item = Message<'static>> {
    let mut out = BufReader::new(out);
    std::iter::from_fn(move || {
        let mut line = Vec::new();
        out.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line).ok()?;
        serde_json::from_slice(&line).ok()
    })
}

/// The beginning of what a process complains about; the rest is read, so that it is not held up, and forgotten.
fn read_complaints(mut err: impl Read) -> String {
    let mut text = Vec::new();
    let _ = err.by_ref().take(COMPLAINTS as u64).read_to_end(&mut text);
    let _ = io::copy(&mut err, &mut io::sink());
    String::from_utf8_lossy(&text).into_owned()
}
