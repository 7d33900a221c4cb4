//! The verbs of scenarios (functions such as `poke` and `wait`), in Rust.

mod ask;
mod board;
mod drive;
mod exchange;
mod expect;
mod findings;
mod frames;
mod history;
mod interfere;
mod memory;
#[cfg(feature = "studio")]
mod plot;
mod register;
#[cfg(test)]
mod tests;
mod time;

pub use frames::SeenFrame;
pub use history::PastChange;
pub use memory::{Change, MemoryCopy};
pub use register::Register;

use super::carrier::Carrier;
use super::failure::{FailureKind, JournalLine};
#[cfg(not(all(test, feature = "channel")))]
use super::local::Local;
use super::{Failure, ScenarioError, ScriptLocation, Value};
use crate::devices;
use crate::fault::FaultStatus;
use crate::identity::DeviceIndex;
use crate::journal::text::Text;
use crate::journal::{Format, Names, Record};
use crate::memory::Segment;
use crate::plant::PlantConfig;
use crate::plc::Ram;
use crate::plural::plural;
use crate::request::{InstanceInfo, Op};
use ask::Spot;
use core::ops::Range;
use core::panic::Location;
use std::path::Path;

/// Number of journal records that the report of a failure shows.
const LAST_ENTRIES: usize = 8;
/// Number of findings that a failure shows.
const FIRST_FINDINGS: usize = 3;
/// Number of the last journal records among which these records are selected.
const LOOK_BACK: u64 = 512;

/// A plant and the verbs that act on it.
///
/// Registers have the same names as on the command line: `node2.w_CPU_CONTROL`, `line2:node2.a_STAT_SL[1]`,
/// `%MW3.200000`. Values are numbers or texts such as `16#0040`. Times are texts with a unit such as `2ms`, durations,
/// or numbers of microseconds. A verb advances the clock only if its description mentions it.
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
    carrier: Box<dyn Carrier>,
    /// True if the plant has a stepped clock, which only verbs advance.
    is_stepped: bool,
    names: Names,
    /// Heading that failures report as their location.
    section: Option<String>,
    /// Emulated time at the beginning of the scenario.
    started_us: u64,
    /// Maximum emulated time from the beginning of the scenario.
    limit_us: u64,
    /// Faults that must take effect.
    required: Vec<Required>,
    /// Registers that the scenario records.
    recorded: Vec<Recorded>,
    /// Numbers of the kept snapshots.
    saved: Vec<u32>,
    /// Emulated time to which this bench has gone back last.
    returned_us: Option<u64>,
    /// Called regularly while the clock advances: returns true to end the verb.
    interrupt: Option<Box<dyn FnMut() -> bool + Send>>,
}

/// Registers that a call of `record` selects.
struct Recorded {
    plc: DeviceIndex,
    /// Their bytes in the image.
    bytes: Range<u32>,
    /// Number of the first record after the call.
    from: u64,
}

/// A fault that must take effect.
struct Required {
    number: u16,
    /// The text of the line.
    text: String,
    /// The line of a script that requires the fault.
    place: Option<ScriptLocation>,
    state: RequiredState,
}

/// Knowledge about the effect of a required fault. The plant forgets a fault that was cleared, or added after the
/// moment to which the clock has returned.
#[derive(Clone, Copy, PartialEq, Eq)]
enum RequiredState {
    /// The plant knows whether the fault has taken effect.
    Known,
    /// The fault has taken effect.
    HasActed,
    /// The plant no longer has the fault, which has not taken effect. The plant may use its number again.
    Gone,
}

impl Required {
    fn new(number: u16, text: String, place: Option<ScriptLocation>) -> Self {
        Self { number, text, place, state: RequiredState::Known }
    }
}

impl Bench {
    /// Default limit on the emulated time of a scenario: 1 h, in microseconds (D-233).
    pub const LIMIT_US: u64 = 3_600_000_000;

    /// Returns the built-in plant: PLC `line` with node 2 as the master of bus `drives`, which has drives 1, 2, 3.
    ///
    /// # Errors
    /// No error is expected, because the built-in plant is valid.
    pub fn built_in() -> Result<Self, ScenarioError> {
        Self::new(&PlantConfig::built_in()?)
    }

    /// Returns the plant that a plant file describes, given as its text.
    ///
    /// # Errors
    /// The text is not a plant file, or the plant is refused.
    pub fn plant(toml: &str) -> Result<Self, ScenarioError> {
        Self::new(&PlantConfig::parse("plant", toml)?)
    }

    /// Returns the plant of a plant file.
    ///
    /// # Errors
    /// The file cannot be read, is not a plant file, or the plant is refused.
    pub fn plant_file(path: impl AsRef<Path>) -> Result<Self, ScenarioError> {
        Self::new(&PlantConfig::load(path.as_ref())?)
    }

