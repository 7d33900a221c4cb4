//! Runs rounds, and shortens failing rounds.

use super::kills;
use crate::cli::error::CliError;
use crate::cli::test::LimitArgs;
use crate::cli::test::process::{self, RunOptions, Workers};
use crate::devices::Exercise;
use crate::output_file;
use crate::plural::plural;
use crate::script::soak::{Round, RoundKind, shrink};
use crate::script::{Outcome, Report};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Maximum number of runs for the search for a shorter round that also fails.
const TRIES: usize = 200;

/// Runs rounds. Dropping this value removes the files of the rounds.
pub(super) struct RoundRunner {
    exercises: Vec<&'static Exercise>,
    keep: PathBuf,
    directory: PathBuf,
    setting: RunOptions,
    workers: Workers,
    files: AtomicUsize,
}

/// Result of a round.
pub(super) struct RoundResult {
    /// Name of the exercise.
    pub exercise: &'static str,
    /// Emulated time of the first run, in microseconds.
    pub emulated_us: u64,
    /// Real time of both runs.
    pub took: Duration,
    /// The round and the reason of the failure.
    pub failure: Option<(Round, String)>,
}

impl RoundRunner {
    /// Prepares rounds of these exercises.
    ///
    /// # Errors
    /// The directory for files cannot be created.
    pub(super) fn new(
        exercises: Vec<&'static Exercise>,
        keep: &Path,
        limits: LimitArgs,
    ) -> Result<Self, CliError> {
        let directory = new_directory(&std::env::temp_dir())?;
        let setting = RunOptions { attach: None, device: None, limits, allow_empty: true };
        Ok(Self {
            exercises,
            keep: keep.to_owned(),
            directory,
            setting,
            workers: Workers::default(),
            files: AtomicUsize::new(0),
        })
    }

    pub(super) fn exercises(&self) -> &[&'static Exercise] {
        &self.exercises
    }

    /// Runs the round of this seed, unless `stop` returns true.
    ///
    /// # Errors
    /// The generator cannot create the round.
    pub(super) fn round(&self, seed: u64, stop: impl Fn() -> bool) -> Result<RoundResult, CliError> {
        let begun = Instant::now();
        let round = Round::draw(seed, &self.exercises)?;
        let (exercise, (emulated_us, why)) = match round.kind {
            RoundKind::Killed => {
                let number = self.files.fetch_add(1, Ordering::Relaxed);
                let home = self.directory.join(format!("{number}"));
                let instance = format!("soak-{}-{number}", std::process::id());
                let why = kills::play(&round, &home, instance, &stop).err();
                if why.is_none() {
                    // An error is ignored: the directory is removed at the end.
                    let _ = std::fs::remove_dir_all(&home);
                }
                (kills::NAME, (0, why))
            }
            _ => (round.exercise.name, self.run(&round, &stop)),
        };
        let took = begun.elapsed();
        // If the round was stopped, the failure may be an effect of the stop. So the round counts as passed.
        let failure = why.filter(|_| !stop()).map(|why| (round, why));
        Ok(RoundResult { exercise, emulated_us, took, failure })
    }

    /// Runs the round, and once more if it has passed. Returns the emulated time and the failure, if any.
    fn run(&self, round: &Round, stop: &impl Fn() -> bool) -> (u64, Option<String>) {
        let one = self.play(&round.text(false), stop);
        let why = wrong(&one).or_else(|| {
            let other = self.play(&round.text(true), stop);
            let has_other_journal = || {
                (one.journal_hash != other.journal_hash).then(|| {
                    "a run with other time slices and with steps that are taken back has another journal"
                        .to_owned()
                })
            };
            wrong(&other).map(|why| format!("second run: {why}")).or_else(has_other_journal)
        });
        (one.emulated_us.unwrap_or_default(), why)
    }

