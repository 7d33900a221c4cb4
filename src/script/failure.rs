//! A failed expectation and its location.

use crate::journal::{By, Changed, ChannelWrite, Found, Handshake, Record, Register, Ring, State};
use crate::plural::plural;
use crate::time::seconds;
use core::fmt;
use serde::{Deserialize, Serialize};

/// The kind of a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailureKind {
    /// An expectation is not met.
    Expectation,
    /// The scenario throws a value.
    Throw,
    /// The scenario exceeds its limits.
    Endless,
    /// The plant refuses an operation, or its instance has ended.
    Refused,
    /// The scenario has no expectations.
    Empty,
}

impl FailureKind {
    /// Returns the name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Expectation => "expectation",
            Self::Throw => "throw",
            Self::Endless => "endless",
            Self::Refused => "refused",
            Self::Empty => "empty",
        }
    }
}

/// A failed expectation, with all facts known at that moment.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// The kind of the failure.
    pub kind: FailureKind,
    /// The failure in one line.
    pub what: String,
    /// Name of the register, if the expectation concerns a register.
    pub register: Option<String>,
    /// Address of the register.
    pub address: Option<String>,
    /// Text of the expected value with its meaning.
    pub expected: Option<String>,
    /// Text of the actual value with its meaning.
    pub actual: Option<String>,
    /// Expected and actual value as numbers, if the expectation concerns a register.
    pub numbers: Option<Numbers>,
    /// Duration of the wait in emulated microseconds, if the expectation is a wait.
    pub within_us: Option<u64>,
    /// Emulated time in microseconds.
    pub time_us: u64,
    /// The section of the scenario.
    pub section: Option<String>,
    /// Number of findings of the access checker.
    pub findings: u64,
    /// Texts of the first findings, one line each.
    pub first_findings: Vec<String>,
    /// The faults that wait or act, a line each.
    pub faults: Vec<String>,
    /// The last records of the journal, oldest first.
    pub journal: Vec<JournalLine>,
    /// The exchanges of program, firmware and bus that may have led to the failure, oldest first.
    pub exchange: Vec<ExchangeStep>,
    /// Location of the expectation.
    pub location: Option<ScriptLocation>,
}

/// A step of a handshake, or a frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExchangeStep {
    /// Kind of the step: sender and receiver.
    pub kind: ExchangeKind,
    /// The record of the journal.
    pub line: JournalLine,
}

/// Kind of a step in an exchange, given by its sender and receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ExchangeKind {
    /// The PLC's program writes a register.
    Program,
    /// The firmware writes a register.
    Firmware,
    /// Traffic on a bus.
    Bus,
    /// A mistake: a finding of the access checker, or a missed deadline.
    Wrong,
    /// Steps that are omitted or repeated.
    More,
}

impl ExchangeKind {
    /// The exchange that a record describes, if it belongs to a handshake.
    pub(super) fn of(record: &Record) -> Option<Self> {
        let event = record.event;
        if let Some(Changed { how, .. }) = event.get() {
            return Some(match how.by {
                By::Firmware => ExchangeKind::Firmware,
                By::Program | By::Channel | By::Force => ExchangeKind::Program,
            });
        }
        if event.is::<ChannelWrite>() {
            return Some(ExchangeKind::Program);
        }
        if event.is::<Found>() || event.kind().ring() == Ring::Missed {
            return Some(ExchangeKind::Wrong);
        }
        if event.is::<State>() || event.is::<Handshake>() || event.is::<Register>() {
            return Some(ExchangeKind::Firmware);
        }
        (event.kind().ring() == Ring::Traffic).then_some(ExchangeKind::Bus)
    }
}

/// The expected and the actual value of a register, as numbers of its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Numbers {
    /// Value that the register should have.
    pub expected: i64,
    /// The actual value, with all its bits.
    pub actual: i64,
    /// Mask of the compared bits; `None` if all bits are compared.
    pub mask: Option<u32>,
    /// Permitted difference from the expected value.
    pub tolerance: Option<u32>,
}

/// A record of the journal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JournalLine {
    /// Emulated time in microseconds.
    pub time_us: u64,
    /// Kind of the event, as `commram trace --kind` names it.
    pub kind: String,
    /// The line of `commram trace`.
    pub text: String,
}

/// A line of a script, or of a test in Rust.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScriptLocation {
    /// Path of the script.
    pub file: String,
    /// Line of the failure, counted from 1, if it is known.
    pub line: Option<u32>,
    /// Column of the failure, counted from 1, for a test in Rust.
    pub column: Option<u32>,
    /// Text of the line, for a script.
    pub source: Option<String>,
}

impl ScriptLocation {
    /// `master.rhai:12`
    pub(super) fn short(&self) -> String {
        let number = |number: Option<u32>| number.map(|number| format!(":{number}")).unwrap_or_default();
        format!("{}{}{}", self.file, number(self.line), number(self.column))
    }
}

impl fmt::Display for ScriptLocation {
    /// `master.rhai:12: expect(...)`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.short())?;
        self.source.as_ref().map_or(Ok(()), |source| write!(f, ": {source}"))
    }
}

impl From<&core::panic::Location<'_>> for ScriptLocation {
    fn from(at: &core::panic::Location<'_>) -> Self {
        let file = at.file().to_owned();
        Self { file, line: Some(at.line()), column: Some(at.column()), source: None }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.what)?;
        let location = self.location.as_ref().map(ScriptLocation::to_string);
        let rows = [
            ("expected", &self.expected),
            ("actual", &self.actual),
            ("section", &self.section),
            ("line", &location),
        ];
        for (name, text) in rows {
            if let Some(text) = text {
                write!(f, "\n  {name:<8}  {text}")?;
            }
        }
        write!(f, "\n  {:<8}  {} emulated", "time", seconds(self.time_us))?;
        if self.findings > 0 {
            write!(f, "\n  access checker: {}", plural(self.findings, "finding"))?;
            if self.findings > self.first_findings.len() as u64 {
                f.write_str(", the first of them")?;
            }
        }
        self.first_findings.iter().try_for_each(|line| write!(f, "\n    {line}"))?;
        if !self.faults.is_empty() {
            f.write_str("\n  faults:")?;
        }
        self.faults.iter().try_for_each(|line| write!(f, "\n    {line}"))?;
        if !self.journal.is_empty() {
            f.write_str("\n  journal, last entries:")?;
        }
        self.journal.iter().try_for_each(|line| write!(f, "\n    {}", line.text))
    }
}

/// A test that returns an error prints it with `Debug`. So `Debug` also prints the text for people.
impl fmt::Debug for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
