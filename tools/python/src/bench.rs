//! A plant in this process or a running instance, with the verbs of scenarios.

use crate::errors;
use crate::given::{self, Data, Number, Plant, Time, ValueArgument};
use crate::handle::Handle;
use crate::instance;
use crate::lock::{Guard, Lock};
use crate::records::{Change, Fault, Finding, Frame, Record, frame, records};
use crate::register::{Array, Register, places, register_of};
use crate::snapshot::Snapshot;
use crate::tables::Memory;
use commram::devices;
use commram::identity::DeviceIndex;
use commram::layout::Fit;
use commram::plant::PlantConfig;
use commram::script::{Bench, Field, Fields, Register as Found, ScenarioError, Span};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Minimum emulated time, in microseconds, of a step that lets other threads run. For a shorter step, switching threads
/// would cost more.
const LONG_US: u64 = 10_000;

/// State of an open plant or connection; `None` after it was closed.
struct State {
    bench: Option<Bench>,
    /// Resolved names. They stay valid: plants are not rebuilt.
    found: HashMap<String, Found>,
}

impl State {
    fn open(&mut self) -> PyResult<&mut Bench> {
        self.bench.as_mut().ok_or_else(errors::closed)
    }

    fn found(&mut self, name: &str) -> PyResult<(&mut Bench, &Found)> {
        let bench = self.bench.as_mut().ok_or_else(errors::closed)?;
        if !self.found.contains_key(name) {
            let found = bench.find(name).map_err(errors::of)?;
            self.found.insert(name.to_owned(), found);
        }
        self.found.get(name).map(|found| (bench, found)).ok_or_else(errors::closed)
    }
}

/// A plant or a running instance. Every thread may use it: requests of several threads run one after the other.
#[pyclass(name = "Bench", module = "commram._native", subclass, frozen)]
pub(crate) struct PyBench {
    state: Lock<State>,
    /// True if requests go to another process and take time.
    is_remote: bool,
    /// True if this was closed by a signal handler during a verb. The end of the verb then closes it.
    is_closing: Arc<AtomicBool>,
    /// The process that made this.
    process: u32,
}

impl Drop for PyBench {
    fn drop(&mut self) {
        if self.is_of_parent() {
            // The plant or connection stays with the process that made it. To end a connection here would remove its files,
            // and a plant may be in the middle of a step.
            core::mem::forget(self.state.get_mut().bench.take());
        }
    }
}

/// The state of a plant or connection while a verb uses it.
struct Held<'a> {
    py: Python<'a>,
    state: Guard<'a, State>,
    is_closing: &'a AtomicBool,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        if self.is_closing.swap(false, Ordering::Relaxed) {
            let bench = self.state.bench.take();
            self.py.detach(|| drop(bench));
        }
    }
}

impl PyBench {
    /// True if this process is a fork of the process that made this. A thread of that process may have held the lock at
    /// the moment of the fork, and this process does not have the thread, so the lock must not be used.
    fn is_of_parent(&self) -> bool {
        std::process::id() != self.process
    }

    fn lock<'a>(&'a self, py: Python<'a>) -> PyResult<Held<'a>> {
        if self.is_of_parent() {
            let (what, right) = match self.is_remote {
                true => ("connection", "connect again"),
                false => ("plant", "make a new Emulator"),
            };
            let text =
                format!("this {what} belongs to process {}; {right} in a forked process", self.process);
            return Err(errors::of_class("Error", text));
        }
        Ok(Held { py, state: self.state.lock(py)?, is_closing: &self.is_closing })
    }