    fn play(&self, text: &str, stop: &impl Fn() -> bool) -> Report {
        let file = self.directory.join(format!("{}.rhai", self.files.fetch_add(1, Ordering::Relaxed)));
        let report = match std::fs::write(&file, text) {
            Ok(()) => self.workers.run(&file, &self.setting, stop, |_| {}),
            Err(reason) => process::died(&file, &reason.to_string()),
        };
        // An error is ignored, because the file is removed with the directory at the end.
        let _ = std::fs::remove_file(&file);
        report
    }

    /// Shortens a failing round, for as long as a scenario may take. If the round is a scenario, writes it to a file. Returns the report.
    pub(super) fn keep(&self, (round, why): &(Round, String), stop: &impl Fn() -> bool) -> String {
        if round.kind == RoundKind::Killed {
            // The failure depends on the exact moment, so the round cannot be shortened.
            return format!(
                "seed {}, {}: {why}; try `commram soak` with this seed again",
                round.seed,
                kills::NAME
            );
        }
        // Each try of a round that does not end would take the real time of a scenario.
        let (begun, limit) = (Instant::now(), Duration::from_micros(self.setting.limits.max_real_time()));
        let is_over = || stop() || begun.elapsed() >= limit;
        let fails = |moves: &[String]| {
            let round = round.with(moves.to_vec());
            // A try that is interrupted has no result.
            !is_over() && self.run(&round, &is_over).1.is_some() && !is_over()
        };
        let moves = shrink(&round.moves, TRIES, fails);
        let short = round.with(moves);
        let is_shorter = short.moves.len() < round.moves.len();
        let why = is_shorter.then(|| self.run(&short, stop).1).flatten().unwrap_or_else(|| why.clone());
        let path = self.keep.join(format!("soak-{}.rhai", round.seed));
        let written = output_file::create_directories(&self.keep)
            .and_then(|()| output_file::write(&path, short.text(false).as_bytes()));
        let (left, of) = (short.moves.len(), round.moves.len());
        let then = match written {
            Ok(()) => format!("try `commram test {}`", path.display()),
            Err(reason) => format!("{} cannot be written ({reason}); try this seed again", path.display()),
        };
        let (exercise, kind) = (round.exercise.name, round.kind.name());
        let seed = round.seed;
        format!(
            "seed {seed}, {exercise}, {kind}: {why}\nit fails with {left} of its {}; {then}",
            plural(of as u64, "move")
        )
    }
}

impl Drop for RoundRunner {
    fn drop(&mut self) {
        // An error is ignored: the files then stay in the system's directory for temporary files.
        let _ = std::fs::remove_dir_all(&self.directory);
    }
}

/// Returns the text of the failure if the scenario has not passed.
fn wrong(report: &Report) -> Option<String> {
    match &report.outcome {
        Outcome::Passed | Outcome::Skipped(_) => None,
        Outcome::Failed(failure) => Some(failure.what.clone()),
        Outcome::Broken(mistake) => Some(mistake.what.clone()),
        Outcome::Died(why) | Outcome::NotRun(why) => Some(why.clone()),
    }
}

/// Creates a directory for this process only, in a directory that other users can write to.
///
/// # Errors
/// The directory cannot be created.
fn new_directory(parent: &Path) -> Result<PathBuf, CliError> {
    loop {
        // A killed process with this number, or another user, may have made a directory of the same name.
        let name = format!("commram-soak-{}-{:08x}", std::process::id(), fastrand::u32(..));
        let path = parent.join(name);
        match std::fs::DirBuilder::new().mode(0o700).create(&path) {
            Ok(()) => return Ok(path),
            Err(reason) if reason.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(reason) => return Err(CliError::File { path, reason }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_directory_is_a_new_one() {
        let parent = tempfile::tempdir().unwrap();
        let [one, other] = [(); 2].map(|()| new_directory(parent.path()).unwrap());
        assert!(one != other && one.is_dir() && other.is_dir());
    }
}
