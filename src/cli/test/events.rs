//! `commram test --format events`: what happens in the scenarios, one JSON object per line, as it happens.

use super::line::{Line, ScenarioRow};
use super::selection::Shard;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::script::Report;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Version of the events. A new event or field does not change it.
const VERSION: u32 = 1;

/// Something that happens in a scenario.
pub(crate) enum Moment<'a> {
    /// The process of the scenario starts.
    Begins,
    /// A section begins at an emulated time, in microseconds.
    Section { name: &'a str, time_us: u64 },
    /// The scenario prints lines.
    Prints(&'a str),
    /// The scenario has ended.
    Ends(&'a Report),
}

/// An event, in the form in which it is written.
#[derive(Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event<'a> {
    Start { v: u32, version: &'static str, scenarios: Vec<ScenarioRow> },
    Begin { file: String },
    Section { file: String, name: &'a str, time_us: u64 },
    Output { file: String, text: &'a str },
    Failure(Box<Line>),
    End { file: String, outcome: &'static str, expectations: u64, emulated_us: Option<u64>, real_us: u64 },
    Summary { passed: usize, failed: usize, broken: usize, died: usize, skipped: usize, not_run: usize },
}

/// Writes events. Several scenarios can report events at the same time.
#[derive(Default)]
pub(crate) struct Events {
    /// The first error of the output, if any.
    failed: Mutex<Option<CliError>>,
}

impl Events {
    /// Reports the beginning of a run with these scenarios.
    pub(crate) fn start(&self, files: &[PathBuf]) {
        let scenarios = files.iter().map(|file| ScenarioRow::of(file)).collect();
        self.write(&Event::Start { v: VERSION, version: env!("CARGO_PKG_VERSION"), scenarios });
    }

    /// Reports something that happens in the scenario in the file `path`.
    pub(crate) fn moment(&self, path: &Path, moment: &Moment<'_>) {
        let file = path.display().to_string();
        match moment {
            Moment::Begins => self.write(&Event::Begin { file }),
            Moment::Section { name, time_us } => {
                self.write(&Event::Section { file, name, time_us: *time_us })
            }
            Moment::Prints(text) => self.write(&Event::Output { file, text }),
            Moment::Ends(report) => {
                if !report.outcome.is_fine() {
                    self.write(&Event::Failure(Box::new(Line::of(report, None::<Shard>))));
                }
                let Report { outcome, expectations, emulated_us, took, .. } = report;
                let real_us = u64::try_from(took.as_micros()).unwrap_or(u64::MAX);
                let (outcome, expectations, emulated_us) = (outcome.name(), *expectations, *emulated_us);
                self.write(&Event::End { file, outcome, expectations, emulated_us, real_us });
            }
        }
    }

    /// Reports the end of the run.
    ///
    /// # Errors
    /// An event could not be written.
    pub(crate) fn end(&self, reports: &[Report]) -> Result<(), CliError> {
        let count = |name: &str| reports.iter().filter(|report| report.outcome.name() == name).count();
        let [passed, failed, broken] = ["passed", "failed", "broken"].map(count);
        let [died, skipped, not_run] = ["died", "skipped", "not run"].map(count);
        self.write(&Event::Summary { passed, failed, broken, died, skipped, not_run });
        self.failed.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }

    /// Writes an event, unless an earlier write has failed.
    fn write(&self, event: &Event<'_>) {
        let mut failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        if failed.is_none() {
            let written = output::json_line(event).and_then(|line| output::print_while_read(line.as_bytes()));
            *failed = written.err();
        }
    }
}