    /// Returns a plant on heap memory, at power-on.
    ///
    /// # Errors
    /// The plant is refused.
    pub fn new(config: &PlantConfig) -> Result<Self, ScenarioError> {
        #[cfg(not(all(test, feature = "channel")))]
        let carrier = Box::new(Local::new(config)?);
        #[cfg(all(test, feature = "channel"))]
        let carrier = super::federated::carrier(config)?;
        let mut bench = Self::on(carrier)?;
        // The plant numbers its faults from 1 in the order of the plant file, so `zip` gives each fault its number.
        let required = (1..).zip(&config.faults).filter(|(_, spec)| spec.required);
        let required = required.map(|(number, spec)| Required::new(number, spec.kind.clone(), None));
        bench.required = required.collect();
        Ok(bench)
    }

    /// False if the plant belongs to a running instance whose emulator has ended, or was replaced by another one.
    #[cfg(feature = "cli")]
    pub(crate) fn is_there(&self) -> bool {
        self.carrier.is_there()
    }

    /// Hash over all journal records since power-on, equal for equal runs
    /// ([`Journal::hash`](crate::journal::Journal::hash)); `None` for a running instance, because its journal began
    /// earlier.
    pub fn journal_hash(&self) -> Option<u64> {
        self.carrier.journal_hash()
    }

    /// Returns a running instance, reached through its channel. Its clock should be stepped.
    ///
    /// # Errors
    /// The instance does not answer.
    #[cfg(feature = "channel")]
    pub fn attach(client: crate::channel::Client) -> Result<Self, ScenarioError> {
        Self::on(Box::new(super::remote::Remote::new(client)?))
    }

    fn on(mut carrier: Box<dyn Carrier>) -> Result<Self, ScenarioError> {
        let InstanceInfo { is_stepped, names, time_us: started_us, .. } = carrier.ask(Op::Info)?.info()?;
        Ok(Self {
            carrier,
            is_stepped,
            names,
            section: None,
            started_us,
            limit_us: Self::LIMIT_US,
            required: Vec::new(),
            recorded: Vec::new(),
            saved: Vec::new(),
            returned_us: None,
            interrupt: None,
        })
    }

    /// Sets the longest emulated time from the beginning, in microseconds.
    pub fn set_limit(&mut self, us: u64) {
        self.limit_us = us;
    }

    /// Calls `interrupt` while a verb advances the clock, at least every 100 ms of emulated time; if it returns true,
    /// the verb ends with [`ScenarioError::Interrupted`].
    pub fn set_interrupt(&mut self, interrupt: impl FnMut() -> bool + Send + 'static) {
        self.interrupt = Some(Box::new(interrupt));
    }

    /// Returns names of the PLCs and buses.
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// Names the section that starts here; failures report the name.
    pub fn section(&mut self, text: &str) {
        self.section = Some(text.to_owned());
    }

    /// Emulated time in microseconds.
    ///
    /// # Errors
    /// The instance has ended.
    pub fn now(&mut self) -> Result<u64, ScenarioError> {
        Ok(self.ask(Op::Time)?.time()?)
    }

    /// Emulated time at the beginning, in microseconds.
    pub(super) fn started_us(&self) -> u64 {
        self.started_us
    }

    /// Emulated time since the beginning, in microseconds.
    ///
    /// # Errors
    /// The instance has ended.
    pub fn elapsed(&mut self) -> Result<u64, ScenarioError> {
        Ok(self.now()?.saturating_sub(self.started_us))
    }

    /// Reads a register, as a number of its type.
    ///
    /// # Errors
    /// There is no such register.
    pub fn peek(&mut self, register: &str) -> Result<i64, ScenarioError> {
        self.peek_at(&self.find(register)?)
    }

    /// Reads a register like [`Bench::peek`]. [`Bench::find`] has returned the register.
    ///
    /// # Errors
    /// The instance has ended.
    pub fn peek_at(&mut self, register: &Register) -> Result<i64, ScenarioError> {
        let value = self.load(register.spot)?;
        let live = if register.is_same_number() { register.place.last_phase() } else { self.live(register)? };
        Ok(register.number(live, value))
    }

    /// Returns the value of the register in words: `waiting for "take over initialization data"`.
    ///
    /// # Errors
    /// There is no such register.
    pub fn meaning(&mut self, register: &str) -> Result<String, ScenarioError> {
        let register = self.find(register)?;
        let value = self.load(register.spot)?;
        let live = self.live(&register)?;
        Ok(register.place.meaning(live, value))
    }

    /// Returns the register with its value and meaning: `node2.w_OPTION_STATUS = 16#0043  synchronous ...`.
    ///
    /// # Errors
    /// There is no such register.
    pub fn describe(&mut self, register: &str) -> Result<String, ScenarioError> {
        let register = self.find(register)?;
        let value = self.load(register.spot)?;
        let live = self.live(&register)?;
        let forced = self.is_forced(&register)?;
        Ok(format!("{} = {}", register.name(live), register.describe(live, value, forced)))
    }

    /// Writes a register.
    ///
    /// # Errors
    /// There is no such register, or it cannot hold the value.
    pub fn poke(&mut self, register: &str, value: impl Into<Value>) -> Result<(), ScenarioError> {
        self.poke_at(&self.find(register)?, value)
    }

