//! What is printed about scenarios.

use super::real_time;
use crate::cli::table::Row;
use crate::script::{Failure, Outcome, Report};
use crate::time::seconds;
use serde::Serialize;
use std::fmt::Write;

/// A scenario in a table.
#[derive(Serialize)]
pub(crate) struct Line {
    scenario: String,
    file: String,
    outcome: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    emulated_us: Option<u64>,
    real_us: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    failure: Option<Details>,
    #[serde(skip_serializing_if = "String::is_empty")]
    printed: String,
}

/// What is known of a failure.
#[derive(Serialize)]
struct Details {
    register: Option<String>,
    address: Option<String>,
    expected: Option<String>,
    actual: Option<String>,
    time_us: u64,
    section: Option<String>,
    line: Option<String>,
    journal: Vec<String>,
}

impl Line {
    /// The scenario's line.
    pub(crate) fn of(report: &Report) -> Self {
        let (message, failure) = match &report.outcome {
            Outcome::Passed => (None, None),
            Outcome::Failed(failure) => (Some(failure.what.clone()), Some(Details::of(failure))),
            Outcome::Broken(text) | Outcome::Died(text) => (Some(text.clone()), None),
        };
        Self {
            scenario: report.name(),
            file: report.file.display().to_string(),
            outcome: outcome(&report.outcome),
            emulated_us: report.emulated_us,
            real_us: u64::try_from(report.took.as_micros()).unwrap_or(u64::MAX),
            message,
            failure,
            printed: report.printed.clone(),
        }
    }
}

impl Details {
    fn of(failure: &Failure) -> Self {
        let Failure { register, address, expected, actual, time_us, section, location, journal, .. } =
            failure.clone();
        Self { register, address, expected, actual, time_us, section, line: location, journal }
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

fn outcome(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Passed => "passed",
        Outcome::Failed(_) => "failed",
        Outcome::Broken(_) => "broken",
        Outcome::Died(_) => "died",
    }
}

/// One line about a scenario, and below it why it did not pass and what it printed.
pub(crate) fn text(report: &Report) -> String {
    let emulated = report.emulated_us.map(|us| format!("{} emulated ", seconds(us))).unwrap_or_default();
    let mut text = format!(
        "{:<6}  {}  {emulated}in {} ms\n",
        outcome(&report.outcome),
        report.file.display(),
        report.took.as_millis()
    );
    let reason = match &report.outcome {
        Outcome::Passed => String::new(),
        Outcome::Failed(failure) => failure.to_string(),
        Outcome::Broken(reason) | Outcome::Died(reason) => reason.clone(),
    };
    let printed = report.printed.lines().map(|line| format!("| {line}"));
    for line in reason.lines().map(str::to_owned).chain(printed) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "  {line}");
    }
    text
}

/// `12 passed, 1 failed, 0 broken; 3.250000 s emulated in 41 ms`, and how many died, if any did.
pub(crate) fn summary(reports: &[Report]) -> String {
    let count = |name| reports.iter().filter(|report| outcome(&report.outcome) == name).count();
    let emulated = reports.iter().filter_map(|report| report.emulated_us).sum();
    let died = match count("died") {
        0 => String::new(),
        died => format!(", {died} died"),
    };
    format!(
        "{} passed, {} failed, {} broken{died}; {} emulated in {} ms\n",
        count("passed"),
        count("failed"),
        count("broken"),
        seconds(emulated),
        real_time(reports).as_millis()
    )
}
