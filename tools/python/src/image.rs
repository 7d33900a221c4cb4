//! The image of a PLC of a running instance, mapped.

use crate::errors;
use crate::given::{self, ValueArgument};
use crate::instance;
use crate::register::{Array, Register, places, register_of};
use crate::snapshot::Snapshot;
use crate::tables::Memory;
use commram::devices;
use commram::identity::DeviceIndex;
use commram::layout::{DeviceFit, Fit, NamedLocation, RegisterPhase};
use commram::memory::{AttachMode, Attached, MemoryError};
use commram::script::MemoryCopy;
use core::time::Duration;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyAny;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, RwLock};
use std::time::Instant;

/// Interval at which a wait checks for signals.
const SLICE: Duration = Duration::from_millis(100);
/// Name of the default PLC, if such a PLC exists: the PLC of the built-in plant.
const USUAL: &str = "line";

/// An attached image. Every thread may use it.
#[pyclass(name = "Image", module = "commram._native", subclass, frozen)]
pub(crate) struct PyImage {
    attached: RwLock<Option<Arc<Attached>>>,
    fitted: DeviceFit,
    /// Locations of names that have been looked up.
    found: Mutex<HashMap<String, Arc<NamedLocation>>>,
    #[pyo3(get)]
    instance: String,
    #[pyo3(get)]
    plc: String,
    #[pyo3(get)]
    path: String,
    #[pyo3(get)]
    generation: u32,
    /// Time of the last check that the process of the emulator exists.
    checked: Mutex<Instant>,
}

impl PyImage {
    fn open(&self) -> PyResult<Arc<Attached>> {
        let attached = self.attached.read().ok().and_then(|attached| attached.clone());
        attached.ok_or_else(|| errors::of_class("Error", "this is closed; attach again"))
    }

    /// Returns the image if its emulator still serves it. A killed emulator is noticed after [`SLICE`], because this check
    /// needs system calls.
    fn served(&self) -> PyResult<Arc<Attached>> {
        let attached = self.open()?;
        let mut checked = self.checked.lock().unwrap_or_else(|error| error.into_inner());
        let outcome = if checked.elapsed() < SLICE {
            attached.check_header()
        } else {
            attached.check().inspect(|()| *checked = Instant::now())
        };
        drop(checked);
        outcome.map(|()| attached).map_err(|error| errors::memory(&error))
    }

    fn find(&self, name: &str) -> PyResult<Arc<NamedLocation>> {
        // Errors are made without the lock, because code of a finalizer, which uses this object too, may run meanwhile.
        let found = || self.found.lock().unwrap_or_else(|error| error.into_inner());
        if let Some(place) = found().get(name) {
            return Ok(Arc::clone(place));
        }
        let place = NamedLocation::parse(&self.fitted, name)
            .map_err(|error| errors::of_class("UnknownName", error))?;
        if place.plc.as_ref().is_some_and(|plc| *plc != self.plc) {
            let text =
                format!("{name}: this is the RAM of PLC {}; attach to the other one for itself", self.plc);
            return Err(errors::of_class("UnknownName", text));
        }
        let place = Arc::new(place);
        found().insert(name.to_owned(), Arc::clone(&place));
        Ok(place)
    }

    /// Returns the place of a register, and the bits of a value for this register.
    fn value(&self, name: &str, value: &ValueArgument) -> PyResult<(Arc<NamedLocation>, u32)> {
        let place = self.find(name)?;
        let bits = value.0.bits(&place).map_err(|error| PyValueError::new_err(error.to_string()))?;
        Ok((place, bits))
    }

    fn load(attached: &Attached, place: &NamedLocation) -> PyResult<u32> {
        attached.segment().load(place.offset(), place.width()).map_err(|error| errors::memory(&error))
    }

    fn number(place: &NamedLocation, live: RegisterPhase, value: u32) -> i64 {
        match place.bit() {
            Some(bit) => i64::from(value >> bit & 1),
            None => place.ty(live).number(value),
        }
    }

    fn live(attached: &Attached, place: &NamedLocation) -> PyResult<RegisterPhase> {
        let Some(status) = place.status() else { return Ok(place.last_phase()) };
        let address = status.address();
        let value = attached.segment().load(address.offset(), address.width());
        Ok(place.phase(Some(value.map_err(|error| errors::memory(&error))?)))
    }
}

