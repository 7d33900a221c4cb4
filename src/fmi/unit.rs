//! A plant with the clock of another simulator.

use super::resources::{Resources, ResourcesError};
use super::values::{Shafts, Value};
use super::variables::{Quantity, ShaftValue, Variable, VariableType, variables};
use crate::layout::Owner;
use crate::memory::Segment;
use crate::plant::{LATEST_US, Plant, Snapshot, SnapshotError, SnapshotFile};
use crate::snapshot_fields::{Damaged, Saved, Saving, read_format, save_header, seal, unseal};
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

/// First bytes of a state.
const MAGIC: [u8; 8] = *b"cmrmunit";
/// Number of the format of a state. Increment it when [`UnitFields`] change. The snapshot in the state has its own
/// format number. A state of format 1 has neither the magic nor a number. A state of format 2 or later begins with the
/// magic, the number and the version of commram, and ends with the checksum of [`seal`].
pub(super) const FORMAT: u16 = 7;
/// Highest number of a phase. In format 1, the first byte of a state was such a number.
const LAST_PHASE_OF_FORMAT_1: u8 = 3;

/// Number of microseconds in a second.
const MICROS: f64 = 1e6;
/// Latest time that a step may reach. Up to this time, an `f64` has each number of microseconds, and seconds with a
/// resolution of 2 microseconds.
const LONGEST_US: f64 = LATEST_US as f64;
/// The caller adds up its steps, so its times may differ by this from those of the unit, because of rounding.
const TOLERANCE_US: f64 = 1.0;

/// Reason for the failure of a call.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum UnitError {
    /// There is no variable with this reference.
    #[error("there is no variable with value reference {reference}; the highest is {last}")]
    NoVariable {
        /// Value reference that no variable has.
        reference: u32,
        /// Highest value reference of the unit.
        last: usize,
    },
    /// The variable has another type.
    #[error("{name} is of type {right}, it was taken for {asked}")]
    OtherKind {
        /// Name of the variable.
        name: String,
        /// FMI type that the variable has.
        right: &'static str,
        /// FMI type of the function that the caller used.
        asked: &'static str,
    },
    /// The variable cannot be set from outside.
    #[error("{name} is an output; inputs and parameters can be set")]
    Output {
        /// Name of the output that cannot be set.
        name: String,
    },
    /// The number is NaN or infinite.
    #[error("{name} cannot be {value}")]
    NotFinite {
        /// Name of the variable that cannot have the value.
        name: String,
        /// Value that the caller gave.
        value: f64,
    },
    /// The start time is NaN, infinite, or so far from 0 that times near it cannot distinguish microseconds.
    #[error("the simulation begins at {given} s; a start time is between -9e9 s and 9e9 s")]
    Start {
        /// Start time that the caller gave, in seconds.
        given: f64,
    },
    /// The simulation ends before it starts.
    #[error("the simulation begins at {start} s and stops at {stop} s; the stop time must not be earlier")]
    Stop {
        /// Start time of the simulation, in seconds.
        start: f64,
        /// Stop time of the simulation, in seconds.
        stop: f64,
    },
    /// The step ends after the stop time of the simulation.
    #[error("a step ends at {end} s, but the simulation was initialized with the stop time {stop} s")]
    PastStop {
        /// End of the step, in seconds.
        end: f64,
        /// Stop time of the simulation, in seconds.
        stop: f64,
    },
    /// The step does not begin at the end of the last step.
    #[error("a step begins at {given} s, but the unit is at {now} s")]
    OtherTime {
        /// Time at which the caller wants to begin the step, in seconds.
        given: f64,
        /// Present time of the unit.
        now: f64,
    },
    /// The length of the step is zero, negative, or too long.
    #[error("a step of {size} s; it must not be negative, and the time at its end must be below 9e9 s")]
    Step {
        /// Size of the step that the caller gave, in seconds.
        size: f64,
    },
    /// The state belongs to another unit.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// The bytes are not a state.
    #[error("it is no state of this unit: {0}")]
    State(String),
    /// Another version of commram has saved the state.
    #[error(
        "the state was saved by {found} (state format {format}), this is commram {ours} (state format {FORMAT}); \
         use the unit that has saved it, or save it again with this one",
        ours = env!("CARGO_PKG_VERSION")
    )]
    OtherVersion {
        /// The version of commram that has saved the state.
        found: String,
        /// The format of the state.
        format: u16,
    },
}

