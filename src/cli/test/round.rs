//! Runs scenarios, several at a time.

use super::process::{self, Setting};
use super::progress::Progress;
use crate::cli::error::CliError;
use crate::script::{Outcome, Report};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

/// How scenarios are run.
pub(crate) struct Round {
    /// What holds for each.
    pub setting: Setting,
    /// How many run at a time; else one per processor.
    pub jobs: Option<NonZero<usize>>,
    /// Whether none begins any more after one that has not passed.
    pub fail_fast: bool,
}

impl Round {
    /// Runs all files until told to `stop`; hands over the reports in the order of the files, until `take` says that it is
    /// enough.
    ///
    /// # Errors
    /// The system has no thread for it.
    pub(crate) fn run(
        &self,
        files: &[PathBuf],
        stop: &(impl Fn() -> bool + Sync),
        mut take: impl FnMut(Report) -> bool,
    ) -> Result<(), CliError> {
        let jobs = self.jobs.or_else(|| std::thread::available_parallelism().ok());
        let jobs = jobs.map_or(1, NonZero::get).min(files.len());
        let (enough, failed) = (AtomicBool::new(false), AtomicBool::new(false));
        let must_end = || stop() || enough.load(Ordering::Relaxed);
        let progress = Progress::of(files.len());
        let run = |file: &Path| {
            if must_end() {
                return not_run(file, "interrupted");
            }
            if self.fail_fast && failed.load(Ordering::Relaxed) {
                return not_run(file, "another has not passed (--fail-fast)");
            }
            progress.begins(file);
            let report = process::run(file, &self.setting, must_end);
            failed.fetch_or(!report.outcome.is_passed(), Ordering::Relaxed);
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
                        // The receiver lives until all have been received.
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
                progress.ends(&report.file, report.outcome.is_passed());
                if let Some(place) = waiting.get_mut(index) {
                    *place = Some(report);
                }
                while let Some(report) = waiting.get_mut(taken).and_then(Option::take) {
                    taken += 1;
                    if !progress.aside(|| take(report)) {
                        enough.store(true, Ordering::Relaxed);
                    }
                }
            }
            Ok(())
        })
    }
}

fn not_run(file: &Path, why: &str) -> Report {
    Report::bare(file.to_owned(), Outcome::NotRun(why.to_owned()))
}
