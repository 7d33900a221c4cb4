//! The verbs of scenarios, in Rust.

mod board;
mod expect;
mod findings;
mod frames;
mod memory;
#[cfg(test)]
mod tests;

pub use frames::SeenFrame;
pub use memory::{Change, MemoryCopy};

use super::backend::{Backend, BackendError, Spot};
use super::local::Local;
use super::{Failure, ScenarioError, Span, Value};
use crate::fault::{FaultError, FaultSpec, Refusal};
use crate::journal::text::Text;
use crate::journal::{Format, Names};
use crate::layout::place::live_by;
use crate::layout::{Area, Live, Place, split_plc};
use crate::plant::{Forced, PlantConfig};
use crate::plc::Ram;
use core::num::NonZeroU16;
use core::panic::Location;
use std::path::Path;

/// How many journal entries a failure shows.
const LAST_ENTRIES: usize = 8;
/// How far back the journal is read for them.
const LOOK_BACK: u64 = 512;

/// A plant and the verbs that act on it.
///
/// Registers are named as everywhere: `node2.w_CPU_CONTROL`, `line2:node2.a_STAT_SL[1]`, `%MW3.200000`. Values
/// are numbers or texts such as `16#0040`; times are texts with a unit such as `2ms`, durations, or numbers of
/// microseconds. Time only passes in the verbs that say so.
///
/// ```
/// use commram::script::{Bench, ScenarioError};
///
/// # fn main() -> Result<(), ScenarioError> {
/// let mut bench = Bench::built_in()?;
/// bench.poke("node2.w_CPU_CONTROL", 0x0001)?;
/// bench.wait("node2.w_OPTION_STATUS", 0x0002, "1ms")?;
/// # Ok(())
/// # }
/// ```
pub struct Bench {
    backend: Box<dyn Backend>,
    names: Names,
    /// What a failure says about where it happened.
    section: Option<String>,
    /// Emulated time at the beginning.
    started_us: u64,
    /// Longest time from there.
    limit_us: u64,
}

/// A register of the plant.
struct Register {
    place: Place,
    spot: Spot,
    /// With the PLC in front, if there are several.
    prefix: String,
}

impl Register {
    /// `node2.w_CPU_CONTROL`, with the PLC in front where there are several.
    fn name(&self, live: Live) -> String {
        format!("{}{}", self.prefix, self.place.name(live))
    }

    /// `node2.w_CPU_CONTROL (%MW3.200000)`
    fn label(&self, live: Live) -> String {
        format!("{}{}", self.prefix, self.place.label(live))
    }

    /// The value with its meaning, marked as by `commram peek`: `16#0043  [forced] synchronous operation ...`.
    fn describe(&self, live: Live, value: u32, forced: bool) -> String {
        let mark = if forced { "[forced] " } else { "" };
        let meaning = self.place.meaning(live, value);
        format!("{}  {mark}{meaning}", self.place.format(live, value)).trim_end().to_owned()
    }

    /// The value as a number of the register's type.
    fn number(&self, live: Live, value: u32) -> i64 {
        match self.place.bit() {
            Some(bit) => i64::from(value >> bit & 1),
            None => self.place.ty(live).number(value),
        }
    }

    /// The bits that count, and what `value` makes of them.
    fn pattern(&self, value: u32) -> (u32, u32) {
        match self.place.bit() {
            Some(bit) => (1 << bit, value << bit),
            None => (self.spot.width.max_value(), value),
        }
    }
}

impl Bench {
    /// Longest emulated time that a scenario may take, unless told otherwise: 1 h, in microseconds (D-233).
    pub const LIMIT_US: u64 = 3_600_000_000;

    /// The built-in plant: PLC `line`, whose node 2 is the master of bus `drives` with drives 1, 2, 3.
    ///
    /// # Errors
    /// None that can be helped.
    pub fn built_in() -> Result<Self, ScenarioError> {
        Self::new(&PlantConfig::built_in()?)
    }

    /// The plant that a plant file describes, given as its text.
    ///
    /// # Errors
    /// The text is no plant file, or the plant is refused.
    pub fn plant(toml: &str) -> Result<Self, ScenarioError> {
        Self::new(&PlantConfig::parse("plant", toml)?)
    }