#[pymethods]
impl PyImage {
    #[new]
    #[pyo3(signature = (instance = "default", plc = None, writable = true))]
    fn new(py: Python<'_>, instance: &str, plc: Option<&str>, writable: bool) -> PyResult<Self> {
        let plc = match plc {
            Some(plc) => plc.to_owned(),
            None => only(instance, py.detach(|| instance::plcs(instance))?)?,
        };
        let mode = if writable { AttachMode::ReadWrite } else { AttachMode::ReadOnly };
        let attached = py.detach(|| devices::attach(instance, &plc, mode));
        let (attached, device) = attached.map_err(|error| errors::memory(&error))?;
        let header = attached.header_snapshot();
        // The library lets a reader open the image of a dead emulator; Python code may not.
        attached.check().map_err(|error| errors::memory(&error))?;
        Ok(Self {
            fitted: header.fitted(device),
            found: Mutex::default(),
            instance: instance.to_owned(),
            plc,
            path: attached.path().display().to_string(),
            generation: attached.generation(),
            attached: RwLock::new(Some(Arc::new(attached))),
            checked: Mutex::new(Instant::now()),
        })
    }

    fn close(&self) {
        *self.attached.write().unwrap_or_else(|error| error.into_inner()) = None;
    }

    #[getter]
    fn closed(&self) -> bool {
        self.open().is_err()
    }

    #[pyo3(signature = (area = None))]
    fn names(&self, area: Option<&str>) -> Vec<String> {
        places(self.fitted, |place| area.is_none_or(|area| area == place))
    }

    fn register(&self, name: &str) -> PyResult<Register> {
        let place = self.find(name)?;
        register_of(self.fitted, NamedLocation::clone(&place), name)
    }

    fn peek(&self, register: &str) -> PyResult<i64> {
        let (attached, place) = (self.served()?, self.find(register)?);
        Ok(Self::number(&place, place.last_phase(), Self::load(&attached, &place)?))
    }

    fn poke(&self, register: &str, value: ValueArgument) -> PyResult<()> {
        let (place, bits) = self.value(register, &value)?;
        whole(&place)?;
        let attached = self.served()?;
        attached.segment().store(place.offset(), place.width(), bits).map_err(|error| errors::memory(&error))
    }

    fn __getitem__(&self, register: &str) -> PyResult<i64> {
        self.peek(register)
    }

    fn __setitem__(&self, register: &str, value: ValueArgument) -> PyResult<()> {
        self.poke(register, value)
    }

    fn compare_exchange(
        &self,
        register: &str,
        expected: ValueArgument,
        new: ValueArgument,
    ) -> PyResult<bool> {
        let ((place, current), (_, new)) = (self.value(register, &expected)?, self.value(register, &new)?);
        whole(&place)?;
        let attached = self.served()?;
        let outcome = attached.segment().compare_exchange(place.offset(), place.width(), current, new);
        Ok(outcome.map_err(|error| errors::memory(&error))?.is_ok())
    }

    fn text(&self, register: &str) -> PyResult<String> {
        let (attached, place) = (self.served()?, self.find(register)?);
        Ok(place.meaning(Self::live(&attached, &place)?, Self::load(&attached, &place)?))
    }

    fn describe(&self, register: &str) -> PyResult<String> {
        let (attached, place) = (self.served()?, self.find(register)?);
        let (live, value) = (Self::live(&attached, &place)?, Self::load(&attached, &place)?);
        let text =
            format!("{} = {}  {}", place.name(live), place.format(live, value), place.meaning(live, value));
        Ok(text.trim_end().to_owned())
    }

    fn check(&self) -> PyResult<()> {
        self.open()?.check().map_err(|error| errors::memory(&error))
    }

    /// Makes the firmware poll the registers at once.
    fn ring(&self) -> PyResult<()> {
        self.served()?.ring().map_err(|error| errors::memory(&error))
    }

