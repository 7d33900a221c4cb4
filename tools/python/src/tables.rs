//! Tables of the library, and memory for Python.

use crate::errors;
use crate::given::Time;
use crate::register::{Register, places, register_of};
use commram::devices;
use commram::export::Scope;
use commram::layout::{DeviceFit, NamedLocation};
use commram::memory::Segment;
use commram::memory::contract::{self, FieldKind};
use commram::memory::header::{ABI_VERSION, HEADER_SIZE, MAGIC};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The memory of a PLC; mapped for as long as this lives.
#[pyclass(module = "commram._native", frozen)]
pub(crate) struct Memory {
    segment: Segment,
}

impl Memory {
    pub(crate) fn of(segment: Segment) -> Self {
        Self { segment }
    }
}

#[pymethods]
impl Memory {
    /// Address in this process.
    #[getter]
    fn base(&self) -> usize {
        self.segment.base().addr()
    }

    #[getter]
    fn size(&self) -> usize {
        self.segment.size()
    }

    #[getter]
    fn writable(&self) -> bool {
        self.segment.is_writable()
    }
}

/// Returns a time in microseconds.
#[pyfunction]
pub(crate) fn microseconds(time: Time) -> PyResult<u64> {
    time.0.us().map_err(|error| PyValueError::new_err(error.to_string()))
}

fn default_registers() -> DeviceFit {
    DeviceFit::unknown(devices::default().layout)
}

/// Returns the names of the default device's registers.
#[pyfunction]
#[pyo3(signature = (area = None))]
pub(crate) fn names(area: Option<&str>) -> Vec<String> {
    places(default_registers(), |place| area.is_none_or(|area| area == place))
}

/// Returns the description of a register of the default device.
#[pyfunction]
pub(crate) fn register(name: &str) -> PyResult<Register> {
    let fitted = default_registers();
    let place =
        NamedLocation::parse(&fitted, name).map_err(|error| errors::of_class("UnknownName", error))?;
    register_of(fitted, place, name)
}

/// Returns the magic number, attach contract, layout hash, sizes of the header page and of the image.
#[pyfunction]
pub(crate) fn default_device() -> (u64, u32, u64, usize, usize) {
    let device = devices::default().layout;
    (MAGIC, ABI_VERSION, device.layout_hash, HEADER_SIZE, device.segment_size())
}

/// An enumeration: its name, true if its members are flags, the members, and the numbers of the lowest bits of fields.
type Enumeration = (String, bool, Vec<(String, i64)>, Vec<(String, u32)>);

/// Returns the enumerations of all devices. If several devices have an enumeration of the same name, the first device
/// counts.
#[pyfunction]
pub(crate) fn enumerations() -> Vec<Enumeration> {
    let mut all: Vec<Enumeration> = Vec::new();
    for device in devices::all() {
        let Ok(scope) = Scope::new(device.layout, None) else { continue };
        for of in commram::export::enumerations(&scope) {
            if !all.iter().any(|(name, ..)| *name == of.name) {
                let members = of.members.into_iter().map(|(name, value, _)| (name, value)).collect();
                all.push((of.name, of.is_flags, members, of.shifts));
            }
        }
    }
    all
}

/// Returns the codes of the header page.
#[pyfunction]
pub(crate) fn codes() -> Vec<(&'static str, Vec<(&'static str, u32)>)> {
    let codes = |of: &contract::Codes| of.codes.iter().map(|(value, name, _)| (*name, *value)).collect();
    contract::CODES.iter().map(|of| (of.name, codes(of))).collect()
}

/// Returns the structures of the header page: for each field its offset, its kind, the number of elements, and the size
/// of one element in bytes.
#[pyfunction]
pub(crate) fn header(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let structures = PyDict::new(py);
    for of in contract::structures() {
        let fields = PyDict::new(py);
        for field in of.fields {
            let kind = match field.kind {
                FieldKind::Integer(1) => "B",
                FieldKind::Integer(4) => "I",
                FieldKind::Integer(_) => "Q",
                FieldKind::Struct(of) => of.name,
            };
            fields.set_item(field.name, (field.offset, kind, field.count, field.kind.bytes()))?;
        }
        structures.set_item(of.name, fields)?;
    }
    Ok(structures)
}
