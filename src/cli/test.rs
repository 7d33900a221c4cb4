//! `commram test`: run scenario scripts.

mod events;
mod html;
mod line;
mod merge;
mod origin;
pub(crate) mod process;
mod progress;
mod report_file;
mod round;
pub(crate) mod scenario;
mod selection;
mod watch;

use super::demo::Interrupts;
use super::error::CliError;
use super::given;
use super::overwrite::refuse_inputs;
use super::table::{self, Format};
use super::{output, time};
use crate::input_file;
use crate::output_file;
use crate::plural::plural;
use crate::script::{DEFINITIONS, Limits, Outcome, Report, junit, junit_of_shard};
use events::{Events, Moment};
use line::{Line, ScenarioRow, summary};
use process::RunOptions;
use report_file::ReportFile;
use round::Round;
use selection::Shard;
use std::io;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use watch::WatchedFiles;

/// Run scenario scripts.
///
/// A scenario is a Rhai script that controls a plant and contains expectations; docs/reference/scenarios.md
/// describes all verbs. Each scenario runs on a separate plant with a stepped clock, in a process that runs one scenario
/// after the other.
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    disable_help_subcommand = true
)]
#[command(after_help = "\
Examples:
  commram test master.rhai
  commram test tests/scenarios --jobs 4 --junit report.xml
  commram test tests/scenarios --report html=report.html --report json=report.json
  commram test . --filter '*baps*' --list
  commram test . --shard 1/3
  commram test merge report-*.xml --output report.xml
  commram test . --watch
  commram test . --format events
  commram test - <master.rhai
  commram test master.rhai --attach default
  commram test --definitions

Exit codes:
  0    all scenarios passed
  1    an expectation failed, or a scenario has no expectation, throws, does not end or crashes
  2    wrong use: a script is missing, does not compile or uses a verb wrongly
  3    all scenarios passed, but a report cannot be written; or the instance to attach to is not running
  4    all scenarios passed, but the output cannot be written
  130  ended by Ctrl-C or a signal; the reports are written")]
pub(crate) struct Args {
    #[command(subcommand)]
    inner: Option<TestCommand>,
    /// Scripts; - is the standard input. A directory means all .rhai files in it and its subdirectories, in the order
    /// of their names, except files that others import and that only define functions
    #[arg(add = super::complete::files(&["rhai"]), value_name = "FILE", required_unless_present = "definitions")]
    files: Vec<PathBuf>,
    /// Only scenarios whose path contains this text; with * and ? it is a pattern for the whole path or the name;
    /// can be given several times
    #[arg(long, value_name = "TEXT", value_parser = given::text("write a part of the path of a scenario, for example handshake"))]
    filter: Vec<String>,
    /// Only every Nth scenario, beginning with the Ith, to distribute the work over N machines
    #[arg(long, value_name = "I/N", value_parser = Shard::parse)]
    shard: Option<Shard>,
    /// Like --shard, with I counted from 0, as the index of a Kubernetes job
    #[arg(long, value_name = "I/N", value_parser = Shard::parse_index, conflicts_with = "shard")]
    shard_index: Option<Shard>,
    /// Only list the scenarios
    #[arg(long, conflicts_with_all = ["junit", "watch"])]
    list: bool,
    /// Start no further scenarios after the first one that does not pass
    #[arg(long)]
    fail_fast: bool,
    /// Accept scenarios without expectations
    #[arg(long)]
    allow_empty: bool,
    /// Write a JUnit report for CI servers to this file
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write a report into this file: html, a self-contained page for people (commram-report.html), or json
    /// (commram-report.json), which `commram test merge` can read; can be given once for each kind
    #[arg(long, value_name = "KIND[=FILE]", value_parser = ReportFile::parse, conflicts_with_all = ["list", "watch"])]
    report: Vec<ReportFile>,
    /// Number of scenarios that run at the same time [default: one per processor]
    #[arg(long, value_name = "N", value_parser = super::number::jobs)]
    jobs: Option<NonZero<usize>>,
    /// After the first run, run scenarios again when their scripts, imports or plant files change, until Ctrl-C
    #[arg(long, conflicts_with = "junit")]
    watch: bool,
    /// Run on this running instance, one scenario after the other, instead of on separate plants
    #[arg(add = super::complete::instances(), long, value_name = "NAME", conflicts_with = "jobs", value_parser = super::instance_name)]
    attach: Option<String>,
    /// Write only the definitions of the verbs into this directory, for editors that know Rhai
    #[arg(
        long,
        value_name = "DIR",
        num_args = 0..=1,
        default_missing_value = ".rhai/definitions",
        conflicts_with_all = ["files", "junit", "watch", "list"]
    )]
    definitions: Option<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
    /// Output format
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = TestFormat::Text)]
    format: TestFormat,
}