    /// Runs a short operation.
    pub(crate) fn act<R>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut Bench) -> Result<R, ScenarioError> + Send,
    ) -> PyResult<R>
    where
        R: Send,
    {
        if self.is_remote {
            return self.take(py, act, errors::of);
        }
        act(self.lock(py)?.state.open()?).map_err(errors::of)
    }

    /// Runs a long operation. Other threads can run during this time.
    fn take<R: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut Bench) -> Result<R, ScenarioError> + Send,
        error: fn(ScenarioError) -> PyErr,
    ) -> PyResult<R> {
        let mut held = self.lock(py)?;
        let bench = held.state.open()?;
        py.detach(|| act(bench)).map_err(error)
    }

    pub(crate) fn peek_at(&self, py: Python<'_>, found: &Found) -> PyResult<i64> {
        self.act(py, |bench| bench.peek_at(found))
    }

    pub(crate) fn poke_at(&self, py: Python<'_>, found: &Found, value: ValueArgument) -> PyResult<()> {
        self.act(py, |bench| bench.poke_at(found, value.0))
    }
}

#[pymethods]
impl PyBench {
    #[new]
    #[pyo3(signature = (plant = None, instance = None, timeout = 0.0))]
    fn new(py: Python<'_>, plant: Option<Plant>, instance: Option<String>, timeout: f64) -> PyResult<Self> {
        let is_remote = instance.is_some();
        let bench = py.detach(|| match instance {
            None => own(plant.unwrap_or(Plant::BuiltIn)).map_err(errors::of),
            Some(instance) => {
                let client = instance::connect(&instance, given::timeout(timeout)?)?;
                Bench::attach(client).map_err(errors::of)
            }
        });
        let mut bench = bench?;
        // A limit is not necessary: a test ends by itself, or its runner ends it.
        bench.set_limit(u64::MAX);
        let is_closing = Arc::new(AtomicBool::new(false));
        let closes = Arc::clone(&is_closing);
        bench.set_interrupt(move || errors::is_interrupted() || closes.load(Ordering::Relaxed));
        let state = State { bench: Some(bench), found: HashMap::new() };
        Ok(Self { state: Lock::new(state), is_remote, is_closing, process: std::process::id() })
    }

    fn close(&self, py: Python<'_>) -> PyResult<()> {
        if self.is_of_parent() {
            return Ok(());
        }
        if self.state.is_held_here() {
            self.is_closing.store(true, Ordering::Relaxed);
            return Ok(());
        }
        let bench = self.lock(py)?.state.bench.take();
        py.detach(|| drop(bench));
        Ok(())
    }

    #[getter]
    fn closed(&self, py: Python<'_>) -> PyResult<bool> {
        if self.is_of_parent() {
            return Ok(true);
        }
        if self.state.is_held_here() {
            return Ok(self.is_closing.load(Ordering::Relaxed));
        }
        Ok(self.lock(py)?.state.bench.is_none())
    }

