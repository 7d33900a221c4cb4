//! Registers at one moment, to be compared.

use crate::errors;
use crate::records::Change;
use commram::script::MemoryCopy;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The registers of one area or of all at one moment. It cannot be restored: it lacks the internal state of the
/// firmware.
#[pyclass(module = "commram._native", frozen)]
#[derive(Clone)]
pub(crate) struct Snapshot {
    /// Emulated time in microseconds.
    #[pyo3(get)]
    time: u64,
    copies: Vec<MemoryCopy>,
}

impl Snapshot {
    pub(crate) fn new(time: u64, copies: Vec<MemoryCopy>) -> Self {
        Self { time, copies }
    }

    pub(crate) fn copies(&self) -> &[MemoryCopy] {
        &self.copies
    }

    fn is_like(&self, other: &Self) -> bool {
        let mut pairs = self.copies.iter().zip(&other.copies);
        self.copies.len() == other.copies.len() && pairs.all(|(own, other)| own.is_of_area_of(other))
    }
}

#[pymethods]
impl Snapshot {
    /// Names of the areas in the snapshot.
    #[getter]
    fn areas(&self) -> Vec<String> {
        self.copies.iter().map(MemoryCopy::area).collect()
    }

    /// Returns the changes from this snapshot to a later one.
    fn diff(&self, later: &Self) -> PyResult<Vec<Change>> {
        if !self.is_like(later) {
            let (own, other) = (self.areas().join(", "), later.areas().join(", "));
            let text = format!("these are snapshots of different registers: of {own}; of {other}");
            return Err(PyValueError::new_err(text));
        }
        let pairs = self.copies.iter().zip(&later.copies);
        Ok(pairs.flat_map(|(own, later)| own.changes(later)).map(Change::from).collect())
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.is_like(other) && self.diff(other).is_ok_and(|changes| changes.is_empty())
    }

    /// Returns the names of the registers with the numbers that they held.
    fn items(&self) -> Vec<(String, i64)> {
        self.copies.iter().flat_map(MemoryCopy::registers).collect()
    }

    fn keys(&self) -> Vec<String> {
        self.items().into_iter().map(|(name, _)| name).collect()
    }

    fn __getitem__(&self, register: &str) -> PyResult<i64> {
        let found = self.items().into_iter().find(|(name, _)| name == register);
        let areas =
            || format!("{register}: no register of this snapshot, which is of {}", self.areas().join(", "));
        found.map(|(_, value)| value).ok_or_else(|| errors::of_class("UnknownName", areas()))
    }

    fn __contains__(&self, register: &str) -> bool {
        self.items().iter().any(|(name, _)| name == register)
    }

    fn __len__(&self) -> usize {
        self.items().len()
    }

    fn _ipython_key_completions_(&self) -> Vec<String> {
        self.keys()
    }

    fn __repr__(&self) -> String {
        format!("<snapshot of {} at {} us>", self.areas().join(", "), self.time)
    }
}