/// Output format of the results.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum TestFormat {
    /// Lines for people
    Text,
    /// An array of objects
    Json,
    /// Comma-separated values (RFC 4180) with a head line
    Csv,
    /// A Markdown table
    Md,
    /// An object per line for each event of a scenario, as it happens
    Events,
}

impl TestFormat {
    /// Returns the format of a table; `None` for events.
    fn table(self) -> Option<Format> {
        match self {
            Self::Text => Some(Format::Text),
            Self::Json => Some(Format::Json),
            Self::Csv => Some(Format::Csv),
            Self::Md => Some(Format::Md),
            Self::Events => None,
        }
    }
}

impl Args {
    fn shard(&self) -> Option<Shard> {
        self.shard.or(self.shard_index)
    }

    /// The files of the reports.
    fn outputs(&self) -> impl Iterator<Item = &PathBuf> {
        self.junit.iter().chain(self.report.iter().map(|file| &file.path))
    }

    /// Returns how the results are shown.
    ///
    /// # Errors
    /// The options would send both the events and a report to the standard output.
    fn shown(&self) -> Result<Shown, CliError> {
        let beside_report = self.outputs().any(|path| input_file::is_standard(path));
        let format = self.format.table();
        if format.is_none() && beside_report {
            return Err(CliError::Argument {
                text: "--format events".to_owned(),
                right: "a report goes to the standard output; write it into a file".to_owned(),
            });
        }
        Ok(Shown { format, shard: self.shard(), beside_report })
    }
}

/// How the results of a round are shown.
#[derive(Clone, Copy)]
struct Shown {
    /// `None` for events.
    format: Option<Format>,
    shard: Option<Shard>,
    /// True if a report goes to the standard output. The results then go to the standard error output, so that the
    /// report stays readable for programs.
    beside_report: bool,
}

impl Shown {
    fn print(self, text: &str) -> Result<(), CliError> {
        if self.beside_report {
            output::relay(text.as_bytes());
            return Ok(());
        }
        output::print_while_read(text.as_bytes())
    }
}

/// Further commands of `commram test`.
#[derive(clap::Subcommand)]
enum TestCommand {
    Merge(merge::Args),
}

/// Limits of a scenario.
#[derive(clap::Args, Clone, Copy)]
pub(crate) struct LimitArgs {
    /// Number of steps of the interpreter after which a scenario counts as endless. A statement takes several steps, a
    /// call of a built-in function takes one
    #[arg(long, value_name = "N", default_value_t = Limits::default().operations, value_parser = super::number::positive::<u64>())]
    max_operations: u64,
    /// Emulated time after which a scenario counts as endless
    #[arg(long, value_name = "TIME", default_value = "1h", value_parser = time::parse)]
    max_time: u64,
    /// Real time after which a scenario counts as endless
    #[arg(long, value_name = "TIME", default_value = "10min", value_parser = time::parse)]
    max_real_time: u64,
    /// Memory that a scenario may take, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 1024, value_parser = super::number::within::<u64>(64..=(1 << 20) - 1))]
    max_memory: u64,
}

impl LimitArgs {
    /// Real time after which a scenario counts as endless, in microseconds.
    pub(crate) fn max_real_time(&self) -> u64 {
        self.max_real_time
    }
}

/// Runs scenarios of the device in the folder `dir`. Scenarios that name no plant get a plant with only this device.
pub(crate) fn run_for_device(
    dir: &Path,
    files: &[PathBuf],
    limits: LimitArgs,
    format: Format,
) -> Result<(), CliError> {
    process::allow_memory()?;
    let interrupts = Interrupts::catch()?;
    let files = selection::scenarios(files, &[], None)?;
    let setting = RunOptions { attach: None, device: Some(dir.to_owned()), limits, allow_empty: false };
    let round = Round { setting, jobs: None, fail_fast: false };
    let shown = Shown { format: Some(format), shard: None, beside_report: false };
    let (reports, shown) = play_round(&round, &files, shown, &interrupts)?;
    let ending = if interrupts.any() {
        Err(CliError::Interrupted)
    } else {
        verdict(reports.iter().map(|report| &report.outcome))
    };
    first_of(ending, [shown])
}

