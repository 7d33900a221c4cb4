//! Descriptions of registers, and places of arrays.

use crate::errors;
use commram::layout::{DeviceFit, NamedLocation, Owner, RegType, RegisterRef, split_plc};
use pyo3::prelude::*;

/// One register, or one element of an array.
#[pyclass(module = "commram._native", frozen)]
#[derive(Clone)]
pub(crate) struct Register {
    #[pyo3(get)]
    name: String,
    place: NamedLocation,
    known: Option<RegisterRef>,
}

/// Returns the description of the register at `place`, which the caller has written as `name`.
///
/// # Errors
/// No register exists at the place.
pub(crate) fn register_of(fitted: DeviceFit, place: NamedLocation, name: &str) -> PyResult<Register> {
    let target = fitted.target(name).map_err(|error| errors::of_class("UnknownName", error))?;
    let known = target.registers.into_iter().find(|known| known.address() == place.address());
    Ok(Register { name: name.to_owned(), place, known })
}

/// Returns the code of a type as in Python's modules `struct` and `array`.
fn code(ty: RegType) -> &'static str {
    match (ty.width(), ty.number(u32::MAX) < 0) {
        (1, false) => "B",
        (1, true) => "b",
        (2, false) => "H",
        (2, true) => "h",
        (_, false) => "I",
        (_, true) => "i",
    }
}

#[pymethods]
impl Register {
    /// Byte of the image.
    #[getter]
    fn address(&self) -> u32 {
        self.place.offset()
    }

    #[getter]
    fn iec_address(&self) -> String {
        self.place.address().to_string()
    }

    #[getter]
    fn code(&self) -> &'static str {
        code(self.place.ty(self.place.last_phase()))
    }

    #[getter]
    fn r#type(&self) -> &'static str {
        self.place.ty(self.place.last_phase()).name()
    }

    /// Width of the register in bytes.
    #[getter]
    fn width(&self) -> u32 {
        self.place.width().bytes()
    }

    /// Writer of the register: "PLC", "firmware" or "both".
    #[getter]
    fn owner(&self) -> String {
        self.known.map_or(Owner::Both, |known| known.owner()).to_string()
    }

    /// Value of the register after power-on.
    #[getter]
    fn reset(&self) -> u32 {
        self.known.map_or(0, |known| known.reset())
    }

    #[getter]
    fn reserved(&self) -> bool {
        self.known.is_some_and(|known| known.is_reserved())
    }

    #[getter]
    fn meaning(&self) -> Option<&'static str> {
        self.known.and_then(|known| known.register.meaning).map(|meaning| meaning.name)
    }

    #[getter]
    fn doc(&self) -> &'static str {
        self.known.map_or("", |known| known.register.doc)
    }

    /// Pages of the manual.
    #[getter]
    fn page(&self) -> &'static str {
        self.known.map_or("", |known| known.register.page)
    }

    /// Source of the facts: "manual", or the facts that follow from decisions.
    #[getter]
    fn provenance(&self) -> String {
        self.known.map(|known| known.register.provenance()).unwrap_or_default()
    }

    /// Returns the meaning of a value.
    fn decode(&self, value: i64) -> String {
        match self.known {
            Some(known) => known.decode(value as u32),
            None => self.place.meaning(self.place.last_phase(), value as u32),
        }
    }

    fn __repr__(&self) -> String {
        format!("<register {} ({}): {}>", self.name, self.iec_address(), self.r#type())
    }
}

/// Returns the registers of the requested areas, each once.
pub(crate) fn registers(fitted: DeviceFit, is_wanted: impl Fn(&str) -> bool) -> Vec<RegisterRef> {
    let mut all: Vec<RegisterRef> = Vec::new();
    for area in fitted.device().named_areas().filter(|area| is_wanted(area.name)) {
        let mut known = std::collections::HashSet::new();
        let phases = area.all_phases().rev();
        let here = phases.flat_map(|live| fitted.registers_in(area, live));
        all.extend(here.filter(|register| known.insert(register.name())));
    }
    all
}

/// Returns the names of these registers.
pub(crate) fn places(fitted: DeviceFit, is_wanted: impl Fn(&str) -> bool) -> Vec<String> {
    registers(fitted, is_wanted).iter().map(RegisterRef::name).collect()
}

/// Place of an array or of a part of it: first byte, kind of element, and for each dimension the number of elements and
/// their distance in bytes.
#[derive(IntoPyObject)]
pub(crate) struct Array(u32, &'static str, Vec<(u16, u32)>);

impl Array {
    /// Returns the array of this name: `node2.a_RD_BMARRAY`, or `node2.a_RD_BMARRAY[1]` for one row.
    ///
    /// # Errors
    /// No register exists at the place.
    pub(crate) fn find(fitted: DeviceFit, text: &str) -> PyResult<Self> {
        let (_, name) = split_plc(text);
        let given: Vec<u16> =
            name.split('[').skip(1).filter_map(|part| part.split(']').next()?.parse().ok()).collect();
        let bare = |name: &str| -> String {
            name.split('[').map(|part| part.split_once(']').map_or(part, |(_, rest)| rest)).collect()
        };
        let (wanted, area) = (bare(name), name.split('.').next().unwrap_or_default());
        let mut elements = registers(fitted, |known| known == area).into_iter();
        let first = elements.find(|register| {
            let index = register.index.iter().take(given.len());
            bare(&register.name()) == wanted
                && given.len() <= register.register.dims.len()
                && index.eq(given.iter())
        });
        match first {
            Some(first) => {
                let rest = first.register.dims.iter().skip(given.len());
                Ok(Self(first.offset(), code(first.ty()), rest.map(|dim| (dim.count, dim.stride)).collect()))
            }
            None => Err(errors::of_class("UnknownName", format!("{text}: no such array of registers"))),
        }
    }
}
