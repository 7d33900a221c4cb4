//! A register that is resolved once and used repeatedly.

use crate::bench::PyBench;
use crate::given::ValueArgument;
use commram::script::Register as Found;
use pyo3::prelude::*;

/// A register of a plant or of a running instance.
#[pyclass(module = "commram._native", frozen)]
pub(crate) struct Handle {
    of: Py<PyBench>,
    found: Found,
    #[pyo3(get)]
    name: String,
}

impl Handle {
    pub(crate) fn new(of: Py<PyBench>, found: Found, name: &str) -> Self {
        Self { of, found, name: name.to_owned() }
    }
}

#[pymethods]
impl Handle {
    fn peek(&self, py: Python<'_>) -> PyResult<i64> {
        self.of.get().peek_at(py, &self.found)
    }

    fn poke(&self, py: Python<'_>, value: ValueArgument) -> PyResult<()> {
        self.of.get().poke_at(py, &self.found, value)
    }

    #[getter(value)]
    fn value(&self, py: Python<'_>) -> PyResult<i64> {
        self.peek(py)
    }

    #[setter(value)]
    fn set_value(&self, py: Python<'_>, value: ValueArgument) -> PyResult<()> {
        self.poke(py, value)
    }

    fn __repr__(&self) -> String {
        format!("<handle of {}>", self.name)
    }
}
