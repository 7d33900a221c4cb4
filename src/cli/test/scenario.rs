//! `commram test-scenario`: the process of one scenario. It writes its output and its result to the standard
//! output, as lines of JSON for `commram test`.

use super::LimitArgs;
use super::process::LONGEST_LINE;
use crate::cli::demo::end_with;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::devices::folder;
use crate::plant::PlantConfig;
use crate::script::{Bench, Limits, Outcome, Report, run_observed, with_stack};
use rustix::process::{Resource, Rlimit};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The process of one scenario of `commram test`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram test-scenario master.rhai")]
pub(crate) struct Args {
    /// The script
    file: PathBuf,
    /// Run on this running instance
    #[arg(long, value_name = "NAME", value_parser = crate::cli::instance_name)]
    attach: Option<String>,
    /// Folder of the device that the scenario gets if it names no plant
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
}

/// Runs one scenario in this process, which `commram test` has started for it.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if let Some(parent) = args.parent {
        end_with(parent)?;
    }
    // A crash is reported as a failure, so a core dump is not needed.
    limit(Resource::Core, 0)?;
    limit(Resource::Data, args.limits.max_memory << 20)?;
    with_stack(|| play(args)).map_err(|reason| CliError::Process { reason })?
}

fn play(args: &Args) -> Result<(), CliError> {
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
    let plant = args.device.as_deref().map(plant_of).transpose()?;
    send_report(run_observed(&args.file, bench, plant, limits, print, sections))
}

/// Returns a plant that contains only the device in this folder, and a name of the plant for messages.
pub(in crate::cli) fn plant_of(dir: &Path) -> Result<(String, PlantConfig), CliError> {
    let dir = folder::find(Path::new(""), &dir.display().to_string())?;
    let text = folder::plant_alone(&dir, folder::load(&dir)?.registered.layout);
    Ok((format!("the device {}", dir.display()), PlantConfig::parse("the device", &text)?))
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

/// Lowers a resource limit of this process, unless it is lower already.
fn limit(resource: Resource, most: u64) -> Result<(), CliError> {
    let now = rustix::process::getrlimit(resource);
    let lower = |limit: Option<u64>| Some(limit.map_or(most, |limit| limit.min(most)));
    let limits = Rlimit { current: lower(now.current), maximum: lower(now.maximum) };
    rustix::process::setrlimit(resource, limits).map_err(|errno| CliError::Process { reason: errno.into() })
}