    #[pyo3(signature = (register, wanted, timeout = 5.0))]
    fn wait(&self, py: Python<'_>, register: &str, wanted: Bound<'_, PyAny>, timeout: f64) -> PyResult<i64> {
        let (attached, place) = (self.served()?, self.find(register)?);
        let whole = given::timeout(timeout)?;
        let aim = if wanted.is_callable() { None } else { Some(self.value(register, &wanted.extract()?)?.1) };
        let (wanted, raised) = (wanted.unbind(), Mutex::new(None));
        let number = |value| Self::number(&place, place.last_phase(), value);
        let mask = place.bit().map_or(u32::MAX, |bit| 1 << bit);
        let is_it = |value: u32| match aim {
            Some(aim) => value & mask == aim << place.bit().unwrap_or(0),
            None => Python::attach(|py| {
                let held = wanted.bind(py).call1((number(value),)).and_then(|held| held.is_truthy());
                held.unwrap_or_else(|error| {
                    *raised.lock().unwrap_or_else(|error| error.into_inner()) = Some(error);
                    true
                })
            }),
        };
        let start = Instant::now();
        let outcome = py.detach(|| {
            loop {
                let left = whole.saturating_sub(start.elapsed());
                match attached.wait_register(place.offset(), place.width(), left.min(SLICE), is_it) {
                    Err(MemoryError::RegisterTimeout { .. }) if errors::is_interrupted() || self.closed() => {
                        return Err(errors::interrupt());
                    }
                    Err(MemoryError::RegisterTimeout { .. }) if start.elapsed() < whole => {}
                    Err(MemoryError::RegisterTimeout { last, .. }) => return Ok(Err(last)),
                    other => return other.map(Ok).map_err(|error| errors::memory(&error)),
                }
            }
        })?;
        if let Some(error) = raised.into_inner().unwrap_or_else(|error| error.into_inner()) {
            return Err(error);
        }
        outcome.map(number).map_err(|last| {
            let live = Self::live(&attached, &place).unwrap_or(place.last_phase());
            let aim = aim.map_or_else(
                || "what was awaited".to_owned(),
                |aim| place.format(live, aim << place.bit().unwrap_or(0)),
            );
            let text = format!(
                "{} did not become {aim} within {timeout} s, it is {}: {}",
                place.label(live),
                place.format(live, last),
                place.meaning(live, last)
            );
            errors::of_class("Timeout", text)
        })
    }

    #[pyo3(signature = (area = None))]
    fn snapshot(&self, area: Option<&str>) -> PyResult<Snapshot> {
        let attached = self.served()?;
        let with_registers = || {
            let areas = self.fitted.device().named_areas();
            areas.filter(|area| !area.structures.is_empty() && self.fitted.area(area) != Fit::Empty)
        };
        let areas: Vec<_> =
            with_registers().filter(|known| area.is_none_or(|name| known.name == name)).collect();
        if areas.is_empty() {
            let known = with_registers().map(|area| area.name).collect::<Vec<_>>().join(", ");
            let text =
                format!("there is no area '{}' with registers; there are: {known}", area.unwrap_or_default());
            return Err(errors::of_class("UnknownName", text));
        }
        let copy = |area| {
            MemoryCopy::read((DeviceIndex(0), String::new()), self.fitted, area, |offset, len| {
                let mut bytes = vec![0; len as usize];
                attached.segment().read_range(offset, &mut bytes).map(|()| bytes)
            })
        };
        let copies = areas.into_iter().map(copy).collect::<Result<_, MemoryError>>();
        let time = attached.header_snapshot().virtual_time_us.load();
        Ok(Snapshot::new(time, copies.map_err(|error| errors::memory(&error))?))
    }

    #[pyo3(signature = (plc = ""))]
    fn memory(&self, plc: &str) -> PyResult<Memory> {
        if !plc.is_empty() && plc != self.plc {
            return Err(errors::of_class(
                "UnknownName",
                format!("this is the RAM of PLC {}, not of {plc}", self.plc),
            ));
        }
        Ok(Memory::of(self.open()?.segment().clone()))
    }

    fn array_of(&self, name: &str) -> PyResult<(String, Array)> {
        Ok((self.plc.clone(), Array::find(self.fitted, name)?))
    }
}

fn whole(place: &NamedLocation) -> PyResult<()> {
    match place.bit() {
        None => Ok(()),
        Some(_) => {
            let text = format!("{}: a single bit cannot be written; name the whole register", place.text());
            Err(PyValueError::new_err(text))
        }
    }
}

/// Returns the PLC for names without a PLC.
fn only(instance: &str, plcs: Vec<String>) -> PyResult<String> {
    match plcs.as_slice() {
        [one] => Ok(one.clone()),
        several if several.iter().any(|plc| plc == USUAL) => Ok(USUAL.to_owned()),
        several => {
            let text = format!("instance '{instance}' has several PLCs; name one: {}", several.join(", "));
            Err(errors::of_class("NotAttached", text))
        }
    }
}
