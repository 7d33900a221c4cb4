//! Formats the results of scenarios for the output.

use super::selection::Shard;
use crate::cli::table::Row;
use crate::cli::{output, style};
use crate::script::{Failure, FailureKind, JournalLine, Outcome, Report, ScriptLocation};
use crate::time::seconds;
use chrono::{DateTime, SecondsFormat, Utc};
use serde::Serialize;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use std::time::Duration;

/// A scenario in the list.
#[derive(Serialize)]
pub(crate) struct ScenarioRow {
    scenario: String,
    file: String,
}

impl ScenarioRow {
    /// Returns the row of a file.
    pub(crate) fn of(file: &Path) -> Self {
        let scenario = file.file_stem().unwrap_or(file.as_os_str()).to_string_lossy().into_owned();
        Self { scenario, file: file.display().to_string() }
    }
}

impl Row for ScenarioRow {
    const COLUMNS: &'static [&'static str] = &["scenario", "file"];

    fn cells(&self) -> Vec<String> {
        vec![self.scenario.clone(), self.file.clone()]
    }
}

/// The result of a scenario in a table.
#[derive(Serialize)]
pub(crate) struct Line {
    scenario: String,
    file: String,
    outcome: &'static str,
    /// Start of the run, in UTC.
    started: String,
    expectations: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    emulated_us: Option<u64>,
    real_us: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    location: Option<Location>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    failure: Option<Details>,
    #[serde(skip_serializing_if = "String::is_empty")]
    printed: String,
    /// The shard that contained the scenario.
    #[serde(skip_serializing_if = "Option::is_none")]
    shard: Option<String>,
    /// The whole report of the scenario, which `commram test merge --report html` needs.
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<Value>,
}

/// Location of an error.
#[derive(Serialize)]
struct Location {
    /// Path of the script, which can be a script that the scenario imports.
    script: String,
    line: Option<u32>,
    source: Option<String>,
}

impl Location {
    fn of(place: &ScriptLocation) -> Self {
        let ScriptLocation { file, line, source, .. } = place.clone();
        Self { script: file, line, source }
    }
}

/// Details of a failure.
#[derive(Serialize)]
struct Details {
    kind: FailureKind,
    register: Option<String>,
    address: Option<String>,
    expected: Option<i64>,
    actual: Option<i64>,
    mask: Option<u32>,
    tolerance: Option<u32>,
    expected_text: Option<String>,
    actual_text: Option<String>,
    within_us: Option<u64>,
    time_us: u64,
    section: Option<String>,
    /// Number of findings of the access checker.
    findings: u64,
    first_findings: Vec<String>,
    faults: Vec<String>,
    journal: Vec<JournalLine>,
}

impl Line {
    /// Creates the row of a scenario.
    pub(crate) fn of(report: &Report, shard: Option<Shard>) -> Self {
        let (message, location, failure) = match &report.outcome {
            Outcome::Passed => (None, None, None),
            Outcome::Failed(failure) => {
                let location = failure.location.as_ref().map(Location::of);
                (Some(failure.what.clone()), location, Some(Details::of(failure)))
            }
            Outcome::Broken(mistake) => {
                (Some(mistake.what.clone()), Some(Location::of(&mistake.location)), None)
            }
            Outcome::Died(text) | Outcome::NotRun(text) | Outcome::Skipped(text) => {
                (Some(text.clone()), None, None)
            }
        };
        Self {
            scenario: report.name(),
            file: report.file.display().to_string(),
            outcome: report.outcome.name(),
            started: DateTime::<Utc>::from(report.started).to_rfc3339_opts(SecondsFormat::Millis, true),
            expectations: report.expectations,
            emulated_us: report.emulated_us,
            real_us: u64::try_from(report.took.as_micros()).unwrap_or(u64::MAX),
            message,
            location,
            failure,
            printed: report.printed.clone(),
            shard: shard.map(|shard| shard.to_string()),
            page: None,
        }
    }

    /// Creates the row of a scenario for a report file.
    pub(crate) fn with_page(report: &Report, shard: Option<Shard>) -> serde_json::Result<Self> {
        Ok(Self { page: Some(serde_json::to_value(report)?), ..Self::of(report, shard) })
    }
}

impl Details {
    fn of(failure: &Failure) -> Self {
        let Failure { kind, register, address, expected, actual, numbers, within_us, .. } = failure.clone();
        Self {
            kind,
            register,
            address,
            expected: numbers.map(|numbers| numbers.expected),
            actual: numbers.map(|numbers| numbers.actual),
            mask: numbers.and_then(|numbers| numbers.mask),
            tolerance: numbers.and_then(|numbers| numbers.tolerance),
            expected_text: expected,
            actual_text: actual,
            within_us,
            time_us: failure.time_us,
            section: failure.section.clone(),
            findings: failure.findings,
            first_findings: failure.first_findings.clone(),
            faults: failure.faults.clone(),
            journal: failure.journal.clone(),
        }
    }
}

impl Row for Line {
    const COLUMNS: &'static [&'static str] =
        &["scenario", "file", "outcome", "emulated_us", "real_us", "message"];

    fn cells(&self) -> Vec<String> {
        vec![
            self.scenario.clone(),
            self.file.clone(),
            self.outcome.to_owned(),
            self.emulated_us.map(|us| us.to_string()).unwrap_or_default(),
            self.real_us.to_string(),
            self.message.clone().unwrap_or_default(),
        ]
    }
}

/// Formats a scenario as one line. If it did not pass, adds the reason and its output below.
pub(crate) fn text(report: &Report) -> String {
    let emulated = report.emulated_us.map(|us| format!("{} emulated ", seconds(us))).unwrap_or_default();
    if let Outcome::NotRun(why) = &report.outcome {
        return output::harmless(&format!("not run  {}  {why}\n", report.file.display()));
    }
    let name = style::outcome(&format!("{:<6}", report.outcome.name()), report.outcome.is_fine());
    let mut text = format!("  {}  {emulated}in {} ms\n", report.file.display(), report.took.as_millis());
    let reason = match &report.outcome {
        Outcome::Passed | Outcome::NotRun(_) => String::new(),
        Outcome::Failed(failure) => failure.to_string(),
        Outcome::Broken(mistake) => mistake.to_string(),
        Outcome::Died(reason) | Outcome::Skipped(reason) => reason.clone(),
    };
    let printed = report.printed.lines().map(|line| format!("| {line}"));
    for line in reason.lines().map(str::to_owned).chain(printed) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "  {line}");
    }
    // The output of a script must not control the terminal, so it is escaped.
    name + &output::harmless(&text)
}

/// Formats a summary: `12 passed, 1 failed, 0 broken; 3.250000 s emulated in 41 ms`. Adds the numbers of crashed and
/// skipped scenarios, if there are any.
pub(crate) fn summary(reports: &[Report]) -> String {
    let count = |name: &str| reports.iter().filter(|report| report.outcome.name() == name).count();
    let emulated = reports.iter().filter_map(|report| report.emulated_us).sum();
    let counted = |name: &str| match count(name) {
        0 => format!("0 {name}"),
        count => style::outcome(&format!("{count} {name}"), matches!(name, "passed" | "skipped")),
    };
    let others = ["died", "skipped", "not run"].map(|name| match count(name) {
        0 => String::new(),
        _ => format!(", {}", counted(name)),
    });
    format!(
        "{}, {}, {}{}; {} emulated in {} ms\n",
        counted("passed"),
        counted("failed"),
        counted("broken"),
        others.concat(),
        seconds(emulated),
        reports.iter().map(|report| report.took).sum::<Duration>().as_millis()
    )
}