/// State of the unit except its plant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct UnitFields {
    /// Start of the co-simulation as time of the co-simulation, in seconds; `start_us` is the emulated time at this
    /// moment.
    start_s: f64,
    start_us: u64,
    shafts: Shafts,
}

/// State of a unit at a moment.
#[derive(Clone, Debug)]
pub struct UnitState {
    own: UnitFields,
    snapshot: Snapshot,
}

/// A plant with its variables and its clock.
pub struct Unit {
    plant: Plant,
    variables: Vec<Variable>,
    own: UnitFields,
    /// Stop time of the co-simulation in seconds; infinite if the caller has not defined it. It does not belong to the
    /// state of the unit (decision D-537).
    stop_s: f64,
    /// Number of entries in the access checker's table that were already reported.
    reported_findings: usize,
}

impl Unit {
    /// Builds the plant, and powers it on or restores its snapshot.
    ///
    /// # Errors
    /// [`ResourcesError`].
    pub fn new(resources: &Resources) -> Result<Self, ResourcesError> {
        let mut plant =
            Plant::new(resources.config(), |_plc, device| Ok::<_, ResourcesError>(Segment::of(device)))?;
        if let Some(snapshot) = resources.snapshot() {
            plant.restore(snapshot)?;
        }
        let variables = variables(&plant, resources.registers())?;
        let shafts = Shafts::of(&plant);
        let own = UnitFields { start_s: 0.0, start_us: plant.now(), shafts };
        Ok(Self { plant, variables, own, stop_s: f64::INFINITY, reported_findings: 0 })
    }

    /// Returns the variables; the position of a variable is its reference.
    #[must_use]
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Returns the plant of the unit.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Token of this unit. A unit with another plant, other registers or another version of commram has a different
    /// token.
    #[must_use]
    pub fn token(&self) -> String {
        let mut text = String::from(env!("CARGO_PKG_VERSION"));
        for variable in &self.variables {
            text.push_str(&format!(" {} {:?} {:?}", variable.name, variable.kind, variable.quantity));
        }
        let devices = self.plant.devices();
        let layouts: String = devices.iter().map(|it| format!(" {:X}", it.layout().layout_hash)).collect();
        format!("commram-{:016x}", XxHash3_64::oneshot((text + &layouts).as_bytes()))
    }

    /// Begins the co-simulation at a time in seconds. If `stop_s` is given, no step may end later than this time.
    ///
    /// # Errors
    /// [`UnitError::Start`], [`UnitError::Stop`].
    pub fn begin(&mut self, start_s: f64, stop_s: Option<f64>) -> Result<(), UnitError> {
        if !has_microseconds(start_s) {
            return Err(UnitError::Start { given: start_s });
        }
        let stop_s = stop_s.unwrap_or(f64::INFINITY);
        if stop_s.is_nan() || stop_s < start_s {
            return Err(UnitError::Stop { start: start_s, stop: stop_s });
        }
        self.own.start_s = start_s;
        self.stop_s = stop_s;
        Ok(())
    }

