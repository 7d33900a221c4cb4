//! Runs changed scenarios again.

use crate::script::{Report, needs};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Pause between two checks of the files.
pub(crate) const PAUSE: Duration = Duration::from_millis(200);

/// Modification time and length of a file; `None` if the file is missing.
type FileStamp = Option<(SystemTime, u64)>;

/// The files that each scenario used in its last run.
#[derive(Default)]
pub(crate) struct WatchedFiles {
    /// For each scenario, the stamps of all its files.
    scenarios: BTreeMap<PathBuf, BTreeMap<PathBuf, FileStamp>>,
}

impl WatchedFiles {
    /// Records the files of a scenario before it runs, so that a change during the run is detected.
    pub(crate) fn begins(&mut self, scenario: &Path) {
        let before = self.scenarios.get(scenario).map(|looks| looks.keys().cloned().collect());
        let mut files: BTreeSet<PathBuf> = before.unwrap_or_default();
        files.insert(scenario.to_owned());
        files.extend(needs(scenario));
        let looks =
            files.into_iter().map(|file| (stamp_of(&file), file)).map(|(stamp_of, file)| (file, stamp_of));
        self.scenarios.insert(scenario.to_owned(), looks.collect());
    }

    /// Adds the files that the scenario has read.
    pub(crate) fn ended(&mut self, report: &Report) {
        if let Some(looks) = self.scenarios.get_mut(&report.file) {
            for file in &report.reads {
                looks.entry(file.clone()).or_insert_with(|| stamp_of(file));
            }
        }
    }

    /// Returns the scenarios that have changed since their last run, or are new.
    pub(crate) fn changed(&self, scenarios: &[PathBuf]) -> Vec<PathBuf> {
        let is_same =
            |looks: &BTreeMap<PathBuf, FileStamp>| looks.iter().all(|(file, old)| stamp_of(file) == *old);
        let has_changed = |scenario: &&PathBuf| !self.scenarios.get(*scenario).is_some_and(is_same);
        scenarios.iter().filter(has_changed).cloned().collect()
    }

    /// Returns the number of watched files.
    pub(crate) fn files(&self) -> usize {
        self.scenarios.values().flat_map(BTreeMap::keys).collect::<BTreeSet<_>>().len()
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
        std::fs::write(at("plant.toml"), "").unwrap();
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
}