    /// The plant of a plant file.
    ///
    /// # Errors
    /// The file cannot be read, is no plant file, or the plant is refused.
    pub fn plant_file(path: impl AsRef<Path>) -> Result<Self, ScenarioError> {
        Self::new(&PlantConfig::load(path.as_ref())?)
    }

    /// A plant on heap memory, at power-on.
    ///
    /// # Errors
    /// The plant is refused.
    pub fn new(config: &PlantConfig) -> Result<Self, ScenarioError> {
        Self::on(Box::new(Local::new(config)?))
    }

    /// A running instance, through its channel. Its clock should be a stepped one.
    ///
    /// # Errors
    /// The instance does not answer.
    #[cfg(feature = "channel")]
    pub fn attach(client: crate::channel::Client) -> Result<Self, ScenarioError> {
        Self::on(Box::new(super::remote::Remote::new(client).map_err(BackendError::from)?))
    }

    fn on(mut backend: Box<dyn Backend>) -> Result<Self, ScenarioError> {
        let names = backend.names().clone();
        let started_us = backend.now()?;
        Ok(Self { backend, names, section: None, started_us, limit_us: Self::LIMIT_US })
    }

    /// Sets the longest emulated time from the beginning, in microseconds.
    pub fn set_limit(&mut self, us: u64) {
        self.limit_us = us;
    }

    /// Names of the PLCs and buses.
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// Names what comes now; failures tell it.
    pub fn section(&mut self, text: &str) {
        self.section = Some(text.to_owned());
    }

    /// Emulated time in microseconds.
    ///
    /// # Errors
    /// The instance has gone.
    pub fn now(&mut self) -> Result<u64, ScenarioError> {
        Ok(self.backend.now()?)
    }

    /// Emulated time since the beginning, in microseconds.
    ///
    /// # Errors
    /// The instance has gone.
    pub fn elapsed(&mut self) -> Result<u64, ScenarioError> {
        Ok(self.now()?.saturating_sub(self.started_us))
    }

    /// Reads a register, as a number of its type.
    ///
    /// # Errors
    /// There is no such register.
    pub fn peek(&mut self, register: &str) -> Result<i64, ScenarioError> {
        let register = self.register(register)?;
        let value = self.backend.load(register.spot)?;
        let live = self.live(&register)?;
        Ok(register.number(live, value))
    }

    /// The register with its value and what it means: `node2.w_OPTION_STATUS = 16#0043  synchronous ...`.
    ///
    /// # Errors
    /// There is no such register.
    pub fn describe(&mut self, register: &str) -> Result<String, ScenarioError> {
        let register = self.register(register)?;
        let value = self.backend.load(register.spot)?;
        let live = self.live(&register)?;
        let forced = self.is_forced(&register)?;
        Ok(format!("{} = {}", register.name(live), register.describe(live, value, forced)))
    }

    fn is_forced(&mut self, register: &Register) -> Result<bool, ScenarioError> {
        let Spot { plc, offset, .. } = register.spot;
        // Only whole registers are forced; a single bit may lie behind the first byte of one.
        let is_there =
            |it: &Forced| it.plc == plc && (it.offset..it.offset + it.width.bytes()).contains(&offset);
        Ok(self.backend.forces()?.iter().any(is_there))
    }

    /// Writes a register.
    ///
    /// # Errors
    /// There is no such register, it cannot hold the value, or it is a single bit.
    pub fn poke(&mut self, register: &str, value: impl Into<Value>) -> Result<(), ScenarioError> {
        let register = self.whole_register(register)?;
        let bits = value.into().bits(&register.place)?;
        Ok(self.backend.store(register.spot, bits)?)
    }

    /// Writes `new` if the register holds `current`; returns whether it did.
    ///
    /// # Errors
    /// There is no such register, it cannot hold the values, or it is a single bit.
    pub fn compare_exchange(
        &mut self,
        register: &str,
        current: impl Into<Value>,
        new: impl Into<Value>,
    ) -> Result<bool, ScenarioError> {
        let register = self.whole_register(register)?;
        let (current, new) = (current.into().bits(&register.place)?, new.into().bits(&register.place)?);
        Ok(self.backend.compare_exchange(register.spot, current, new)?.is_ok())
    }

