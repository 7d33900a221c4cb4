//! Runs scenarios, several at the same time.

use super::events::Moment;
use super::process::{RunOptions, Workers};
use super::progress::Progress;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::script::{Outcome, Report};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

/// A run of several scenarios.
pub(crate) struct Round {
    /// Options of each scenario.
    pub setting: RunOptions,
    /// Number of scenarios that run at the same time; `None` for one per processor.
    pub jobs: Option<NonZero<usize>>,
    /// True if no further scenario is started after one that has not passed.
    pub fail_fast: bool,
}

impl Round {
    /// Runs all files until `stop` returns true. Passes the reports to `take` in the order of the files. Passes events of
    /// the scenarios to `heard` as they happen.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub(crate) fn run(
        &self,
        files: &[PathBuf],
        stop: &(impl Fn() -> bool + Sync),
        heard: &(impl Fn(&Path, &Moment<'_>) + Sync),
        mut take: impl FnMut(Report),
    ) -> Result<(), CliError> {
        let jobs = self.jobs.or_else(|| std::thread::available_parallelism().ok());
        let jobs = jobs.map_or(1, NonZero::get).min(files.len());
        let failed = AtomicBool::new(false);
        let progress = Progress::of(files.len());
        let workers = Workers::default();
        let run_one = |file: &Path| {
            if stop() {
                return not_run(file, "interrupted");
            }
            if self.fail_fast && failed.load(Ordering::Relaxed) {
                return not_run(file, "another scenario has not passed (--fail-fast)");
            }
            progress.begins(file);
            heard(file, &Moment::Begins);
            let report = workers.run(file, &self.setting, stop, |moment| heard(file, moment));
            failed.fetch_or(!report.outcome.is_fine(), Ordering::Relaxed);
            report
        };
        let run = |file: &Path| {
            let report = run_one(file);
            heard(file, &Moment::Ends(&report));
            report
        };
        let next = AtomicUsize::new(0);
        let (send, receive) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..jobs {
                let (send, next, run) = (send.clone(), &next, &run);
                let work = move || {
                    while let Some((index, file)) = {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        files.get(index).map(|file| (index, file))
                    } {
                        // The receiver lives until all reports have been received.
                        let _ = send.send((index, run(file)));
                    }
                };
                let thread = std::thread::Builder::new().spawn_scoped(scope, work);
                thread.map_err(|reason| CliError::Process { reason })?;
            }
            drop(send);
            let mut waiting: Vec<Option<Report>> = files.iter().map(|_| None).collect();
            let mut taken = 0;
            for (index, report) in receive {
                progress.ends(&report.file, report.outcome.is_fine());
                if let Some(place) = waiting.get_mut(index) {
                    *place = Some(report);
                }
                while let Some(report) = waiting.get_mut(taken).and_then(Option::take) {
                    taken += 1;
                    progress.aside(|| take(report));
                }
            }
            Ok::<_, CliError>(())
        })?;
        if output::is_verbose() {
            output::note(&format!("processes of scenarios: {}", workers.started()));
        }
        Ok(())
    }
}

fn not_run(file: &Path, why: &str) -> Report {
    Report::bare(file.to_owned(), Outcome::NotRun(why.to_owned()))
}
