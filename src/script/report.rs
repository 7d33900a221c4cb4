//! The result of a scenario.

use super::failure::{Failure, FailureKind, ScriptLocation};
use core::fmt;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// The outcome of a scenario.
#[derive(Debug, Serialize, Deserialize)]
pub enum Outcome {
    /// All expectations were met.
    Passed,
    /// The plant did not behave as expected.
    Failed(Box<Failure>),
    /// The script is wrong: it cannot be read or compiled, or uses a verb wrongly.
    Broken(Box<Mistake>),
    /// The process of the scenario crashed or was killed before its end. The text gives the known facts. Only another
    /// process can report this outcome.
    Died(String),
    /// The scenario was not started; the text has the reason.
    NotRun(String),
    /// The scenario has ended itself by `skip`; the text has its reason.
    Skipped(String),
}

impl Outcome {
    /// Returns the name in reports.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed(_) => "failed",
            Self::Broken(_) => "broken",
            Self::Died(_) => "died",
            Self::NotRun(_) => "not run",
            Self::Skipped(_) => "skipped",
        }
    }

    /// True if the scenario passed.
    pub fn is_passed(&self) -> bool {
        matches!(self, Self::Passed)
    }

    /// True if the scenario passed, or has called `skip`.
    pub fn is_fine(&self) -> bool {
        matches!(self, Self::Passed | Self::Skipped(_))
    }
}

/// An error in a script.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mistake {
    /// Description of the error.
    pub what: String,
    /// Location of the error.
    pub location: ScriptLocation,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.location.short(), self.what)?;
        self.location.source.as_ref().map_or(Ok(()), |source| write!(f, "\n  line      {source}"))
    }
}

/// A section of a scenario.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Step {
    /// Name of the section; `None` before the first section.
    pub name: Option<String>,
    /// Emulated time at its beginning, in microseconds.
    pub from_us: u64,
    /// Number of expectations that were reached.
    pub expectations: u64,
}

/// A finding of the access checker.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FoundLine {
    /// Emulated time of the first occurrence, in microseconds.
    pub first_us: u64,
    /// `error`, `warning` or `note`.
    pub severity: String,
    /// Name of the rule.
    pub rule: String,
    /// Name of the register.
    pub register: String,
    /// Number of occurrences.
    pub count: u64,
    /// Text about the error, with the right use.
    pub text: String,
    /// Pages of the manuals.
    pub page: String,
}

/// A plot that a scenario has drawn.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlotFile {
    /// Name of the file.
    pub name: String,
    /// The plot as SVG, independent of the format of the file.
    pub svg: String,
}

/// The result of a scenario.
#[derive(Debug, Serialize, Deserialize)]
pub struct Report {
    /// Path of the script, as given. The report that another process sends does not contain the path, because the
    /// receiver has started the script.
    #[serde(skip)]
    pub file: PathBuf,
    /// Description of the plant: its file, or another origin. Empty if the scenario did not run.
    pub plant: String,
    /// Outcome of the scenario.
    pub outcome: Outcome,
    /// Number of expectations that were reached.
    pub expectations: u64,
    /// Emulated duration in microseconds; `None` for a scenario that died.
    pub emulated_us: Option<u64>,
    /// Hash over all journal records, which is the same in every run. `None` for a running instance.
    pub journal_hash: Option<u64>,
    /// Time of the start.
    pub started: SystemTime,
    /// Real time that the scenario took.
    pub took: Duration,
    /// Printed lines, up to 1 MiB. Not part of the report that another process sends, because the receiver already has
    /// them.
    #[serde(skip)]
    pub printed: String,
    /// Sections of the scenario, including the part before the first section.
    pub steps: Vec<Step>,
    /// The findings of the access checker.
    pub findings: Vec<FoundLine>,
    /// The plots that the scenario has drawn.
    pub plots: Vec<PlotFile>,
    /// Files that the scenario has tried to read: imports, the plant file, and the files of device folders, even if
    /// they do not exist.
    pub reads: Vec<PathBuf>,
}

impl Report {
    /// Returns a report that contains only the outcome, because nothing else is known.
    pub fn bare(file: PathBuf, outcome: Outcome) -> Self {
        Self {
            file,
            plant: String::new(),
            outcome,
            expectations: 0,
            emulated_us: None,
            journal_hash: None,
            started: SystemTime::now(),
            took: Duration::ZERO,
            printed: String::new(),
            steps: Vec::new(),
            findings: Vec::new(),
            plots: Vec::new(),
            reads: Vec::new(),
        }
    }

    /// Returns the scenario's name: its file without directory and extension.
    pub fn name(&self) -> String {
        self.file.file_stem().unwrap_or(self.file.as_os_str()).to_string_lossy().into_owned()
    }

    /// Turns a passed scenario without expectations into a failure.
    pub fn refuse_empty(&mut self) {
        self.refuse_empty_with(", or use --allow-empty");
    }

    /// Does the same for a command with other options: the message ends with `remedy`, which may be empty.
    pub(crate) fn refuse_empty_with(&mut self, remedy: &str) {
        if !self.outcome.is_passed() || self.expectations > 0 {
            return;
        }
        let file = self.file.display().to_string();
        self.outcome = Outcome::Failed(Box::new(Failure {
            kind: FailureKind::Empty,
            what: format!("the scenario has no expectation, so it cannot fail; add an expectation{remedy}"),
            register: None,
            address: None,
            expected: None,
            actual: None,
            numbers: None,
            within_us: None,
            time_us: self.emulated_us.unwrap_or_default(),
            section: None,
            findings: 0,
            first_findings: Vec::new(),
            faults: Vec::new(),
            journal: Vec::new(),
            exchange: Vec::new(),
            location: Some(ScriptLocation { file, line: None, column: None, source: None }),
        }));
    }
}