    /// Makes a register keep the value against firmware and PLC, until [`Bench::unforce`].
    ///
    /// # Errors
    /// There is no such register, it cannot hold the value, it is a single bit, or too many are forced.
    pub fn force(&mut self, register: &str, value: impl Into<Value>) -> Result<(), ScenarioError> {
        let register = self.whole_register(register)?;
        let bits = value.into().bits(&register.place)?;
        Ok(self.backend.force(register.spot, bits)?)
    }

    /// Lets a forced register go; it keeps its value until somebody writes it.
    ///
    /// # Errors
    /// There is no such register, or it is not forced.
    pub fn unforce(&mut self, text: &str) -> Result<(), ScenarioError> {
        let register = self.whole_register(text)?;
        self.backend.unforce(register.spot).map_err(|error| match error {
            BackendError::NotForced { .. } => {
                ScenarioError::argument(text, &format!("{} is not forced", register.place.address()))
            }
            other => other.into(),
        })
    }

    /// Adds a fault, in the words of `commram fault add`: `lose_frame slot=WRC1 count=3`. Returns its number.
    ///
    /// # Errors
    /// The fault does not exist, has a wrong field, or concerns something that the plant does not have.
    pub fn fault(&mut self, words: &str) -> Result<u16, ScenarioError> {
        let mut words = words.split_whitespace();
        let kind = words.next().unwrap_or_default();
        let spec = FaultSpec::from_words(kind, &words.collect::<Vec<_>>())?;
        let fault = spec.resolve(&self.names)?;
        self.backend.add_fault(fault).map_err(|error| match error {
            BackendError::Fault(refusal) => FaultError::refused(fault.kind(), refusal, &self.names).into(),
            other => other.into(),
        })
    }

    /// Clears the fault of this number. What it has done stays done.
    ///
    /// # Errors
    /// There is no such fault; it may have ended.
    pub fn clear_fault(&mut self, number: u16) -> Result<(), ScenarioError> {
        let known = NonZeroU16::new(number).ok_or(Refusal::UnknownFault { id: number });
        Ok(self.backend.clear_faults(Some(known.map_err(BackendError::Fault)?))?)
    }

    /// Clears all faults.
    ///
    /// # Errors
    /// The instance has gone.
    pub fn clear_faults(&mut self) -> Result<(), ScenarioError> {
        Ok(self.backend.clear_faults(None)?)
    }

    /// The RAM of a PLC, for its function blocks and tasks; `""` is the only one.
    ///
    /// # Errors
    /// There is no such PLC, or its RAM cannot be mapped.
    pub fn ram(&mut self, plc: &str) -> Result<Ram, ScenarioError> {
        let plc = self.only_plc(plc)?;
        self.ram_of(plc)
    }

    /// The PLC of this name; `""` is the only one.
    pub(super) fn only_plc(&self, name: &str) -> Result<u16, ScenarioError> {
        match self.names.plcs.as_slice() {
            [_] if name.is_empty() => Ok(0),
            all => position("PLC", all, name),
        }
    }

    pub(super) fn ram_of(&mut self, plc: u16) -> Result<Ram, ScenarioError> {
        Ok(Ram::of(&self.backend.segment(plc)?)?)
    }

    /// The PLC and the area that are meant by `node2` or `line2:node1`.
    ///
    /// # Errors
    /// There is no such PLC or area of registers.
    pub(super) fn area(&self, text: &str) -> Result<(u16, &'static Area), ScenarioError> {
        let (plc, name) = split_plc(text);
        let plc = self.plc(plc, name)?;
        Ok((plc, memory::register_area(name)?))
    }

    /// Lets the time pass.
    ///
    /// # Errors
    /// No time, or more than the scenario may take.
    pub fn step(&mut self, time: impl Into<Span>) -> Result<(), ScenarioError> {
        let us = self.span(time)?;
        self.backend.advance(us)?;
        Ok(())
    }

    /// Lets the time pass up to the next SYNC on the bus of a CANsync node, `node1` or `node2`, with the PLC in
    /// front where there are several.
    ///
    /// # Errors
    /// There is no such node, or nobody sends SYNC.
    pub fn step_to_sync(&mut self, node: &str) -> Result<(), ScenarioError> {
        let (plc, name) = split_plc(node);
        let number = match name {
            "node1" => 1,
            "node2" => 2,
            _ => return Err(ScenarioError::argument(node, "the CANsync nodes are node1 and node2")),
        };
        let plc = self.plc(plc, name)?;
        self.within_limit(0)?;
        self.backend.advance_to_sync(plc, number)?;
        Ok(())
    }

