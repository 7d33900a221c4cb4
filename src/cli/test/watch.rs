//! Runs changed scenarios again.

use crate::script::{Report, needs};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Pause between two checks of the files.
pub(crate) const PAUSE: Duration = Duration::from_millis(200);

/// Modification times of files are behind the clock by up to this time.
const RESOLUTION: Duration = Duration::from_millis(20);

/// Modification time and length of a file; `None` if the file is missing.
type FileStamp = Option<(SystemTime, u64)>;

/// The files that each scenario used in its last run.
#[derive(Default)]
pub(crate) struct WatchedFiles {
    scenarios: BTreeMap<PathBuf, LastRun>,
}

/// The last run of a scenario.
struct LastRun {
    begin: SystemTime,
    /// The stamps of all files of the scenario.
    files: BTreeMap<PathBuf, FileStamp>,
}

impl WatchedFiles {
    /// Records the files of a scenario before it runs, so that a change during the run is detected.
    pub(crate) fn begins(&mut self, scenario: &Path) {
        let begin = SystemTime::now();
        let before = self.scenarios.get(scenario).map(|last| last.files.keys().cloned().collect());
        let mut files: BTreeSet<PathBuf> = before.unwrap_or_default();
        files.insert(scenario.to_owned());
        files.extend(needs(scenario));
        let files = files.into_iter().map(|file| (stamp_of(&file), file)).map(|(stamp, file)| (file, stamp));
        self.scenarios.insert(scenario.to_owned(), LastRun { begin, files: files.collect() });
    }

    /// Adds the files that the scenario has read. A file that was possibly changed during the run counts as changed: the run
    /// may have read the old contents.
    pub(crate) fn ended(&mut self, report: &Report) {
        if let Some(LastRun { begin, files }) = self.scenarios.get_mut(&report.file) {
            let is_older = |(modified, _): &(SystemTime, u64)| *modified + RESOLUTION < *begin;
            for file in &report.reads {
                files.entry(file.clone()).or_insert_with(|| stamp_of(file).filter(is_older));
            }
        }
    }

    /// Returns the scenarios that have changed since their last run, or are new. Forgets all others that are not in the
    /// list: if one comes back with its directory, it is new.
    pub(crate) fn changed(&mut self, scenarios: &[PathBuf]) -> Vec<PathBuf> {
        let selected: BTreeSet<_> = scenarios.iter().collect();
        self.scenarios.retain(|scenario, _| selected.contains(scenario));
        let is_same = |last: &LastRun| last.files.iter().all(|(file, old)| stamp_of(file) == *old);
        let has_changed = |scenario: &&PathBuf| !self.scenarios.get(*scenario).is_some_and(is_same);
        scenarios.iter().filter(has_changed).cloned().collect()
    }

    /// Returns the number of watched files.
    pub(crate) fn files(&self) -> usize {
        self.scenarios.values().flat_map(|last| last.files.keys()).collect::<BTreeSet<_>>().len()
    }
}

fn stamp_of(file: &Path) -> FileStamp {
    let known = file.metadata().ok()?;
    Some((known.modified().ok()?, known.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::Outcome;

    #[test]
    fn a_scenario_runs_again_with_its_script_its_imports_and_its_plant() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        let (with, without) = (at("with.rhai"), at("without.rhai"));
        std::fs::write(&with, "import \"part\" as part;").unwrap();
        std::fs::write(&without, "").unwrap();
        let plant = std::fs::File::create(at("plant.toml")).unwrap();
        plant.set_modified(SystemTime::now() - Duration::from_secs(1)).unwrap();
        let all = [with.clone(), without.clone()];
        let mut watched = WatchedFiles::default();
        assert_eq!(watched.changed(&all), all);
        let run = |watched: &mut WatchedFiles| {
            for scenario in &all {
                watched.begins(scenario);
                let reads = if *scenario == with { vec![at("plant.toml")] } else { Vec::new() };
                watched.ended(&Report { reads, ..Report::bare(scenario.clone(), Outcome::Passed) });
            }
            assert!(watched.changed(&all).is_empty());
        };
        for (changed, expected) in [
            ("plant.toml", &all[..1]),
            // Before this change, the import was missing.
            ("part.rhai", &all[..1]),
            ("without.rhai", &all[1..]),
            ("with.rhai", &all[..1]),
        ] {
            run(&mut watched);
            std::fs::write(at(changed), "// changed").unwrap();
            assert_eq!(watched.changed(&all), expected, "{changed}");
        }
        run(&mut watched);
        std::fs::remove_file(at("plant.toml")).unwrap();
        assert_eq!(watched.changed(&all), [with], "and it is no longer imported, which nothing forgets");
    }

    #[test]
    fn a_scenario_that_comes_back_unchanged_runs_again() {
        let directory = tempfile::tempdir().unwrap();
        let folder = directory.path().join("folder");
        let elsewhere = directory.path().join("elsewhere");
        std::fs::create_dir(&folder).unwrap();
        let scenario = folder.join("a.rhai");
        std::fs::write(&scenario, "").unwrap();
        let mut watched = WatchedFiles::default();
        let all = [scenario.clone()];
        watched.begins(&scenario);
        assert!(watched.changed(&all).is_empty());
        // While the folder is missing, its name is taken for a scenario.
        std::fs::rename(&folder, &elsewhere).unwrap();
        assert_eq!(watched.changed(std::slice::from_ref(&folder)), std::slice::from_ref(&folder));
        watched.begins(&folder);
        std::fs::rename(&elsewhere, &folder).unwrap();
        assert_eq!(watched.changed(&all), all);
    }

    #[test]
    fn a_file_that_changes_during_the_first_run_counts_as_changed() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        let (scenario, plant) = (at("with.rhai"), at("plant.toml"));
        std::fs::write(&scenario, "").unwrap();
        let mut watched = WatchedFiles::default();
        let report = Report { reads: vec![plant.clone()], ..Report::bare(scenario.clone(), Outcome::Passed) };
        let all = [scenario.clone()];
        watched.begins(&scenario);
        std::fs::write(&plant, "# changed").unwrap();
        watched.ended(&report);
        assert_eq!(watched.changed(&all), all);
        watched.begins(&scenario);
        watched.ended(&report);
        assert!(watched.changed(&all).is_empty());
    }
}