/// Runs the scenarios, and prints and writes their results.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if let Some(TestCommand::Merge(args)) = &args.inner {
        return merge::run(args);
    }
    if let Some(directory) = &args.definitions {
        return define(directory);
    }
    check_reports(args)?;
    args.shown()?;
    process::allow_memory()?;
    let interrupts = Interrupts::catch()?;
    let files = selection::scenarios(&args.files, &args.filter, args.shard())?;
    check_input(args, &files)?;
    check_outputs(args, files.iter())?;
    if args.list {
        let format = args.format.table().ok_or_else(|| CliError::Argument {
            text: "--format events".to_owned(),
            right: "a list has no events; use --format json".to_owned(),
        })?;
        return list(format, &files);
    }
    if args.watch {
        return super::pause::following(|| watch(args, files, &interrupts));
    }
    let (reports, shown, ending) = match reachable(args.attach.as_deref()) {
        Ok(()) => {
            let (reports, shown) = play(args, &files, &interrupts)?;
            let ending = if interrupts.any() {
                Err(CliError::Interrupted)
            } else {
                verdict(reports.iter().map(|report| &report.outcome))
            };
            (reports, shown, ending)
        }
        Err(error) => {
            let reports = files.iter().map(|file| process::died(file, &error.to_string())).collect();
            (reports, Ok(()), Err(error))
        }
    };
    check_outputs(args, reports.iter().flat_map(|report| &report.reads))?;
    // The reports are written even after other errors.
    let written = args.junit.as_ref().map_or(Ok(()), |path| write_junit(path, args.shard(), &reports));
    let others =
        args.report.iter().map(|file| write_report(&file.path, &file.content(&reports, args.shard())?));
    let others: Vec<_> = others.collect();
    // If the reader of the output has gone, this is no error: the exit code depends only on the scenarios.
    let shown =
        shown.or_else(|error| if matches!(error, CliError::BrokenPipe) { Ok(()) } else { Err(error) });
    first_of(ending, [shown, written].into_iter().chain(others))
}

/// Returns the first error, and prints the other errors, so that a missing report does not hide the verdict.
fn first_of(
    ending: Result<(), CliError>,
    others: impl IntoIterator<Item = Result<(), CliError>>,
) -> Result<(), CliError> {
    others.into_iter().fold(ending, |first, other| match (first, other) {
        (Err(first), Err(other)) => {
            output::complain(&other.to_string());
            Err(first)
        }
        (first, other) => first.and(other),
    })
}

/// Reads the standard input if it is a scenario, for the process of the scenario. Refuses `--watch` with the standard
/// input.
fn check_input(args: &Args, files: &[PathBuf]) -> Result<(), CliError> {
    let Some(file) = files.iter().find(|file| input_file::is_standard(file)) else { return Ok(()) };
    let wrong = |right: String| CliError::Argument { text: "-".to_owned(), right };
    if args.watch {
        return Err(wrong("the standard input does not change; omit --watch".to_owned()));
    }
    input_file::read_bytes(file, input_file::LONGEST_SCRIPT).map_err(|reason| wrong(reason.to_string()))?;
    Ok(())
}

/// Refuses a report in the file of a scenario, an import or a plant.
fn check_outputs<'a>(args: &Args, inputs: impl Iterator<Item = &'a PathBuf> + Clone) -> Result<(), CliError> {
    args.outputs().try_for_each(|output| refuse_inputs(Some(output), inputs.clone().map(PathBuf::as_path)))
}

/// Creates the missing directories of the reports. Refuses two reports in one file: the second would replace the first.
fn check_reports(args: &Args) -> Result<(), CliError> {
    let junit = args.junit.iter().map(|path| (format!("--junit {}", path.display()), path));
    let others = args.report.iter().map(|file| (format!("--report {file}"), &file.path));
    let reports: Vec<_> = junit.chain(others).collect();
    for (_, path) in &reports {
        // The comparison of paths needs existing directories. If the directory cannot be created, writing the report
        // fails, and that error is printed.
        let _ = create_directory(path);
    }
    for (place, (option, path)) in reports.iter().enumerate() {
        if let Some((other, _)) =
            reports.iter().skip(place + 1).find(|(_, other)| output_file::is_same(path, other))
        {
            return Err(CliError::Argument {
                text: format!("{option} {other}"),
                right: "both name the same file; give each report a separate one".to_owned(),
            });
        }
    }
    Ok(())
}

fn define(directory: &Path) -> Result<(), CliError> {
    if input_file::is_standard(directory) {
        return output::print(DEFINITIONS);
    }
    let path = directory.join("commram.d.rhai");
    output_file::create_own_place(directory)
        .map_err(|reason| CliError::File { path: path.clone(), reason })?;
    write(&path, DEFINITIONS)?;
    output::print(&output::harmless(&format!("{}\n", path.display())))
}

fn list(format: Format, files: &[PathBuf]) -> Result<(), CliError> {
    let rows: Vec<_> = files.iter().map(|file| ScenarioRow::of(file)).collect();
    let lines = || files.iter().map(|file| output::harmless(&file.display().to_string()) + "\n").collect();
    table::print(format, &rows, |_| lines())
}

