//! `commram test-scenario`: the process of scenarios. It writes their output and their results to the standard output, as
//! lines of JSON for `commram test`.
//!
//! With `--several` the process reads the names of scenarios from its standard input and runs one after the other, each
//! with a new plant and a new engine in a new thread. After each scenario it checks that the scenario has left no file
//! open, no thread running and little memory in use. Otherwise it ends, and `commram test` starts another process.

use super::LimitArgs;
use super::process::LONGEST_LINE;
use crate::cli::demo::end_with;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::devices::folder;
use crate::devices::folder::edited::allow_further_folders;
use crate::input_file::is_standard;
use crate::memory::limits::space;
use crate::plant::PlantConfig;
use crate::script::{Bench, Limits, Outcome, Report, UnnamedPlant, run_observed, with_stack};
use rustix::process::{Resource, Rlimit};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The process of scenarios of `commram test`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram test-scenario master.rhai")]
pub(crate) struct Args {
    /// The script
    #[arg(required_unless_present = "several", value_name = "FILE")]
    file: Option<PathBuf>,
    /// Read the names of scripts from the standard input, each with a zero at its end
    #[arg(long, hide = true, conflicts_with_all = ["file", "attach"])]
    several: bool,
    /// Run on this running instance
    #[arg(long, value_name = "NAME", value_parser = crate::cli::instance_name)]
    attach: Option<String>,
    /// Folder of the device that the scenario gets if it names no plant; without this option, the device in whose folder it is
    #[arg(long, value_name = "DIR", conflicts_with = "attach")]
    device: Option<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
    /// End when the process with this id ends
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
}

/// A message to the parent process.
#[derive(Serialize, Deserialize)]
pub(crate) enum Message<'a> {
    /// Output of the script.
    Printed(Cow<'a, str>),
    /// A section begins at an emulated time, in microseconds.
    Section { name: Cow<'a, str>, time_us: u64 },
    /// Final report of the scenario.
    Ended(Box<Report>),
    /// The process can run another scenario.
    Ready,
}

/// The byte after the name of a scenario in the standard input of the process.
pub(super) const END_OF_NAME: u8 = 0;
/// The byte before the error output of a scenario.
pub(super) const BEGIN_OF_COMPLAINTS: u8 = 0;
/// Memory in bytes that a process may keep after a scenario. It includes the memory of the allocator for later scenarios.
const KEPT_MEMORY: u64 = 16 << 20;

/// Runs one scenario in this process, or several, for `commram test`, which has started the process.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if let Some(parent) = args.parent {
        end_with(parent)?;
    }
    // A crash is reported as a failure, so a core dump is not needed.
    let limits = lowered(Resource::Core, 0, 0);
    set_limits(Resource::Core, limits)?;
    let most = args.limits.max_memory << 20;
    let limits = lowered(Resource::Data, most, most + KEPT_MEMORY);
    if let Some(file) = &args.file {
        set_limits(Resource::Data, limits)?;
        return with_stack(|| play(args, file)).map_err(process_error)?;
    }
    let mut files = files()?;
    let mut first = None;
    while let Some(file) = next(&mut files).map_err(process_error)? {
        let is_ready = with_stack(|| {
            let before = Resources::now().map_err(process_error)?;
            let first: &Resources = first.get_or_insert(before);
            // Memory that earlier scenarios have left does not count for this scenario.
            let kept = before.memory.saturating_sub(first.memory);
            let current = limits.current.map(|most| most.saturating_add(kept));
            set_limits(Resource::Data, Rlimit { current, ..limits })?;
            allow_further_folders();
            begin_complaints();
            play(args, &file)?;
            let is_ready = Resources::now().map_err(process_error)?.is_like(first);
            if is_ready {
                send(&Message::Ready)?;
            }
            Ok::<_, CliError>(is_ready)
        });
        if !is_ready.map_err(process_error)?? {
            break;
        }
    }
    Ok(())
}

fn process_error(reason: io::Error) -> CliError {
    CliError::Process { reason }
}

/// Takes the standard input, which then is empty for scenarios.
fn files() -> Result<impl BufRead, CliError> {
    let errors = |errno: rustix::io::Errno| process_error(errno.into());
    let files = rustix::io::fcntl_dupfd_cloexec(io::stdin(), 3).map_err(errors)?;
    let nothing = File::open("/dev/null").map_err(process_error)?;
    rustix::stdio::dup2_stdin(&nothing).map_err(errors)?;
    Ok(BufReader::new(File::from(files)))
}

/// Returns the file of the next scenario, or `None` at the end of the input.
fn next(files: &mut impl BufRead) -> io::Result<Option<PathBuf>> {
    let mut name = Vec::new();
    files.read_until(END_OF_NAME, &mut name)?;
    Ok(name.strip_suffix(&[END_OF_NAME]).map(|name| PathBuf::from(OsStr::from_bytes(name))))
}

/// Separates the error output of a scenario from that of the scenario before it.
fn begin_complaints() {
    output::relay(&[BEGIN_OF_COMPLAINTS]);
}

/// Resources that this process uses.
#[derive(Clone, Copy, Debug)]
struct Resources {
    /// Bytes that count for the limit of memory.
    memory: u64,
    files: usize,
    threads: usize,
}

impl Resources {
    fn now() -> io::Result<Self> {
        let entries = |path| Ok::<_, io::Error>(std::fs::read_dir(path)?.count());
        let (files, threads) = (entries("/proc/self/fd")?, entries("/proc/self/task")?);
        Ok(Self { memory: space::data_in_use(), files, threads })
    }

