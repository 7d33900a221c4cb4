//! Return values of verbs: frames, records of the journal, findings, faults, changes.

use commram::devices;
use commram::fault::FaultStatus;
use commram::journal::text::Text;
use commram::journal::{Entry, Format, Names};
use commram::script::{Bench, ScenarioError, SeenFrame};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// A frame that was on a bus.
#[pyclass(module = "commram._native", frozen, eq)]
#[derive(Clone, PartialEq)]
pub(crate) struct Frame {
    /// Emulated time of the end of the frame, in microseconds.
    #[pyo3(get)]
    time: u64,
    #[pyo3(get)]
    id: u32,
    #[pyo3(get)]
    extended: bool,
    #[pyo3(get)]
    remote: bool,
    data: Vec<u8>,
    /// Text of the record; empty if unknown.
    #[pyo3(get)]
    text: String,
    shown: String,
}

pub(crate) fn frame(seen: &SeenFrame) -> Frame {
    let field = seen.frame.arbitration();
    Frame {
        time: seen.time_us,
        id: field.number(),
        extended: field.is_extended(),
        remote: field.is_remote(),
        data: seen.frame.payload().data().to_vec(),
        text: seen.text.clone(),
        shown: seen.to_string(),
    }
}

#[pymethods]
impl Frame {
    #[getter]
    fn data<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.data)
    }

    fn __repr__(&self) -> String {
        format!("<frame {}>", self.shown)
    }

    fn __str__(&self) -> String {
        self.shown.clone()
    }
}

/// A record of the journal.
#[pyclass(module = "commram._native", frozen, eq, get_all)]
#[derive(Clone, PartialEq)]
pub(crate) struct Record {
    /// Emulated time in microseconds.
    time: u64,
    kind: String,
    /// Number of equal events that the record represents.
    count: u32,
    /// The line of `commram trace`.
    text: String,
}

/// Returns the records from an emulated time on.
///
/// # Errors
/// The instance has ended.
pub(crate) fn records(bench: &mut Bench, since: u64) -> Result<Vec<Record>, ScenarioError> {
    let records = bench.journal(since)?;
    let mut text = Text::new(bench.names().clone(), devices::catalogue());
    let record = |record| {
        let mut line = String::new();
        text.record(record, &mut line);
        let (kind, line) = (record.event.kind().name().to_owned(), line.trim().to_owned());
        Record { time: record.time_us, kind, count: record.count, text: line }
    };
    Ok(records.iter().map(record).collect())
}

#[pymethods]
impl Record {
    fn __repr__(&self) -> String {
        format!("<record {}>", self.text)
    }

    fn __str__(&self) -> String {
        self.text.clone()
    }
}

/// Finding of the access checker, of one rule at one register.
#[pyclass(module = "commram._native", frozen, eq)]
#[derive(Clone, PartialEq)]
pub(crate) struct Finding {
    /// Severity of the rule: "error" or "warning".
    #[pyo3(get)]
    severity: String,
    #[pyo3(get)]
    rule: String,
    #[pyo3(get)]
    register: String,
    /// The value last written, as a number of the register's type.
    #[pyo3(get)]
    value: i64,
    /// The value in the notation of IEC 61131-3.
    value_text: String,
    /// Number of occurrences of the finding.
    #[pyo3(get)]
    count: u64,
    /// Emulated time of the first occurrence, in microseconds.
    #[pyo3(get)]
    time: u64,
    /// Text of the rule.
    #[pyo3(get)]
    text: String,
}

impl Finding {
    pub(crate) fn new(entry: &Entry, bench: &Bench) -> Self {
        let rule = entry.last.rule;
        Self {
            severity: rule.severity().name().to_owned(),
            rule: rule.id().to_owned(),
            register: bench.finding_place(entry),
            value: bench.finding_value(entry),
            value_text: entry.last.value_text(bench.names().fitted(entry.last.plc)),
            count: entry.count,
            time: entry.first_us,
            text: rule.text().to_owned(),
        }
    }
}

#[pymethods]
impl Finding {
    fn __repr__(&self) -> String {
        format!("<{self}>", self = self.__str__())
    }

    fn __str__(&self) -> String {
        let Self { severity, rule, register, value_text, count, text, .. } = self;
        format!("{severity}: {rule}: {register} := {value_text}, {count} times: {text}")
    }
}

/// A pending or active fault.
#[pyclass(module = "commram._native", frozen, eq, get_all)]
#[derive(Clone, PartialEq)]
pub(crate) struct Fault {
    number: u16,
    kind: String,
    /// The words of `commram fault add` for the fault.
    text: String,
    /// True if the fault has begun.
    acting: bool,
    /// Number of times that the fault has hit.
    hits: u32,
}

impl Fault {
    pub(crate) fn new(status: &FaultStatus, names: &Names) -> Self {
        Self {
            number: status.id,
            kind: status.fault.kind().name().to_owned(),
            text: status.fault.text(names),
            acting: status.acting,
            hits: status.hits,
        }
    }
}

#[pymethods]
impl Fault {
    fn __repr__(&self) -> String {
        format!("<fault {}: {}>", self.number, self.text)
    }
}

/// A register with a changed value.
#[pyclass(module = "commram._native", frozen, eq, get_all)]
#[derive(Clone, PartialEq)]
pub(crate) struct Change {
    register: String,
    /// Address of the register.
    address: String,
    /// The old value of the register as bits.
    before: u32,
    /// The new value of the register as bits.
    after: u32,
    /// Text with the old and the new value and their meanings.
    text: String,
}

impl From<commram::script::Change> for Change {
    fn from(change: commram::script::Change) -> Self {
        let commram::script::Change { register, address, before, after, text } = change;
        Self { register, address, before, after, text }
    }
}

#[pymethods]
impl Change {
    fn __repr__(&self) -> String {
        format!("<change of {} ({}): {}>", self.register, self.address, self.text)
    }
}