    /// Writes a register like [`Bench::poke`]. [`Bench::find`] has returned the register.
    ///
    /// # Errors
    /// The register cannot hold the value.
    pub fn poke_at(&mut self, register: &Register, value: impl Into<Value>) -> Result<(), ScenarioError> {
        let bits = value.into().bits(&register.place)?;
        match register.place.bit_access() {
            None => self.store(register.spot, bits),
            Some(bit) => self.store_bit(register.spot.plc, bit, bits),
        }
    }

    /// Writes `new` if the register holds `current`. Returns true if `new` was written.
    ///
    /// # Errors
    /// There is no such register, it cannot hold one of the values, or the name means a single bit.
    pub fn compare_exchange(
        &mut self,
        register: &str,
        current: impl Into<Value>,
        new: impl Into<Value>,
    ) -> Result<bool, ScenarioError> {
        let register = self.whole_register(register)?;
        let (current, new) = (current.into().bits(&register.place)?, new.into().bits(&register.place)?);
        let Spot { plc, offset, width } = register.spot;
        Ok(self.ask(Op::CompareExchange { plc, offset, width, current, new })?.exchanged()?.is_ok())
    }

    /// Returns the RAM of a PLC, for its function blocks and tasks. `""` means the only PLC.
    ///
    /// # Errors
    /// There is no such PLC, or its RAM cannot be mapped.
    pub fn ram(&mut self, plc: &str) -> Result<Ram, ScenarioError> {
        let plc = self.only_plc(plc)?;
        self.ram_of(plc)
    }

    /// Returns the memory of a PLC, for accesses like those of a program on this PLC. `""` means the only PLC.
    ///
    /// # Errors
    /// There is no such PLC, or its RAM cannot be mapped.
    pub fn segment(&mut self, plc: &str) -> Result<Segment, ScenarioError> {
        let plc = self.only_plc(plc)?;
        self.carrier.segment(plc)
    }

    /// Waits after the call of a block until the board has answered its requests.
    pub(super) fn answer_boards(&mut self) -> Result<(), ScenarioError> {
        // With a stepped clock, any request makes the boards answer first, so one operation is enough.
        if self.is_stepped {
            self.ask(Op::Time)?;
        }
        Ok(())
    }

    pub(super) fn ram_of(&mut self, plc: DeviceIndex) -> Result<Ram, ScenarioError> {
        Ok(Ram::of(&self.carrier.segment(plc)?)?)
    }

    /// Returns a failure at the present moment.
    pub(super) fn failure(&mut self, what: String, at: &Location<'_>) -> Result<Failure, ScenarioError> {
        let found = self.findings()?;
        let first = found.iter().take(FIRST_FINDINGS).map(|entry| self.finding_line(entry));
        let (findings, first_findings) = (found.len() as u64, first.collect());
        Ok(Failure {
            kind: FailureKind::Expectation,
            what,
            register: None,
            address: None,
            expected: None,
            actual: None,
            numbers: None,
            within_us: None,
            time_us: self.now()?,
            section: self.section.clone(),
            findings,
            first_findings,
            faults: self.fault_lines()?,
            journal: self.last_entries(LAST_ENTRIES)?,
            exchange: self.last_exchanges()?,
            location: Some(at.into()),
        })
    }

    /// Returns the pending and active faults, each as a line: `lose_frame bus=drives count=3 (acting, 2 hits)`.
    fn fault_lines(&mut self) -> Result<Vec<String>, ScenarioError> {
        let faults = self.ask(Op::FaultList)?.faults()?;
        let line = |status: FaultStatus| {
            let state = if status.acting { "acting" } else { "waiting" };
            format!("{} ({state}, {})", status.fault.text(&self.names), plural(u64::from(status.hits), "hit"))
        };
        Ok(faults.into_iter().map(line).collect())
    }

    /// Returns the last records of the journal, at most `count`, oldest first. A record that counts several events has
    /// the time of the last event.
    ///
    /// # Errors
    /// The instance has ended.
    pub fn last_entries(&mut self, count: usize) -> Result<Vec<JournalLine>, ScenarioError> {
        let from = self.journal_end()?.saturating_sub(LOOK_BACK.max(count as u64));
        let (records, _) = self.records(from)?;
        let mut text = Text::new(self.names.clone(), devices::catalogue());
        let (before, last) = records.split_at(records.len().saturating_sub(count));
        before.iter().for_each(|record| text.skip(record));
        let mut lines: Vec<_> = last.iter().map(|record| line(record, &mut text)).collect();
        // A record that counts events is written when its count ends, or follows all other records if its count still
        // runs. So the order of the records is not the order of time, and the lines are sorted.
        lines.sort_by_key(|line| line.time_us);
        Ok(lines)
    }
}

fn line(record: &Record, text: &mut Text) -> JournalLine {
    let mut line = String::new();
    text.record(record, &mut line);
    let kind = record.event.kind().name().to_owned();
    JournalLine { time_us: record.time_us, kind, text: line.trim().to_owned() }
}
