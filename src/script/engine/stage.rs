//! The stage of a running script: the plant that the script acts on, and the log of its steps.

#[cfg(feature = "cli")]
mod for_commands;

use crate::devices::folder;
use crate::journal::Entry;
use crate::plant::PlantConfig;
use crate::script::{Bench, Failure, FoundLine, PlotFile, ScenarioError, ScriptLocation, Step};
use core::panic::Location;
use std::path::PathBuf;

/// Receives the name of a section, and its emulated time in microseconds.
type SectionReceiver = Box<dyn FnMut(&str, u64)>;

/// True if the argument of the verb `plant` is the text of a plant file, not the name of one.
pub(crate) fn is_plant_text(text: &str) -> bool {
    text.contains(['\n', '=', '['])
}

/// The plant that a script acts on, and the log of its steps.
pub(crate) struct Stage {
    /// The plant with its verbs; `None` until the first verb.
    bench: Option<Bench>,
    /// The plant for a script that does not call the verb `plant`, or the error in it; `None` means the built-in plant.
    unnamed: Option<Result<PlantConfig, String>>,
    /// True if the bench belongs to a running instance.
    attached: bool,
    /// True if a debugger has used the plant, but no verb of the script has.
    is_preview: bool,
    /// True if the script calls `plant`.
    #[cfg(feature = "cli")]
    calls_plant: bool,
    /// Directory at which relative paths begin.
    pub(super) directory: PathBuf,
    /// Longest emulated time, in microseconds.
    limit_us: u64,
    /// Number of expectations that the script has checked.
    pub(super) expectations: u64,
    /// Files from which the plant was read: the plant file, and the files of device folders.
    plant_files: Vec<PathBuf>,
    /// Description of the plant for a report.
    plant_name: String,
    /// The sections so far, including the part before the first section, each with the number of expectations at its
    /// beginning.
    pub(super) steps: Vec<Step>,
    pub(super) plots: Vec<PlotFile>,
    /// Receives each section with its emulated time in microseconds.
    on_section: Option<SectionReceiver>,
}

impl Stage {
    /// Creates the stage of a script in `directory`. If `bench` is `None`, the first verb creates a plant.
    pub(crate) fn new(bench: Option<Bench>, directory: PathBuf, limit_us: u64) -> Self {
        let attached = bench.is_some();
        let mut stage = Self {
            attached,
            is_preview: false,
            #[cfg(feature = "cli")]
            calls_plant: false,
            unnamed: None,
            bench: None,
            directory,
            limit_us,
            expectations: 0,
            plant_files: Vec::new(),
            plant_name: if attached { "plant of the instance" } else { "built-in plant" }.to_owned(),
            steps: Vec::new(),
            plots: Vec::new(),
            on_section: None,
        };
        stage.bench = bench.map(|bench| stage.limited(bench));
        stage
    }

    /// Emulated time that the scenario has taken, in microseconds.
    pub(crate) fn elapsed_us(&mut self) -> u64 {
        self.bench.as_mut().and_then(|bench| bench.elapsed().ok()).unwrap_or(0)
    }

    /// Hash over all journal records, for a plant that the script owns.
    pub(crate) fn journal_hash(&self) -> Option<u64> {
        self.bench.as_ref().and_then(Bench::journal_hash)
    }

    /// Returns the number of expectations.
    pub(crate) fn expectations(&self) -> u64 {
        self.expectations
    }

    /// Returns the files from which the plant was read.
    pub(crate) fn plant_files(&mut self) -> Vec<PathBuf> {
        core::mem::take(&mut self.plant_files)
    }

    /// Description of the plant for a report: its file, or another origin.
    pub(crate) fn plant_name(&self) -> String {
        self.plant_name.clone()
    }

    /// Begins a section, for the verb `section`.
    pub(super) fn section(&mut self, text: &str) -> Result<(), ScenarioError> {
        let (from_us, expectations) = (self.bench()?.now()?, self.expectations);
        self.steps.push(Step { name: Some(text.to_owned()), from_us, expectations });
        if let Some(on_section) = &mut self.on_section {
            on_section(text, from_us);
        }
        self.bench()?.section(text);
        Ok(())
    }

    /// Returns the sections, each with the number of its expectations.
    pub(crate) fn steps(&mut self) -> Vec<Step> {
        let from_us = self.bench.as_ref().map_or(0, Bench::started_us);
        let mut steps = vec![Step { name: None, from_us, expectations: 0 }];
        steps.append(&mut self.steps);
        let ends: Vec<_> =
            steps.iter().skip(1).map(|next| next.expectations).chain([self.expectations]).collect();
        steps.iter_mut().zip(ends).for_each(|(step, end)| step.expectations = end - step.expectations);
        // If a scenario begins with a section, the part before the first section is empty and is removed.
        steps.retain(|step| step.name.is_some() || step.expectations > 0);
        steps
    }

