//! `commram test`: run scenario scripts.

mod line;
mod process;
pub(crate) mod scenario;

use super::demo::Interrupts;
use super::error::CliError;
use super::table::{self, Format, FormatArg};
use super::{output, time};
use crate::script::{Limits, Outcome, Report, junit};
use line::{Line, summary};
use process::Setting;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Duration;

/// Run scenario scripts.
///
/// A scenario says in Rhai what to do with a plant and what to expect of it; docs/scenarios.md has all verbs. Each
/// one runs on a plant of its own, in a process of its own, with a stepped clock.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram test master.rhai
  commram test tests/scenarios --jobs 4 --junit report.xml
  commram test master.rhai --attach default

Exit codes:
  0  all scenarios passed
  1  an expectation was not met, or a scenario does not end or crashes
  2  wrong use: a script is missing, does not compile or uses a verb wrongly")]
pub(crate) struct Args {
    /// Scripts; of a directory all files that end in .rhai, in the order of their names
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Write a JUnit report for CI servers to this file
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// How many scenarios run at the same time [default: one per processor]
    #[arg(long, value_name = "N")]
    jobs: Option<NonZero<usize>>,
    /// Run on this running instance, one scenario after the other, instead of on plants of their own
    #[arg(long, value_name = "NAME", conflicts_with = "jobs", value_parser = super::instance_name)]
    attach: Option<String>,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    format: FormatArg,
}

/// What a scenario may use up.
#[derive(clap::Args, Clone, Copy)]
pub(crate) struct LimitArgs {
    /// Steps of a script after which it counts as endless
    #[arg(long, value_name = "N", default_value_t = Limits::default().operations)]
    max_operations: u64,
    /// Emulated time after which a scenario counts as endless
    #[arg(long, value_name = "TIME", default_value = "1h", value_parser = time::parse)]
    max_time: u64,
    /// Real time after which a scenario counts as endless
    #[arg(long, value_name = "TIME", default_value = "10min", value_parser = time::parse)]
    max_real_time: u64,
    /// Memory that a scenario may take, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 1024, value_parser = clap::value_parser!(u64).range(64..1 << 20))]
    max_memory: u64,
}

/// Runs the scenarios and reports.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let interrupts = Interrupts::catch()?;
    let files = scripts(&args.files)?;
    let setting = Setting { attach: args.attach.clone(), limits: args.limits };
    let mut reports = Vec::with_capacity(files.len());
    let mut shown = Ok(());
    if let Err(error) = reachable(args.attach.as_deref()) {
        reports.extend(files.iter().map(|file| process::died(file, &error.to_string())));
        shown = Err(error);
    } else {
        let jobs = if setting.attach.is_some() { 1 } else { jobs(args.jobs, files.len()) };
        // Set when the output cannot be written and there is no other report.
        let enough = AtomicBool::new(false);
        let stop = || interrupts.any() || enough.load(Ordering::Relaxed);
        run_all(&files, jobs, &setting, &stop, |report| {
            if shown.is_ok() && args.format.format == Format::Text {
                shown = output::print(&line::text(&report));
                enough.store(shown.is_err() && args.junit.is_none(), Ordering::Relaxed);
            }
            reports.push(report);
        })?;
        let last = || match args.format.format {
            Format::Text => output::print(&summary(&reports)),
            format => {
                table::print(format, &reports.iter().map(Line::of).collect::<Vec<_>>(), |_| String::new())
            }
        };
        shown = shown.and_then(|()| last());
    }
    // Whatever else goes wrong, this report is written.
    let written = args.junit.as_ref().map_or(Ok(()), |path| write_junit(path, &reports));
    shown.and(written)?;
    if interrupts.any() { Err(CliError::Interrupted) } else { verdict(&reports) }
}

/// The scripts themselves, where directories are named.
fn scripts(named: &[PathBuf]) -> Result<Vec<PathBuf>, CliError> {
    let mut files = Vec::new();
    for path in named {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let wrong = |right: String| CliError::Argument { text: path.display().to_string(), right };
        let entries = path.read_dir().map_err(|reason| wrong(reason.to_string()))?;
        let mut inside: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        inside.retain(|file| file.is_file() && file.extension().is_some_and(|ending| ending == "rhai"));
        if inside.is_empty() {
            return Err(wrong("this directory has no files that end in .rhai".to_owned()));
        }
        inside.sort();
        files.append(&mut inside);
    }
    Ok(files)
}

fn jobs(asked: Option<NonZero<usize>>, files: usize) -> usize {
    let jobs = asked.or_else(|| std::thread::available_parallelism().ok());
    jobs.map_or(1, NonZero::get).min(files)
}

/// Runs all files, so many at a time, until told to `stop`; hands over the reports in the order of the files.
fn run_all(
    files: &[PathBuf],
    jobs: usize,
    setting: &Setting,
    stop: &(impl Fn() -> bool + Sync),
    mut take: impl FnMut(Report),
) -> Result<(), CliError> {
    let next = AtomicUsize::new(0);
    let (send, receive) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            let (send, next) = (send.clone(), &next);
            let work = move || {
                while let Some((index, file)) = {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    files.get(index).map(|file| (index, file))
                } {
                    // The receiver lives until all have been received.
                    let _ = send.send((index, process::run(file, setting, stop)));
                }
            };
            let thread = std::thread::Builder::new().spawn_scoped(scope, work);
            thread.map_err(|reason| CliError::Process { reason })?;
        }
        drop(send);
        let mut waiting: Vec<Option<Report>> = files.iter().map(|_| None).collect();
        let mut taken = 0;
        for (index, report) in receive {
            if let Some(place) = waiting.get_mut(index) {
                *place = Some(report);
            }
            while let Some(report) = waiting.get_mut(taken).and_then(Option::take) {
                taken += 1;
                take(report);
            }
        }
        Ok(())
    })
}

/// Finds out whether the instance to attach to is there, before the first scenario misses it.
#[cfg(feature = "channel")]
fn reachable(instance: Option<&str>) -> Result<(), CliError> {
    instance.map_or(Ok(()), |instance| super::session::Session::open(instance, 0).map(drop))
}

#[cfg(not(feature = "channel"))]
fn reachable(instance: Option<&str>) -> Result<(), CliError> {
    instance.map_or(Ok(()), |_| Err(CliError::NoChannel { command: "test --attach" }))
}

fn write_junit(path: &Path, reports: &[Report]) -> Result<(), CliError> {
    let wrong = |right: String| CliError::Argument { text: path.display().to_string(), right };
    let text = junit(reports).map_err(|reason| wrong(reason.to_string()))?;
    std::fs::write(path, text).map_err(|reason| wrong(reason.to_string()))
}

/// What the exit code says.
fn verdict(reports: &[Report]) -> Result<(), CliError> {
    let any = |is: fn(&Outcome) -> bool| reports.iter().any(|report| is(&report.outcome));
    if any(|outcome| matches!(outcome, Outcome::Broken(_))) {
        return Err(CliError::ReportedWrongUse);
    }
    let failed = any(|outcome| matches!(outcome, Outcome::Failed(_) | Outcome::Died(_)));
    if failed { Err(CliError::Reported) } else { Ok(()) }
}

/// All real time taken.
fn real_time(reports: &[Report]) -> Duration {
    reports.iter().map(|report| report.took).sum()
}