/// Runs these scenarios once and shows their results. The second value is the error of the output:
/// [`CliError::BrokenPipe`] if the output has no reader.
fn play(
    args: &Args,
    files: &[PathBuf],
    interrupts: &Interrupts,
) -> Result<(Vec<Report>, Result<(), CliError>), CliError> {
    let round = Round {
        setting: RunOptions {
            attach: args.attach.clone(),
            device: None,
            limits: args.limits,
            allow_empty: args.allow_empty,
        },
        jobs: if args.attach.is_some() { NonZero::new(1) } else { args.jobs },
        fail_fast: args.fail_fast,
    };
    play_round(&round, files, args.shown()?, interrupts)
}

/// Runs the scenarios of a round. Shows their results, or their events if the format is not a table.
fn play_round(
    round: &Round,
    files: &[PathBuf],
    results: Shown,
    interrupts: &Interrupts,
) -> Result<(Vec<Report>, Result<(), CliError>), CliError> {
    let mut reports = Vec::with_capacity(files.len());
    let mut shown = Ok(());
    let Some(format) = results.format else {
        let events = Events::default();
        events.start(files);
        let heard = |file: &Path, moment: &Moment<'_>| events.moment(file, moment);
        round.run(files, &|| interrupts.any(), &heard, |report| reports.push(report))?;
        let shown = events.end(&reports);
        return Ok((reports, shown));
    };
    round.run(files, &|| interrupts.any(), &|_, _| {}, |report| {
        if shown.is_ok() && format == Format::Text {
            shown = results.print(&line::text(&report));
        }
        reports.push(report);
    })?;
    let lines = |reports: &[Report]| reports.iter().map(|it| Line::of(it, results.shard)).collect::<Vec<_>>();
    let last = || match format {
        Format::Text => Ok(summary(&reports)),
        format => table::formatted(format, &lines(&reports), |_| String::new()),
    };
    shown = shown.and_then(|()| results.print(&last()?));
    Ok((reports, shown))
}

/// Runs changed scenarios again, until Ctrl-C.
fn watch(args: &Args, mut files: Vec<PathBuf>, interrupts: &Interrupts) -> Result<(), CliError> {
    let mut watched = WatchedFiles::default();
    loop {
        let changed = watched.changed(&files);
        if !changed.is_empty() {
            changed.iter().for_each(|file| watched.begins(file));
            reachable(args.attach.as_deref())?;
            let (reports, shown) = play(args, &changed, interrupts)?;
            shown?;
            reports.iter().for_each(|report| watched.ended(report));
            let files = plural(watched.files() as u64, "file");
            output::note(&format!("watching {files}; Ctrl-C ends it"));
        }
        if interrupts.any() || output::is_closed_terminal() {
            return Err(CliError::Interrupted);
        }
        std::thread::sleep(watch::PAUSE);
        // Between two rounds, a user may replace the directory and its files. If they are missing for a moment, the
        // list is empty.
        files = selection::scenarios(&args.files, &args.filter, args.shard()).unwrap_or(files);
    }
}

/// Checks that the instance to attach to is running, before the first scenario needs it.
fn reachable(instance: Option<&str>) -> Result<(), CliError> {
    instance.map_or(Ok(()), |instance| {
        super::session::Session::open(&super::Instance::starting(instance), 0).map(drop)
    })
}

fn write_junit(path: &Path, shard: Option<Shard>, reports: &[Report]) -> Result<(), CliError> {
    let failed = |reason| CliError::File { path: path.to_owned(), reason: io::Error::other(reason) };
    let text = match shard {
        None => junit(reports),
        Some(shard) => junit_of_shard(reports, &shard.to_string()),
    };
    write_report(path, &text.map_err(failed)?)
}

/// Writes a report. Creates its directory again if a scenario has removed it.
fn write_report(path: &Path, text: &str) -> Result<(), CliError> {
    create_directory(path).map_err(|reason| CliError::File { path: path.to_owned(), reason })?;
    write(path, text)
}

/// Creates the missing directories of a file.
fn create_directory(file: &Path) -> io::Result<()> {
    match file.parent() {
        Some(directory) if !directory.as_os_str().is_empty() => output_file::create_directories(directory),
        _ => Ok(()),
    }
}

fn write(path: &Path, text: &str) -> Result<(), CliError> {
    output::write(path, text.as_bytes())
}

/// Converts the outcomes of scenarios to the result of the command, which determines the exit code.
pub(super) fn verdict<'a>(outcomes: impl Iterator<Item = &'a Outcome> + Clone) -> Result<(), CliError> {
    if outcomes.clone().any(|outcome| matches!(outcome, Outcome::Broken(_))) {
        return Err(CliError::ReportedWrongUse);
    }
    let mut outcomes = outcomes;
    if outcomes.any(|outcome| !outcome.is_fine()) { Err(CliError::Reported) } else { Ok(()) }
}
