//! Processes of scenarios: a crash of a scenario affects neither other scenarios nor the report.

use super::LimitArgs;
use super::events::Moment;
use super::scenario::{BEGIN_OF_COMPLAINTS, END_OF_NAME, Message};
use crate::cli::config;
use crate::cli::demo::command;
use crate::cli::error::CliError;
use crate::input_file::{self, is_standard};
use crate::memory::limits;
use crate::runtime;
use crate::script::{Outcome, Report};
use crate::time::short;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ExitStatus, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle, ThreadId};
use std::time::{Duration, Instant, SystemTime};

/// Additional real time for a process after its limit. The process must start, and it checks the limit only between two
/// steps of its script.
const GRACE: Duration = Duration::from_secs(10);
/// Pause between two checks for an interrupt.
const POLL: Duration = Duration::from_millis(20);
/// Maximum number of messages of a process that wait for a slow reader of the events. Then the process waits, too.
const MOST_MESSAGES: usize = 64;
/// Longest line that a process may send: at most 1 MiB of output, which can be six times longer in JSON, or a report.
pub(super) const LONGEST_LINE: u64 = 16 << 20;
/// Number of bytes of the error output that are kept.
const COMPLAINTS: usize = 4096;

/// Options for running scenarios.
pub(crate) struct RunOptions {
    /// The instance to run on; `None` for a separate plant.
    pub attach: Option<String>,
    /// Folder of the device for scenarios that name no plant. `None`: a scenario in the directory `tests` of a device folder
    /// gets this device, and another one the built-in plant.
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

/// Creates the report of a scenario for which the process sent no result.
pub(crate) fn died(file: &Path, why: &str) -> Report {
    Report::bare(file.to_owned(), Outcome::Died(format!("{}: {why}", file.display())))
}

/// Runs scenarios in separate processes. After a scenario, its process is used for further scenarios if it is as it was
/// before ([`super::scenario`]). Dropping this value kills the processes.
#[derive(Default)]
pub(crate) struct Workers {
    /// Processes that wait for a scenario, each with the thread that has started it. A process ends with this thread, so
    /// another thread must not use it.
    idle: Mutex<Vec<(ThreadId, Worker)>>,
    started: AtomicUsize,
}

impl Workers {
    /// Runs a scenario. Ends it early when `stop` returns true. Passes its sections and its output to `heard`.
    pub(crate) fn run(
        &self,
        file: &Path,
        setting: &RunOptions,
        stop: impl Fn() -> bool,
        heard: impl Fn(&Moment<'_>),
    ) -> Report {
        let (began, started) = (SystemTime::now(), Instant::now());
        let mut report = match self.worker(file, setting) {
            Ok(worker) => {
                let run = Run { file, setting, began, started };
                let (report, worker) = run.watch(worker, stop, heard);
                self.lock().extend(worker.map(|worker| (thread::current().id(), worker)));
                report
            }
            Err(error) => died(file, &error.to_string()),
        };
        if !setting.allow_empty {
            report.refuse_empty();
        }
        report
    }

    /// Returns the number of processes that were started.
    pub(crate) fn started(&self) -> usize {
        self.started.load(Ordering::Relaxed)
    }

    /// Returns a process that runs this scenario.
    fn worker(&self, file: &Path, setting: &RunOptions) -> Result<Worker, CliError> {
        // A scenario from the standard input needs its own standard input, and an attached scenario is a client that
        // leaves the instance with its process.
        let is_alone = is_standard(file) || setting.attach.is_some();
        let idle = if is_alone { None } else { self.take_idle() };
        if let Some(mut worker) = idle
            && worker.begin(file).is_ok()
        {
            return Ok(worker);
        }
        self.started.fetch_add(1, Ordering::Relaxed);
        if is_alone {
            return Worker::start(Some(file), setting);
        }
        let mut worker = Worker::start(None, setting)?;
        worker.begin(file).map_err(|reason| CliError::Process { reason })?;
        Ok(worker)
    }

    fn take_idle(&self) -> Option<Worker> {
        let own = thread::current().id();
        let mut idle = self.lock();
        let place = idle.iter().position(|(thread, _)| *thread == own)?;
        let (_, mut worker) = idle.swap_remove(place);
        worker.is_running().then_some(worker)
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(ThreadId, Worker)>> {
        // A thread that panics leaves the list complete.
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A process that runs scenarios one after the other. Dropping this value kills the process.
struct Worker {
    child: Child,
    /// Files of scenarios for the process; `None` if the process runs a single scenario.
    files: Option<ChildStdin>,
    messages: Receiver<Message<'static>>,
    complaints: Option<JoinHandle<String>>,
}

impl Worker {
    /// Starts a process, for a single scenario if `file` is given.
    fn start(file: Option<&Path>, setting: &RunOptions) -> Result<Self, CliError> {
        let failed = |reason| CliError::Process { reason };
        let LimitArgs { max_operations, max_time, max_real_time, max_memory } = setting.limits;
        let mut command = command("test-scenario")?;
        // The configuration has the directories in which scenarios find devices.
        match std::env::var_os(config::VARIABLE) {
            Some(file) => command.env(config::VARIABLE, file),
            None => command.env_remove(config::VARIABLE),
        };
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
        match file {
            Some(file) => command.arg("--").arg(file),
            None => command.arg("--several").stdin(Stdio::piped()),
        };
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let script = match file {
            Some(file) if is_standard(file) => {
                command.stdin(Stdio::piped());
                input_file::read_bytes(file, input_file::LONGEST_SCRIPT).map_err(failed)?
            }
            _ => Vec::new(),
        };
        let (send, messages) = mpsc::sync_channel(MOST_MESSAGES);
        let child = command.spawn().map_err(failed)?;
        let mut this = Self { child, files: None, messages, complaints: None };
        match (file, this.child.stdin.take()) {
            (None, input) => this.files = input,
            (Some(_), Some(mut input)) => {
                // The longest script fits into the buffer of the pipe, so this write does not block. An error is
                // ignored: it means that the process has ended, which a later step reports.
                let _ = input.write_all(&script);
            }
            _ => {}
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

    /// Lets the process run another scenario.
    fn begin(&mut self, file: &Path) -> io::Result<()> {
        let Some(files) = &mut self.files else { return Ok(()) };
        let mut name = file.as_os_str().as_encoded_bytes().to_vec();
        name.push(END_OF_NAME);
        files.write_all(&name)
    }

    fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
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

impl Drop for Worker {
    fn drop(&mut self) {
        // The results are ignored: `kill` and `wait` fail if the process has ended already, which is the usual case.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The run of a scenario in a process.
struct Run<'a> {
    file: &'a Path,
    setting: &'a RunOptions,
    began: SystemTime,
    started: Instant,
}

impl Run<'_> {
    /// Receives messages until the scenario has ended or must be ended. Also returns the process, if it can run another
    /// scenario.
    fn watch(
        self,
        mut worker: Worker,
        stop: impl Fn() -> bool,
        heard: impl Fn(&Moment<'_>),
    ) -> (Report, Option<Worker>) {
        let LimitArgs { max_real_time, max_memory, .. } = self.setting.limits;
        let longest = Duration::from_micros(max_real_time).saturating_add(GRACE);
        let (mut printed, mut ended, mut killed) = (String::new(), None, None);
        let is_ready = loop {
            let message = worker.messages.recv_timeout(POLL);
            // A scenario may send messages without a pause, so the reasons for its end do not wait for a pause.
            if killed.is_none() && stop() {
                killed = Some("interrupted".to_owned());
            } else if killed.is_none() && self.started.elapsed() > longest {
                killed = Some(format!(
                    "killed: after {} of real time (--max-real-time) it was still at the same step",
                    short(max_real_time)
                ));
            }
            match message {
                Ok(Message::Ended(report)) => ended = Some(report),
                Ok(Message::Ready) => break true,
                Err(RecvTimeoutError::Disconnected) => break false,
                // The last messages of a killed process are dropped.
                _ if killed.is_some() => {}
                Ok(Message::Printed(text)) => {
                    heard(&Moment::Prints(&text));
                    printed.push_str(&text);
                }
                Ok(Message::Section { name, time_us }) => heard(&Moment::Section { name: &name, time_us }),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if killed.is_some() {
                // The process may have ended by itself.
                let _ = worker.child.kill();
            }
        };
        let file = self.file;
        let is_reusable = is_ready && killed.is_none() && ended.is_some();
        let status = if is_reusable { None } else { Some(worker.end()) };
        let report = match ended {
            Some(report) => Report { file: file.to_owned(), printed, ..*report },
            None => {
                let why =
                    killed.unwrap_or_else(|| died_of(status.as_ref(), &worker.complaints(), max_memory));
                Report { printed, started: self.began, took: self.started.elapsed(), ..died(file, &why) }
            }
        };
        (report, is_reusable.then_some(worker))
    }
}

/// Explains why a process sent no result.
fn died_of(status: Option<&io::Result<ExitStatus>>, complaints: &str, max_memory: u64) -> String {
    let status = match status {
        Some(Ok(status)) => status.to_string(),
        Some(Err(reason)) => reason.to_string(),
        None => "it still runs".to_owned(),
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

/// Returns the beginning of the error output of a process during its last scenario. Reads and discards the rest, so that
/// the process does not block.
fn read_complaints(err: impl Read) -> String {
    let mut err = BufReader::new(err);
    let mut text = Vec::new();
    while let Ok(bytes) = err.fill_buf()
        && !bytes.is_empty()
    {
        let length = bytes.len();
        let own = match bytes.iter().rposition(|byte| *byte == BEGIN_OF_COMPLAINTS) {
            Some(place) => {
                text.clear();
                bytes.get(place + 1..).unwrap_or_default()
            }
            None => bytes,
        };
        text.extend(own.iter().take(COMPLAINTS - text.len()));
        err.consume(length);
    }
    String::from_utf8_lossy(&text).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complaints_are_those_of_the_last_scenario() {
        let complaints = |bytes: &[u8]| read_complaints(bytes);
        assert_eq!(complaints(b"\0"), "");
        assert_eq!(complaints(b"\0first\n\0second\n"), "second\n");
        assert_eq!(complaints(b"without a beginning"), "without a beginning");
        let long =
            [vec![BEGIN_OF_COMPLAINTS], vec![b'a'; 100_000], vec![BEGIN_OF_COMPLAINTS], vec![b'b'; 50_000]];
        assert_eq!(complaints(&long.concat()), "b".repeat(COMPLAINTS));
    }
}