    /// Returns the findings of the access checker; empty if the plant no longer answers.
    pub(crate) fn found(&mut self) -> Vec<FoundLine> {
        let Some(bench) = &mut self.bench else { return Vec::new() };
        let found = bench.findings().unwrap_or_default();
        let line = |entry: &Entry| FoundLine {
            first_us: entry.first_us,
            severity: entry.last.rule.severity().name().to_owned(),
            rule: entry.last.rule.id().to_owned(),
            register: bench.finding_place(entry),
            count: entry.count,
            text: entry.text().to_owned(),
            page: entry.last.rule.source().to_owned(),
        };
        found.iter().map(line).collect()
    }

    /// Returns the plots that the script has drawn.
    pub(crate) fn plots(&mut self) -> Vec<PlotFile> {
        core::mem::take(&mut self.plots)
    }

    /// Checks the expectations that belong to the end of a scenario.
    pub(crate) fn end(&mut self) -> Result<(), ScenarioError> {
        let Some(bench) = &mut self.bench else { return Ok(()) };
        self.expectations += bench.required_faults() as u64;
        bench.expect_required_faults()
    }

    /// Releases the snapshots that the scenario keeps: a running instance keeps a limited number of them.
    pub(crate) fn forget_saved(&mut self) {
        if let Some(bench) = &mut self.bench {
            bench.forget_saved();
        }
    }

    /// See [`Bench::is_there`].
    #[cfg(feature = "cli")]
    pub(crate) fn is_there(&self) -> bool {
        self.bench.as_ref().is_none_or(Bench::is_there)
    }

    /// Returns a failure at the present moment; `None` if the plant no longer answers.
    pub(crate) fn failure(&mut self, what: &str) -> Option<Failure> {
        self.bench().ok()?.failure(what.to_owned(), Location::caller()).ok()
    }

    fn limited(&self, mut bench: Bench) -> Bench {
        bench.set_limit(self.limit_us);
        bench
    }

    /// Returns the plant of the script. If the script has not called `plant`, the plant of [`Stage::set_unnamed`] or
    /// the built-in one.
    pub(super) fn bench(&mut self) -> Result<&mut Bench, ScenarioError> {
        self.is_preview = false;
        self.existing_or_new()
    }

    fn existing_or_new(&mut self) -> Result<&mut Bench, ScenarioError> {
        let bench = match self.bench.take() {
            Some(bench) => bench,
            None => self.new_bench()?,
        };
        Ok(self.bench.insert(bench))
    }

    /// Creates the plant of a script that has not called `plant`.
    fn new_bench(&self) -> Result<Bench, ScenarioError> {
        let bench = match &self.unnamed {
            Some(Ok(plant)) => Bench::new(plant)?,
            Some(Err(reason)) => return Err(ScenarioError::argument(&self.plant_name, reason)),
            None => Bench::built_in()?,
        };
        Ok(self.limited(bench))
    }

    /// Reads a plant file, for the verb `plant`.
    pub(super) fn plant(&mut self, text: &str, place: &ScriptLocation) -> Result<(), ScenarioError> {
        let config = if is_plant_text(text) {
            self.plant_name = "plant in the scenario".to_owned();
            PlantConfig::parse_from(&self.directory, "plant", text)?
        } else {
            let file = self.directory.join(text);
            self.plant_name = file.display().to_string();
            self.plant_files.push(file.clone());
            PlantConfig::load(&file)?
        };
        let folders = config.devices.iter().filter_map(|device| device.folder());
        self.plant_files.extend(folders.flat_map(folder::files_of));
        if core::mem::take(&mut self.is_preview) {
            self.bench = None;
        }
        match &self.bench {
            Some(bench) if self.attached => {
                let plcs: Vec<_> = config.devices.iter().map(|device| device.name()).collect();
                let buses: Vec<_> = config.buses.iter().map(|bus| bus.name()).collect();
                let names = bench.names();
                if plcs.iter().eq(&names.plcs.iter().collect::<Vec<_>>())
                    && buses.iter().eq(&names.buses.iter().collect::<Vec<_>>())
                {
                    return Ok(());
                }
                let has = format!(
                    "the instance has another plant, its PLCs are {} and its buses {}; start it with the \
                     scenario's plant file",
                    names.plcs.join(", "),
                    names.buses.join(", ")
                );
                Err(ScenarioError::argument("plant", &has))
            }
            Some(_) => Err(ScenarioError::argument(
                "plant",
                "this must be the first verb; a plant exists already; without this verb it is the built-in one",
            )),
            None => {
                let mut bench = self.limited(Bench::new(&config)?);
                bench.plant_is_of(place);
                self.bench = Some(bench);
                Ok(())
            }
        }
    }
}