    /// Returns the time of the co-simulation in seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.own.start_s + (self.plant.now() - self.own.start_us) as f64 / MICROS
    }

    /// Advances by `size` seconds from `point`. The end is rounded to the next microsecond since the start, so that
    /// rounding errors do not accumulate (decision D-537). Returns the time that was reached.
    ///
    /// # Errors
    /// [`UnitError`]. The clock has then not advanced.
    pub fn step(&mut self, point: f64, size: f64) -> Result<f64, UnitError> {
        let to_us = |time: f64| ((time - self.own.start_s) * MICROS).round();
        let (begin, end) = (to_us(point), to_us(point + size));
        let now = (self.plant.now() - self.own.start_us) as f64;
        if !begin.is_finite() || (begin - now).abs() > TOLERANCE_US {
            return Err(UnitError::OtherTime { given: point, now: self.time_s() });
        }
        if size.is_nan() || size < 0.0 || end > LONGEST_US || !has_microseconds(point + size) {
            return Err(UnitError::Step { size });
        }
        if end > to_us(self.stop_s) + TOLERANCE_US {
            return Err(UnitError::PastStop { end: point + size, stop: self.stop_s });
        }
        for (drive, speed) in self.own.shafts.turned() {
            self.plant.turn_shaft(drive, Some(speed));
        }
        // The number is neither negative nor above the maximum of the type.
        self.plant.advance_to(self.own.start_us + end.max(now) as u64);
        Ok(self.time_s())
    }

    fn variable(&self, reference: u32, asked: VariableType) -> Result<&Variable, UnitError> {
        let last = self.variables.len() - 1;
        let found =
            self.variables.get(reference as usize).ok_or(UnitError::NoVariable { reference, last })?;
        if found.kind == asked {
            return Ok(found);
        }
        let (name, right, asked) = (found.name.clone(), found.kind.name(), asked.name());
        Err(UnitError::OtherKind { name, right, asked })
    }

    /// Returns the value of a variable of this type.
    ///
    /// # Errors
    /// There is no such variable, or it has another type.
    pub fn get(&self, reference: u32, kind: VariableType) -> Result<Value, UnitError> {
        Ok(match self.variable(reference, kind)?.quantity {
            Quantity::Time => Value::Float(self.time_s()),
            quantity => self.own.shafts.value(&self.plant, quantity),
        })
    }

    /// Sets a variable of this type. For a register, this is a store of the PLC's program.
    ///
    /// # Errors
    /// There is no such variable, it has another type or is an output, or the value is not finite.
    pub fn set(&mut self, reference: u32, kind: VariableType, value: Value) -> Result<(), UnitError> {
        self.set_all(kind, core::iter::once((reference, value)))
    }

    /// Sets variables of this type as [`set`](Self::set) does, in the given order.
    ///
    /// # Errors
    /// [`set`](Self::set) would refuse a variable. Then no variable is set.
    pub fn set_all(
        &mut self,
        kind: VariableType,
        values: impl Iterator<Item = (u32, Value)> + Clone,
    ) -> Result<(), UnitError> {
        values.clone().try_for_each(|(reference, value)| self.settable(reference, kind, value).map(drop))?;
        for (reference, value) in values {
            let quantity = self.settable(reference, kind, value)?;
            self.store(quantity, value);
        }
        Ok(())
    }

    /// Returns the quantity of a variable of this type that takes this value.
    fn settable(&self, reference: u32, kind: VariableType, value: Value) -> Result<Quantity, UnitError> {
        let variable = self.variable(reference, kind)?;
        let name = || variable.name.clone();
        if !matches!(variable.causality, super::Causality::Input | super::Causality::Parameter) {
            return Err(UnitError::Output { name: name() });
        }
        match value {
            Value::Float(value) if !value.is_finite() => Err(UnitError::NotFinite { name: name(), value }),
            _ => Ok(variable.quantity),
        }
    }

    fn store(&mut self, quantity: Quantity, value: Value) {
        match (quantity, value) {
            (Quantity::Register { plc, offset, width, ty, owner }, Value::Integer(value)) => {
                let bits = value as u32 & ty.mask();
                // Some tools set all variables at each step; this must not cause more stores than a program would make
                // (decision D-535). In a register that the firmware also writes, each store has an effect.
                if owner == Owner::Both || self.plant.load(plc, offset, width) != Ok(bits) {
                    let _ = self.plant.store(plc, offset, width, bits);
                }
            }
            (Quantity::Shaft { drive, value: ShaftValue::IsModelled }, Value::Boolean(is_modelled)) => {
                self.own.shafts.set_modelled(drive, is_modelled);
                if !is_modelled {
                    self.plant.turn_shaft(drive, None);
                }
            }
            (Quantity::Shaft { drive, .. }, Value::Float(speed)) => {
                self.own.shafts.set_speed(drive, speed);
            }
            // The type of the variable determines its value.
            _ => {}
        }
    }

    /// Returns the new findings of the access checker, one line for each register that has had no finding before.
    pub fn take_findings(&mut self) -> Vec<String> {
        let findings = self.plant.journal().findings();
        if findings.len() == self.reported_findings {
            return Vec::new();
        }
        let names = self.plant.names();
        let lines = findings.iter().skip(self.reported_findings).map(|entry| {
            let (rule, fitted) = (entry.last.rule, names.fitted(entry.last.plc));
            let register = entry.last.name(fitted).unwrap_or_default();
            let (severity, value) = (rule.severity(), entry.last.value_text(fitted));
            format!("{severity} {rule}: {register} {value}: {} ({})", rule.text(), rule.source())
        });
        let lines = lines.collect();
        self.reported_findings = findings.len();
        lines
    }

    /// Returns the present state of the unit.
    #[must_use]
    pub fn state(&self) -> UnitState {
        UnitState { own: self.own.clone(), snapshot: self.plant.snapshot() }
    }

    /// Restores a state of this unit, or of another unit of the same archive.
    ///
    /// # Errors
    /// The state belongs to another archive.
    pub fn restore(&mut self, state: &UnitState) -> Result<(), UnitError> {
        if state.own.shafts.len() != self.own.shafts.len() {
            return Err(UnitError::State("it has other drives".to_owned()));
        }
        self.plant.restore(&state.snapshot)?;
        self.own = state.own.clone();
        self.reported_findings = self.plant.journal().findings().len();
        Ok(())
    }

    /// Encodes a state as bytes. `phase` is a number of the caller: the present phase in the life cycle of the unit.
    #[must_use]
    pub fn to_bytes(&self, state: &UnitState, phase: u8) -> Vec<u8> {
        let mut to = Saving::default();
        save_header(&mut to, &MAGIC, FORMAT, env!("CARGO_PKG_VERSION"));
        to.value(&phase);
        to.value(&state.own);
        to.value(&self.plant.file_of(state.snapshot.clone()).to_bytes());
        seal(to.into_bytes())
    }

    /// Decodes a state and its phase. [`Unit::restore`] checks that the state belongs to this unit.
    ///
    /// # Errors
    /// The bytes are damaged, are not a state, or are a state of another version of commram.
    pub fn of_bytes(&self, bytes: &[u8]) -> Result<(UnitState, u8), UnitError> {
        let damaged = |error: Damaged| UnitError::State(error.to_string());
        let wrong = || UnitError::State("its checksum is wrong, or its end is missing".to_owned());
        // The checksum is checked first, so that a damaged header is not reported as another version.
        let written = unseal(bytes).ok_or_else(wrong)?;
        let mut from = Saved::new(written);
        if from.raw(MAGIC.len()).is_ok_and(|magic| magic != MAGIC) {
            return Err(match written {
                [0..=LAST_PHASE_OF_FORMAT_1, inner @ ..] if unseal(inner).is_some() => {
                    UnitError::OtherVersion { found: "an older commram".to_owned(), format: 1 }
                }
                _ => UnitError::State("it does not begin as a state does".to_owned()),
            });
        }
        let (format, found) = read_format(&mut from).map_err(damaged)?;
        if (format, found.as_str()) != (FORMAT, env!("CARGO_PKG_VERSION")) {
            return Err(UnitError::OtherVersion { found: format!("commram {found}"), format });
        }
        let phase: u8 = from.value().map_err(damaged)?;
        let own: UnitFields = from.value().map_err(damaged)?;
        let file: Vec<u8> = from.value().map_err(damaged)?;
        from.end().map_err(damaged)?;
        let file = SnapshotFile::of_bytes(&file).map_err(|error| UnitError::State(error.to_string()))?;
        let are_possible = has_microseconds(own.start_s) && own.shafts.are_finite();
        if !are_possible || own.start_us > file.snapshot.time_us() {
            return Err(UnitError::State("its times make no sense".to_owned()));
        }
        Ok((UnitState { own, snapshot: file.snapshot }, phase))
    }
}

/// True if an `f64` near this time in seconds has a resolution of about a microsecond.
fn has_microseconds(time_s: f64) -> bool {
    time_s.abs() * MICROS <= LONGEST_US
}