    #[getter]
    fn plcs(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.lock(py)?.state.open()?.names().plcs.clone())
    }

    #[getter]
    fn buses(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.lock(py)?.state.open()?.names().buses.clone())
    }

    /// Returns the names of all registers, or of those of one area.
    #[pyo3(signature = (area = None))]
    fn names(&self, py: Python<'_>, area: Option<&str>) -> PyResult<Vec<String>> {
        let mut held = self.lock(py)?;
        let names = held.state.open()?.names();
        let mut all = Vec::new();
        for (plc, fitted) in names.devices.iter().enumerate() {
            let prefix = prefix(&names.plcs, plc);
            let own = |place: &str| format!("{prefix}{place}");
            all.extend(
                places(*fitted, |place| area.is_none_or(|area| own(place) == area))
                    .into_iter()
                    .map(|name| own(&name)),
            );
        }
        Ok(all)
    }

    /// Returns the description of a register.
    fn register(&self, py: Python<'_>, name: &str) -> PyResult<Register> {
        let mut held = self.lock(py)?;
        let (bench, found) = held.state.found(name)?;
        let fitted = bench.names().fitted(found.plc());
        register_of(fitted, found.place().clone(), name)
    }

    fn handle(slf: Py<Self>, py: Python<'_>, name: &str) -> PyResult<Handle> {
        let found = slf.get().lock(py)?.state.found(name)?.1.clone();
        Ok(Handle::new(slf, found, name))
    }

    fn peek(&self, py: Python<'_>, register: &str) -> PyResult<i64> {
        let mut held = self.lock(py)?;
        let (bench, found) = held.state.found(register)?;
        if self.is_remote {
            return py.detach(|| bench.peek_at(found)).map_err(errors::of);
        }
        bench.peek_at(found).map_err(errors::of)
    }

    fn poke(&self, py: Python<'_>, register: &str, value: ValueArgument) -> PyResult<()> {
        let mut held = self.lock(py)?;
        let (bench, found) = held.state.found(register)?;
        if self.is_remote {
            return py.detach(|| bench.poke_at(found, value.0)).map_err(errors::of);
        }
        bench.poke_at(found, value.0).map_err(errors::of)
    }

    fn __getitem__(&self, py: Python<'_>, register: &str) -> PyResult<i64> {
        self.peek(py, register)
    }

    fn __setitem__(&self, py: Python<'_>, register: &str, value: ValueArgument) -> PyResult<()> {
        self.poke(py, register, value)
    }

    fn compare_exchange(
        &self,
        py: Python<'_>,
        register: &str,
        expected: ValueArgument,
        new: ValueArgument,
    ) -> PyResult<bool> {
        self.act(py, |bench| bench.compare_exchange(register, expected.0, new.0))
    }

    fn force(&self, py: Python<'_>, register: &str, value: ValueArgument) -> PyResult<()> {
        self.act(py, |bench| bench.force(register, value.0))
    }

    fn unforce(&self, py: Python<'_>, register: &str) -> PyResult<()> {
        self.act(py, |bench| bench.unforce(register))
    }

    fn describe(&self, py: Python<'_>, register: &str) -> PyResult<String> {
        self.act(py, |bench| bench.describe(register))
    }

    fn text(&self, py: Python<'_>, register: &str) -> PyResult<String> {
        self.act(py, |bench| bench.meaning(register))
    }

    #[pyo3(signature = (area = None))]
    fn snapshot(&self, py: Python<'_>, area: Option<&str>) -> PyResult<Snapshot> {
        self.act(py, |bench| {
            let areas = area.map_or_else(|| areas(bench), |area| vec![area.to_owned()]);
            let copies = areas.iter().map(|area| bench.snapshot(area)).collect::<Result<_, _>>()?;
            Ok(Snapshot::new(bench.now()?, copies))
        })
    }

    /// Returns the changes since a snapshot.
    fn changes(&self, py: Python<'_>, since: &Snapshot) -> PyResult<Vec<Change>> {
        self.act(py, |bench| {
            let mut all = Vec::new();
            for copy in since.copies() {
                all.extend(bench.changes(copy)?.into_iter().map(Change::from));
            }
            Ok(all)
        })
    }

    fn expect_changes(&self, py: Python<'_>, since: &Snapshot, registers: Vec<String>) -> PyResult<()> {
        let [copy] = since.copies() else {
            return Err(PyValueError::new_err("take the snapshot of one area, as snapshot(\"node2\")"));
        };
        let names: Vec<_> = registers.iter().map(String::as_str).collect();
        self.act(py, |bench| bench.expect_changes(copy, &names))
    }

    fn now(&self, py: Python<'_>) -> PyResult<u64> {
        self.act(py, Bench::now)
    }

    fn step(&self, py: Python<'_>, time: Time) -> PyResult<()> {
        match time.0 {
            Span::Us(us) if us < LONG_US && !self.is_remote => self.act(py, |bench| bench.step(us)),
            span => self.take(py, |bench| bench.step(span), errors::of),
        }
    }

    fn save(&self, py: Python<'_>) -> PyResult<u32> {
        self.act(py, Bench::save)
    }

    fn back_to(&self, py: Python<'_>, saved: Number<u32>) -> PyResult<()> {
        self.act(py, |bench| bench.back_to(saved.0))
    }

    fn forget(&self, py: Python<'_>, saved: Number<u32>) -> PyResult<()> {
        self.act(py, |bench| bench.forget(saved.0))
    }

    #[pyo3(signature = (port = ""))]
    fn step_to_sync(&self, py: Python<'_>, port: &str) -> PyResult<()> {
        self.take(py, |bench| bench.step_to_sync(port), errors::of)
    }

    fn wait(&self, py: Python<'_>, register: &str, value: ValueArgument, within: Time) -> PyResult<u64> {
        self.take(py, |bench| bench.wait(register, value.0, within.0), errors::of_wait)
    }

    fn wait_bits(
        &self,
        py: Python<'_>,
        register: &str,
        mask: ValueArgument,
        value: ValueArgument,
        within: Time,
    ) -> PyResult<u64> {
        self.take(py, |bench| bench.wait_bits(register, mask.0, value.0, within.0), errors::of_wait)
    }

    /// Checks once whether a wait has ended. The wait began at `start`, and its condition is in Python.
    fn pass_or_fail(&self, py: Python<'_>, start: Number<u64>, within: Number<u64>) -> PyResult<()> {
        let here = core::panic::Location::caller();
        self.take(py, |bench| bench.pass_or_fail(start.0, within.0, here), errors::of_wait)
    }

    fn expect(&self, py: Python<'_>, register: &str, value: ValueArgument) -> PyResult<()> {
        self.act(py, |bench| bench.expect(register, value.0))
    }

    fn expect_near(
        &self,
        py: Python<'_>,
        register: &str,
        value: ValueArgument,
        tolerance: Number<u32>,
    ) -> PyResult<()> {
        self.act(py, |bench| bench.expect_near(register, value.0, tolerance.0))
    }

    fn expect_bits(
        &self,
        py: Python<'_>,
        register: &str,
        mask: ValueArgument,
        value: ValueArgument,
    ) -> PyResult<()> {
        self.act(py, |bench| bench.expect_bits(register, mask.0, value.0))
    }

    fn expect_that(&self, py: Python<'_>, condition: bool, text: &str) -> PyResult<()> {
        self.act(py, |bench| bench.expect_that(condition, text))
    }

    fn section(&self, py: Python<'_>, text: &str) -> PyResult<()> {
        self.lock(py)?.state.open()?.section(text);
        Ok(())
    }

    #[pyo3(signature = (plc = ""))]
    fn board<'py>(&self, py: Python<'py>, plc: &str) -> PyResult<Bound<'py, PyDict>> {
        dict(py, self.act(py, |bench| bench.board_fields(plc))?)
    }

    fn drive<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
        dict(py, self.act(py, |bench| bench.drive_fields(name))?)
    }

    fn set_board(&self, py: Python<'_>, words: &str) -> PyResult<()> {
        self.act(py, |bench| bench.set_board(words))
    }

    #[pyo3(signature = (plc = ""))]
    fn reset(&self, py: Python<'_>, plc: &str) -> PyResult<()> {
        self.act(py, |bench| bench.reset(plc))
    }

    #[pyo3(signature = (plc = ""))]
    fn power_cycle(&self, py: Python<'_>, plc: &str) -> PyResult<()> {
        self.act(py, |bench| bench.power_cycle(plc))
    }

    fn initial_flag(&self, py: Python<'_>, address: &str, value: ValueArgument) -> PyResult<()> {
        self.take(py, |bench| bench.initial_flag(address, value.0), errors::of)
    }

    #[pyo3(signature = (event, plc = ""))]
    fn event_count(&self, py: Python<'_>, event: Number<usize>, plc: &str) -> PyResult<u32> {
        self.act(py, |bench| bench.event_count(plc, event.0))
    }

    #[pyo3(signature = (trigger, plc = ""))]
    fn trigger_count(&self, py: Python<'_>, trigger: Number<usize>, plc: &str) -> PyResult<u32> {
        self.act(py, |bench| bench.trigger_count(plc, trigger.0))
    }

    fn fault(&self, py: Python<'_>, words: &str) -> PyResult<u16> {
        self.act(py, |bench| bench.fault(words))
    }

    fn faults(&self, py: Python<'_>) -> PyResult<Vec<Fault>> {
        self.act(py, |bench| {
            let faults = bench.faults()?;
            Ok(faults.iter().map(|status| Fault::new(status, bench.names())).collect())
        })
    }

    fn clear_fault(&self, py: Python<'_>, number: Number<u16>) -> PyResult<()> {
        self.act(py, |bench| bench.clear_fault(number.0))
    }

    fn clear_faults(&self, py: Python<'_>) -> PyResult<()> {
        self.act(py, Bench::clear_faults)
    }

    fn expect_required_faults(&self, py: Python<'_>) -> PyResult<()> {
        self.act(py, Bench::expect_required_faults)
    }

    fn findings(&self, py: Python<'_>) -> PyResult<Vec<Finding>> {
        self.act(py, |bench| {
            let found = bench.findings()?;
            Ok(found.iter().map(|entry| Finding::new(entry, bench)).collect())
        })
    }

    fn clear_findings(&self, py: Python<'_>) -> PyResult<()> {
        self.act(py, Bench::clear_findings)
    }

    #[pyo3(signature = (rules = Vec::new()))]
    fn expect_no_findings(&self, py: Python<'_>, rules: Vec<String>) -> PyResult<()> {
        let rules: Vec<_> = rules.iter().map(String::as_str).collect();
        self.act(py, |bench| bench.expect_no_findings(&rules))
    }

    #[pyo3(signature = (bus, identifier, data, extended = false))]
    fn send_frame(
        &self,
        py: Python<'_>,
        bus: &str,
        identifier: Number<u32>,
        data: Data,
        extended: bool,
    ) -> PyResult<()> {
        self.act(py, |bench| bench.send_frame(bus, identifier.0, extended, &data.0))
    }

    #[pyo3(signature = (bus, identifier, extended = false))]
    fn rtr(&self, py: Python<'_>, bus: &str, identifier: Number<u32>, extended: bool) -> PyResult<()> {
        self.act(py, |bench| bench.rtr(bus, identifier.0, extended))
    }

    #[pyo3(signature = (bus, identifier, data, within, extended = false, mask = None))]
    #[expect(clippy::too_many_arguments, reason = "as many as the verb has")]
    fn expect_frame(
        &self,
        py: Python<'_>,
        bus: &str,
        identifier: Number<u32>,
        data: Data,
        within: Time,
        extended: bool,
        mask: Option<Number<u16>>,
    ) -> PyResult<Frame> {
        let seen = match standard(identifier.0, extended, mask)? {
            None => self.take(
                py,
                |bench| bench.expect_extended_frame(bus, identifier.0, &data.0, within.0),
                errors::of_wait,
            ),
            Some((id, mask)) => self.take(
                py,
                |bench| bench.expect_masked_frame(bus, id, mask, &data.0, within.0),
                errors::of_wait,
            ),
        };
        seen.map(|seen| frame(&seen))
    }

    #[pyo3(signature = (bus, identifier, within, extended = false, mask = None))]
    fn expect_no_frame(
        &self,
        py: Python<'_>,
        bus: &str,
        identifier: Number<u32>,
        within: Time,
        extended: bool,
        mask: Option<Number<u16>>,
    ) -> PyResult<()> {
        match standard(identifier.0, extended, mask)? {
            None => {
                self.take(py, |bench| bench.expect_no_extended_frame(bus, identifier.0, within.0), errors::of)
            }
            Some((id, mask)) => {
                self.take(py, |bench| bench.expect_no_frame(bus, id, mask, within.0), errors::of)
            }
        }
    }

    #[pyo3(signature = (bus, since = Number(0)), text_signature = "($self, bus, since=0)")]
    fn frames(&self, py: Python<'_>, bus: &str, since: Number<u64>) -> PyResult<Vec<Frame>> {
        self.take(py, |bench| Ok(bench.frames(bus, since.0)?.iter().map(frame).collect()), errors::of)
    }

    #[pyo3(signature = (since = Number(0)), text_signature = "($self, since=0)")]
    fn journal(&self, py: Python<'_>, since: Number<u64>) -> PyResult<Vec<Record>> {
        self.take(py, |bench| records(bench, since.0), errors::of)
    }

    #[pyo3(signature = (count = Number(40)), text_signature = "($self, count=40)")]
    fn journal_lines(&self, py: Python<'_>, count: Number<usize>) -> PyResult<Vec<String>> {
        let lines = self.take(py, |bench| bench.last_entries(count.0), errors::of)?;
        Ok(lines.into_iter().map(|line| line.text).collect())
    }

    /// Returns the memory of a PLC in this process, for views of it.
    fn memory(&self, py: Python<'_>, plc: &str) -> PyResult<Memory> {
        self.act(py, |bench| bench.segment(plc)).map(Memory::of)
    }

    /// Returns the name of the PLC, and the place of an array in its memory.
    fn array_of(&self, py: Python<'_>, name: &str) -> PyResult<(String, Array)> {
        let mut held = self.lock(py)?;
        let names = held.state.open()?.names();
        let (plc, _) = commram::layout::split_plc(name);
        let number = plc.map_or(Some(0), |plc| names.plcs.iter().position(|known| known == plc));
        let number = number.map_or(DeviceIndex(u16::MAX), DeviceIndex::at);
        let plc = names.plcs.get(number.index()).cloned().unwrap_or_default();
        Ok((plc, Array::find(names.fitted(number), name)?))
    }

    /// Returns the names of the rules of the access checker.
    #[staticmethod]
    fn rules() -> Vec<String> {
        devices::catalogue().rules.iter().map(|rule| rule.id().to_owned()).collect()
    }
}