    /// True if the process uses the same files and threads as at its first scenario, and not much more memory.
    fn is_like(&self, first: &Self) -> bool {
        let memory = self.memory.saturating_sub(first.memory);
        memory <= KEPT_MEMORY && self.files == first.files && self.threads == first.threads
    }
}

fn play(args: &Args, file: &Path) -> Result<(), CliError> {
    let limits = Limits {
        operations: args.limits.max_operations,
        time_us: args.limits.max_time,
        real: Duration::from_micros(args.limits.max_real_time),
    };
    let print = |line: &str| {
        // Sending fails only if the parent has ended. This process then ends with its parent, so the error is ignored.
        let _ = send(&Message::Printed(line.into()));
    };
    let sections = |name: &str, time_us: u64| {
        let _ = send(&Message::Section { name: name.into(), time_us });
    };
    let bench = args.attach.as_deref().map(|instance| attach(instance, limits)).transpose()?;
    let plant = match args.attach {
        None => unnamed_plant(args.device.as_deref(), file),
        Some(_) => None,
    };
    send_report(run_observed(file, bench, plant, limits, print, sections))
}

/// Returns a plant that contains only the device in this folder, and a name of the plant for messages.
pub(in crate::cli) fn plant_of(dir: &Path) -> Result<(String, PlantConfig), CliError> {
    let dir = folder::find(Path::new(""), &dir.display().to_string())?;
    let text = folder::plant_alone(&dir, folder::load(&dir)?.registered.layout);
    Ok((format!("the device {}", dir.display()), PlantConfig::parse("the device", &text)?))
}

/// Returns the plant of a scenario that names none, if it is not the built-in one: the device in the folder `device`, or in
/// whose folder the scenario is. If the device is wrong, only a scenario that needs this plant fails.
pub(in crate::cli) fn unnamed_plant(device: Option<&Path>, file: &Path) -> Option<UnnamedPlant> {
    let dir = device.map_or_else(|| device_of(file), |dir| Some(dir.to_owned()))?;
    Some(match plant_of(&dir) {
        Ok((name, plant)) => (name, Ok(plant)),
        Err(error) => (format!("the device {}", dir.display()), Err(error.to_string())),
    })
}

/// Returns the folder of the device whose directory `tests` contains the scenario.
fn device_of(file: &Path) -> Option<PathBuf> {
    if is_standard(file) {
        return None;
    }
    let directory = Path::new(".").join(file.parent()?).canonicalize().ok()?;
    let mut tests = directory.ancestors().filter(|directory| directory.ends_with("tests"));
    let found = tests.find_map(|tests| tests.parent().filter(|above| above.join("device.toml").is_file()));
    found.map(Path::to_owned)
}

/// Sends the report. If it is longer than the receiver accepts, sends a short report instead.
fn send_report(report: Report) -> Result<(), CliError> {
    let message = Message::Ended(Box::new(report));
    let line = output::json_line(&message)?;
    let Message::Ended(report) = message else { return Ok(()) };
    if line.len() as u64 <= LONGEST_LINE {
        return output::print(&line);
    }
    let why = format!(
        "{}: its report has {} MiB, and the limit is {} MiB: use fewer or shorter texts in section(), and fewer plots",
        report.file.display(),
        (line.len() as u64).div_ceil(1 << 20),
        LONGEST_LINE >> 20
    );
    let short = Report { steps: Vec::new(), findings: Vec::new(), plots: Vec::new(), ..*report };
    send(&Message::Ended(Box::new(Report { outcome: Outcome::Died(why), ..short })))
}

fn send(message: &Message) -> Result<(), CliError> {
    output::print(&output::json_line(message)?)
}

fn attach(instance: &str, limits: Limits) -> Result<Bench, CliError> {
    let client =
        crate::cli::session::Session::open(&crate::cli::Instance::running(instance), limits.time_us)?
            .into_client()?;
    Bench::attach(client).map_err(CliError::Scenario)
}

/// Returns the limits of a resource of this process, lowered to `current` and `maximum` unless they are lower already.
fn lowered(resource: Resource, current: u64, maximum: u64) -> Rlimit {
    let now = rustix::process::getrlimit(resource);
    let lower = |limit: Option<u64>, most: u64| Some(limit.map_or(most, |limit| limit.min(most)));
    Rlimit { current: lower(now.current, current), maximum: lower(now.maximum, maximum) }
}

fn set_limits(resource: Resource, limits: Rlimit) -> Result<(), CliError> {
    rustix::process::setrlimit(resource, limits).map_err(|errno| process_error(errno.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_ends_if_a_scenario_has_left_something() {
        let first = Resources { memory: 100 << 20, files: 5, threads: 2 };
        assert!(first.is_like(&first));
        assert!(Resources { memory: 90 << 20, ..first }.is_like(&first));
        assert!(Resources { memory: first.memory + KEPT_MEMORY, ..first }.is_like(&first));
        assert!(!Resources { memory: first.memory + KEPT_MEMORY + 1, ..first }.is_like(&first));
        assert!(!Resources { files: 6, ..first }.is_like(&first));
        assert!(!Resources { threads: 3, ..first }.is_like(&first));
    }

    #[test]
    fn names_of_scenarios_end_with_a_zero() {
        let mut names: &[u8] = b"a.rhai\0in a/b\xff.rhai\0cut";
        let mut name = || next(&mut names).unwrap();
        assert_eq!(name(), Some("a.rhai".into()));
        assert_eq!(name(), Some(PathBuf::from(OsStr::from_bytes(b"in a/b\xff.rhai"))));
        assert_eq!(name(), None);
    }
}
