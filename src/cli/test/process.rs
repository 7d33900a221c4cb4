//! One process per scenario: a crash of a scenario affects neither other scenarios nor the report.

use super::LimitArgs;
use super::events::Moment;
use super::scenario::Message;
use crate::cli::demo::command;
use crate::cli::error::CliError;
use crate::input_file::{self, is_standard};
use crate::memory::limits;
use crate::runtime;
use crate::script::{Outcome, Report};
use crate::time::short;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// Additional real time for a process after its limit. The process must start, and it checks the limit only between two
/// steps of its script.
const GRACE: Duration = Duration::from_secs(10);
/// Pause between two checks for an interrupt.
const POLL: Duration = Duration::from_millis(20);
/// Longest line that a process may send: at most 1 MiB of output, which can be six times longer in JSON, or a report.
pub(super) const LONGEST_LINE: u64 = 16 << 20;
/// Number of bytes of the error output that are kept.
const COMPLAINTS: usize = 4096;

/// Options for running scenarios.
pub(crate) struct RunOptions {
    /// The instance to run on; `None` for a separate plant.
    pub attach: Option<String>,
    /// Folder of the device for scenarios that name no plant. `None`: they get the built-in plant.
    pub device: Option<PathBuf>,
    /// Limits of each scenario.
    pub limits: LimitArgs,
    /// True if scenarios without expectations pass.
    pub allow_empty: bool,
}

/// Raises the memory limit of this process, so that scenarios can have as much memory as an emulator. Their processes
/// inherit the limit.
///
/// # Errors
/// The limit is too low.
pub(crate) fn allow_memory() -> Result<(), CliError> {
    limits::space::allow_memory(runtime::MEMORY).map_err(|limit| CliError::LimitedMemory { limit })
}

/// Runs a scenario in a separate process. Ends it early when `stop` returns true. Passes its sections and its output to
/// `heard`.
pub(crate) fn run(
    file: &Path,
    setting: &RunOptions,
    stop: impl Fn() -> bool,
    heard: impl Fn(&Moment<'_>),
) -> Report {
    let mut report = match Scenario::start(file, setting) {
        Ok(scenario) => scenario.watch(file, setting.limits.max_real_time, stop, heard),
        Err(error) => died(file, &error.to_string()),
    };
    if !setting.allow_empty {
        report.refuse_empty();
    }
    report
}

/// Creates the report of a scenario for which the process sent no result.
pub(crate) fn died(file: &Path, why: &str) -> Report {
    Report::bare(file.to_owned(), Outcome::Died(format!("{}: {why}", file.display())))
}

/// A running process. Dropping this value kills the process.
struct Scenario {
    child: Child,
    began: SystemTime,
    started: Instant,
    messages: Receiver<Message<'static>>,
    complaints: Option<JoinHandle<String>>,
    /// Memory that the process may use, in MiB.
    max_memory: u64,
}

impl Scenario {
    fn start(file: &Path, setting: &RunOptions) -> Result<Self, CliError> {
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
        if let Some(dir) = &setting.device {
            command.arg("--device").arg(dir);
        }
        command.arg("--").arg(file).stdout(Stdio::piped()).stderr(Stdio::piped());
        let script = match is_standard(file) {
            true => {
                command.stdin(Stdio::piped());
                input_file::read_bytes(file, input_file::LONGEST_SCRIPT).map_err(failed)?
            }
            false => Vec::new(),
        };
        let (send, messages) = mpsc::channel();
        let (began, started) = (SystemTime::now(), Instant::now());
        let child = command.spawn().map_err(failed)?;
        let mut this = Self { child, began, started, messages, complaints: None, max_memory };
        if let Some(mut input) = this.child.stdin.take() {
            // The longest script fits into the buffer of the pipe, so this write does not block. An error is ignored:
            // it means that the process has ended, which a later step reports.
            let _ = input.write_all(&script);
        }
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

    /// Receives messages until the process has ended or must be ended.
    fn watch(
        mut self,
        file: &Path,
        max_real_us: u64,
        stop: impl Fn() -> bool,
        heard: impl Fn(&Moment<'_>),
    ) -> Report {
        let longest = Duration::from_micros(max_real_us).saturating_add(GRACE);
        let (mut printed, mut ended, mut killed) = (String::new(), None, None);
        loop {
            match self.messages.recv_timeout(POLL) {
                Ok(Message::Printed(text)) => {
                    heard(&Moment::Prints(&text));
                    printed.push_str(&text);
                }
                Ok(Message::Section { name, time_us }) => heard(&Moment::Section { name: &name, time_us }),
                Ok(Message::Ended(report)) => ended = Some(report),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) if killed.is_some() => {}
                Err(RecvTimeoutError::Timeout) if stop() => killed = Some("interrupted".to_owned()),
                Err(RecvTimeoutError::Timeout) if self.started.elapsed() > longest => {
                    killed = Some(format!(
                        "killed: after {} of real time (--max-real-time) it was still at the same step",
                        short(max_real_us)
                    ));
                }
                Err(RecvTimeoutError::Timeout) => continue,
            }
            if killed.is_some() {
                // The process may have ended by itself.
                let _ = self.child.kill();
            }
        }
        let status = self.end();
        let (started, took) = (self.began, self.started.elapsed());
        match ended {
            Some(report) => Report { file: file.to_owned(), printed, ..*report },
            None => {
                let why = killed.unwrap_or_else(|| died_of(&status, &self.complaints(), self.max_memory));
                Report { printed, started, took, ..died(file, &why) }
            }
        }
    }

    /// Waits for the end of the process, which has already closed its output.
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

    /// Returns the error output of the process. The process must have ended.
    fn complaints(&mut self) -> String {
        // The thread does not panic.
        self.complaints.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }
}

impl Drop for Scenario {
    fn drop(&mut self) {
        // The results are ignored: `kill` and `wait` fail if the process has ended already, which is the usual case.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Explains why a process sent no result.
fn died_of(status: &io::Result<ExitStatus>, complaints: &str, max_memory: u64) -> String {
    let status = match status {
        Ok(status) => status.to_string(),
        Err(reason) => reason.to_string(),
    };
    let mut lines: String = complaints.lines().map(|line| format!("\n  {line}")).collect();
    // The standard library prints this text before it ends the process.
    if complaints.starts_with("memory allocation of ") {
        let other = limits::describe_space_limit();
        lines +=
            &format!("\n  the scenario needs more memory than the {max_memory} MiB of --max-memory{other}");
    }
    format!("its process ended before the scenario was finished ({status}){lines}")
}

/// Reads messages of a process, until the process ends or sends an invalid line.
fn read_messages(out: impl Read) -> impl Iterator<Item = Message<'static>> {
    let mut out = BufReader::new(out);
    std::iter::from_fn(move || {
        let mut line = Vec::new();
        out.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line).ok()?;
        serde_json::from_slice(&line).ok()
    })
}

/// Returns the beginning of the error output of a process. Reads and discards the rest, so that the process does not
/// block.
fn read_complaints(mut err: impl Read) -> String {
    let mut text = Vec::new();
    let _ = err.by_ref().take(COMPLAINTS as u64).read_to_end(&mut text);
    let _ = io::copy(&mut err, &mut io::sink());
    String::from_utf8_lossy(&text).into_owned()
}