fn own(plant: Plant) -> Result<Bench, ScenarioError> {
    match plant {
        Plant::BuiltIn => Bench::built_in(),
        Plant::Text(toml) => Bench::new(&PlantConfig::parse("plant", &toml)?),
        Plant::File(path) => Bench::plant_file(path),
    }
}

/// Returns the prefix of a PLC's names: empty if it is the only PLC.
fn prefix(plcs: &[String], plc: usize) -> String {
    commram::layout::plc_prefix(plcs, DeviceIndex::at(plc))
}

/// Returns all areas with registers, of all PLCs.
fn areas(bench: &Bench) -> Vec<String> {
    let names = bench.names();
    let mut all = Vec::new();
    for (plc, fitted) in names.devices.iter().enumerate() {
        let areas = fitted.device().named_areas();
        let areas = areas.filter(|area| !area.structures.is_empty() && fitted.area(area) != Fit::Empty);
        all.extend(areas.map(|area| format!("{}{}", prefix(&names.plcs, plc), area.name)));
    }
    all
}

/// Returns the identifier and the mask of a frame with an 11-bit identifier. `None` for an identifier of 29 bits.
fn standard(identifier: u32, extended: bool, mask: Option<Number<u16>>) -> PyResult<Option<(u16, u16)>> {
    match (extended, mask, u16::try_from(identifier)) {
        (true, None, _) => Ok(None),
        (true, Some(_), _) => Err(PyValueError::new_err("masks are for identifiers of 11 bits")),
        (false, mask, Ok(id)) => Ok(Some((id, mask.map_or(0x7FF, |mask| mask.0)))),
        (false, _, Err(_)) => {
            let text = format!(
                "16#{identifier:X}: identifiers have 11 bits, 0 to 16#7FF; those with more are extended"
            );
            Err(PyValueError::new_err(text))
        }
    }
}

/// Returns named fields as a dictionary.
fn dict(py: Python<'_>, fields: Fields) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    for (name, field) in fields {
        match field {
            Field::Flag(flag) => all.set_item(name, flag),
            Field::Number(number) => all.set_item(name, number),
            Field::Text(text) => all.set_item(name, text),
            Field::Fields(fields) => all.set_item(name, dict(py, fields)?),
        }?;
    }
    Ok(all)
}