    /// The time in microseconds, if the scenario may still take it.
    pub(super) fn span(&mut self, time: impl Into<Span>) -> Result<u64, ScenarioError> {
        let us = time.into().us()?;
        self.within_limit(us)?;
        Ok(us)
    }

    fn within_limit(&mut self, us: u64) -> Result<(), ScenarioError> {
        let now_us = self.now()?;
        let limit_us = self.limit_us;
        if now_us.saturating_sub(self.started_us).saturating_add(us) > limit_us {
            return Err(ScenarioError::TooLong { us, now_us, limit_us });
        }
        Ok(())
    }

    fn register(&self, text: &str) -> Result<Register, ScenarioError> {
        let place = Place::parse(text)?;
        let plc = self.plc(place.plc.as_deref(), place.text())?;
        let spot = Spot { plc, offset: place.offset(), width: place.width() };
        Ok(Register { place, spot, prefix: self.prefix(plc) })
    }

    fn whole_register(&self, text: &str) -> Result<Register, ScenarioError> {
        let register = self.register(text)?;
        if register.place.bit().is_some() {
            return Err(ScenarioError::argument(
                text,
                "a single bit cannot be written; name the whole register",
            ));
        }
        Ok(register)
    }

    /// What stands in front of names of this PLC.
    fn prefix(&self, plc: u16) -> String {
        match self.names.plcs.get(usize::from(plc)) {
            Some(name) if self.names.plcs.len() > 1 => format!("{name}:"),
            _ => String::new(),
        }
    }

    /// Number of the PLC that is meant by `plc` in front of `text`.
    fn plc(&self, plc: Option<&str>, text: &str) -> Result<u16, ScenarioError> {
        match (plc, self.names.plcs.as_slice()) {
            (Some(name), all) => position("PLC", all, name),
            (None, [_]) => Ok(0),
            (None, all) => Err(ScenarioError::WhichPlc {
                text: text.to_owned(),
                plcs: all.join(", "),
                example: all.first().cloned().unwrap_or_default(),
            }),
        }
    }

    fn bus(&self, name: &str) -> Result<u16, ScenarioError> {
        position("bus", &self.names.buses, name)
    }

    /// Which of overlaid structures is live where the register lies.
    fn live(&mut self, register: &Register) -> Result<Live, ScenarioError> {
        let Some(status) = register.place.status() else { return Ok(Live::Cyclic) };
        let address = status.address();
        let spot = Spot { plc: register.spot.plc, offset: address.offset(), width: address.width() };
        Ok(live_by(self.backend.load(spot)?))
    }

    /// A failure at the present moment.
    pub(super) fn failure(&mut self, what: String, at: &Location<'_>) -> Result<Failure, ScenarioError> {
        Ok(Failure {
            what,
            register: None,
            address: None,
            expected: None,
            actual: None,
            time_us: self.backend.now()?,
            section: self.section.clone(),
            journal: self.last_entries()?,
            location: Some(at.to_string()),
        })
    }

    /// The last lines of the journal.
    fn last_entries(&mut self) -> Result<Vec<String>, ScenarioError> {
        let from = self.backend.journal_end()?.saturating_sub(LOOK_BACK);
        let (records, _) = self.backend.journal(from)?;
        let mut text = Text::new(self.names.clone());
        let (before, last) = records.split_at(records.len().saturating_sub(LAST_ENTRIES));
        before.iter().for_each(|record| text.skip(record));
        let mut lines = String::new();
        last.iter().for_each(|record| text.record(record, &mut lines));
        Ok(lines.lines().map(str::to_owned).collect())
    }
}

fn position(what: &'static str, all: &[String], name: &str) -> Result<u16, ScenarioError> {
    let found = all.iter().position(|known| known == name).and_then(|index| u16::try_from(index).ok());
    let known = || if all.is_empty() { "none".to_owned() } else { all.join(", ") };
    found.ok_or_else(|| ScenarioError::Unknown { what, name: name.to_owned(), known: known() })
}
