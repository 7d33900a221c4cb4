//! Converts errors of the library to exceptions. Their classes are defined in Python: `python/commram/_errors.py`.

use commram::channel::ClientError;
use commram::memory::MemoryError;
use commram::request::{Code, Refused};
use commram::script::{Failure, ScenarioError};
use core::cell::RefCell;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;

thread_local! {
    /// Exception that a signal handler has raised while this thread was in a verb.
    static RAISED: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// True if the handler of a signal raises an exception now: KeyboardInterrupt, on the main thread.
pub(crate) fn is_interrupted() -> bool {
    let raised = Python::attach(|py| py.check_signals().err());
    let is_raised = raised.is_some();
    if is_raised {
        RAISED.set(raised);
    }
    is_raised
}

/// Returns the exception of a verb that has ended early: that of the signal handler, or that of a closed plant if the
/// handler has closed the plant and raised none.
pub(crate) fn interrupt() -> PyErr {
    RAISED.take().unwrap_or_else(closed)
}

/// Returns the exception for the use of a closed plant or connection.
pub(crate) fn closed() -> PyErr {
    of_class("Error", "this is closed; make a new one")
}

/// Returns an exception of the class of this name.
pub(crate) fn of_class(class: &str, text: impl ToString) -> PyErr {
    let make = |py: Python<'_>| {
        let class = PyModule::import(py, "commram._errors")?.getattr(class)?;
        Ok(PyErr::from_value(class.call1((text.to_string(),))?))
    };
    Python::attach(|py| make(py).unwrap_or_else(|error: PyErr| error))
}

/// Returns the exception of a verb's error.
pub(crate) fn of(error: ScenarioError) -> PyErr {
    match error {
        ScenarioError::Failed(failure) => failed("Failed", *failure),
        ScenarioError::Interrupted => interrupt(),
        ScenarioError::Layout(_) | ScenarioError::WhichPlc { .. } | ScenarioError::Unknown { .. } => {
            of_class("UnknownName", error)
        }
        ScenarioError::Plant(_) => of_class("PlantError", error),
        ScenarioError::Memory(error) => memory(&error),
        ScenarioError::Refused(error) => refused(&error),
        ScenarioError::Client(error) => client(&error),
        ScenarioError::TooLong { .. } | ScenarioError::WrongReply(_) => of_class("Error", error),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// Returns the exception of the error of a verb that waits: a failure is a `Timeout`.
pub(crate) fn of_wait(error: ScenarioError) -> PyErr {
    match error {
        ScenarioError::Failed(failure) => failed("Timeout", *failure),
        other => of(other),
    }
}

fn failed(class: &str, mut failure: Failure) -> PyErr {
    // The location of the failure is a line of the test, which Python reports itself.
    failure.location = None;
    let error = of_class(class, &failure);
    let describe = |py: Python<'_>| {
        let value = error.value(py);
        value.setattr("what", failure.what)?;
        value.setattr("register", failure.register)?;
        value.setattr("address", failure.address)?;
        value.setattr("expected", failure.expected)?;
        value.setattr("actual", failure.actual)?;
        value.setattr("time", failure.time_us)?;
        value.setattr("section", failure.section)?;
        let journal: Vec<_> = failure.journal.into_iter().map(|line| line.text).collect();
        value.setattr("journal", journal)
    };
    match Python::attach(describe) {
        Ok(()) => error,
        Err(other) => other,
    }
}

fn refused(error: &Refused) -> PyErr {
    match error.code {
        Code::VALUE_TOO_WIDE | Code::NEVER_MATCHES => PyValueError::new_err(error.to_string()),
        Code::SHUTTING_DOWN => of_class("Gone", error),
        Code(code) => {
            let error = of_class("Refused", error);
            let set = Python::attach(|py| error.value(py).setattr("code", code));
            set.err().unwrap_or(error)
        }
    }
}

/// Returns the exception of an image's error.
pub(crate) fn memory(error: &MemoryError) -> PyErr {
    let class = match error {
        MemoryError::ReadOnly { .. } => return PyTypeError::new_err(error.to_string()),
        MemoryError::ValueTooWide { .. } => return PyValueError::new_err(error.to_string()),
        MemoryError::OutOfRange { .. } | MemoryError::Misaligned { .. } | MemoryError::InHeader { .. } => {
            "UnknownName"
        }
        MemoryError::EmulatorStopped { .. }
        | MemoryError::EmulatorDied { .. }
        | MemoryError::EmulatorRestarted { .. } => "Gone",
        MemoryError::Timeout { .. } | MemoryError::RegisterTimeout { .. } => "Timeout",
        _ => "NotAttached",
    };
    of_class(class, error)
}

/// Returns the exception of a connection's error.
pub(crate) fn client(error: &ClientError) -> PyErr {
    match error {
        ClientError::Refused(error) => refused(error),
        ClientError::EmulatorGone { .. } | ClientError::Replaced { .. } | ClientError::Unanswered { .. } => {
            of_class("Gone", error)
        }
        ClientError::Timeout { .. } => of_class("Timeout", error),
        _ => of_class("NotAttached", error),
    }
}

/// Returns the exception for an argument of the wrong type.
pub(crate) fn wrong_type(given: &Bound<'_, PyAny>, right: &str) -> PyErr {
    let shown = given.repr().unwrap_or_else(|_| PyString::new(given.py(), "this"));
    let class = given.get_type().name().map_or_else(|_| String::new(), |name| format!(" is a {name};"));
    PyTypeError::new_err(format!("{shown}{class} {right}"))
}
