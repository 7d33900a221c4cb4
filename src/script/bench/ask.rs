//! The operations that the verbs of scenarios (`poke`, `wait` ...) request from the plant.

use super::Bench;
use crate::identity::DeviceIndex;
use crate::journal::{Entry, Record};
use crate::layout::BitAccess;
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Address, Width};
use crate::plant::Forced;
use crate::request::{MAX_ADVANCE_US, Op, Refused, Reply, Waited, read_journal};
use crate::script::ScenarioError;
use std::time::Duration;

/// Emulated time between two checks for an interrupt of the verb, in microseconds.
const SLICE_US: u64 = 100_000;
/// Pause between two reads of a real-time clock.
const PAUSE: Duration = Duration::from_micros(500);

/// A register access: PLC, offset and width.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Spot {
    /// Number of the PLC in the plant.
    pub plc: DeviceIndex,
    /// Byte offset in the image.
    pub offset: u32,
    /// Width of the access.
    pub width: Width,
}

impl Spot {
    pub(crate) fn new(plc: DeviceIndex, address: Address) -> Self {
        Self { plc, offset: address.offset(), width: address.width() }
    }
}

impl Bench {
    pub(super) fn ask(&mut self, op: Op) -> Result<Reply, ScenarioError> {
        self.carrier.ask(op)
    }

    pub(super) fn load(&mut self, spot: Spot) -> Result<u32, ScenarioError> {
        let Spot { plc, offset, width } = spot;
        Ok(self.ask(Op::Peek { plc, offset, width })?.value()?)
    }

    pub(super) fn store(&mut self, spot: Spot, value: u32) -> Result<(), ScenarioError> {
        let Spot { plc, offset, width } = spot;
        Ok(self.ask(Op::Poke { plc, offset, width, value })?.written()?)
    }

    /// Writes a single bit. The other bits of the register keep their values, even if other programs write them at the
    /// same time. A forced register keeps its value.
    pub(super) fn store_bit(
        &mut self,
        plc: DeviceIndex,
        bit: BitAccess,
        state: u32,
    ) -> Result<(), ScenarioError> {
        let BitAccess { offset, width, .. } = bit;
        let mut current = self.load(Spot { plc, offset, width })?;
        loop {
            let new = bit.set(current, state);
            match self.ask(Op::CompareExchange { plc, offset, width, current, new })?.exchanged()? {
                Ok(_) => return Ok(()),
                // The register is forced (decision D-860).
                Err(found) if found == current => return Ok(()),
                Err(found) => current = found,
            }
        }
    }

    /// Advances the clock by `us` microseconds.
    pub(super) fn advance(&mut self, mut us: u64) -> Result<(), ScenarioError> {
        let most = self.slice_us();
        while us > most {
            self.ask(Op::Advance { us: most })?.time()?;
            us -= most;
            self.go_on()?;
        }
        self.ask(Op::Advance { us })?.time()?;
        Ok(())
    }

    /// Returns the longest advance of the clock in one operation.
    fn slice_us(&self) -> u64 {
        if self.interrupt.is_some() { SLICE_US } else { MAX_ADVANCE_US }
    }

    /// Returns an error if the verb must end because of an interrupt.
    pub(super) fn go_on(&mut self) -> Result<(), ScenarioError> {
        let ends = self.interrupt.as_mut().is_some_and(|interrupt| interrupt());
        if ends { Err(ScenarioError::Interrupted) } else { Ok(()) }
    }

    /// Advances the clock to the next event, by `within_us` at most. With a real-time clock, waits for a short time.
    pub(super) fn advance_to_event(&mut self, within_us: u64) -> Result<(), ScenarioError> {
        self.go_on()?;
        if self.is_stepped {
            self.ask(Op::AdvanceToEvent { within_us: within_us.min(self.slice_us()) })?.time()?;
        } else {
            std::thread::sleep(PAUSE);
        }
        Ok(())
    }

    /// Waits until `register AND mask = value`. If this does not happen in time, the error is the last value of the
    /// register.
    pub(super) fn wait_op(
        &mut self,
        spot: Spot,
        mask: u32,
        value: u32,
        mut within_us: u64,
    ) -> Result<Result<(), u32>, ScenarioError> {
        let Spot { plc, offset, width } = spot;
        loop {
            let part = within_us.min(self.slice_us());
            match self.ask(Op::Wait { plc, offset, width, mask, value, within_us: part }) {
                Err(ScenarioError::Refused(Refused { waited: Some(Waited { value: last, .. }), .. })) => {
                    within_us -= part;
                    if within_us == 0 {
                        return Ok(Err(last));
                    }
                    self.go_on()?;
                }
                reply => {
                    reply?.waited()?;
                    return Ok(Ok(()));
                }
            }
        }
    }

    /// Returns the forced registers.
    pub(super) fn forces(&mut self) -> Result<Vec<Forced>, ScenarioError> {
        Ok(self.ask(Op::Forces)?.forces()?)
    }

    pub(super) fn board_of(&mut self, plc: DeviceIndex) -> Result<BoardState, ScenarioError> {
        Ok(self.ask(Op::Board { plc })?.board()?)
    }

    pub(super) fn turn(&mut self, plc: DeviceIndex, setting: BoardSetting) -> Result<(), ScenarioError> {
        Ok(self.ask(Op::SetBoard { plc, setting })?.written()?)
    }

    pub(super) fn entries(&mut self) -> Result<Vec<Entry>, ScenarioError> {
        Ok(self.ask(Op::Findings)?.findings()?)
    }

    /// Returns the number that the next record of the journal will have.
    pub(super) fn journal_end(&mut self) -> Result<u64, ScenarioError> {
        // No record has this number yet. So the reply contains only the end and no records.
        Ok(self.ask(Op::Journal { from: u64::MAX, max: 0 })?.journal()?.1)
    }

    /// Returns the number of the first record after the last return, or of the first record of the journal.
    pub(super) fn journal_begin(&mut self) -> Result<u64, ScenarioError> {
        Ok(self.ask(Op::Journal { from: 0, max: 1 })?.journal_part()?.turn.begin)
    }

    /// Returns the journal from record number `from` on, and the number of the next record. Records with a running
    /// count come last.
    pub(super) fn records(&mut self, from: u64) -> Result<(Vec<Record>, u64), ScenarioError> {
        let mut part = read_journal(from, |op| self.ask(op))?;
        part.records.append(&mut part.pending);
        Ok((part.records, part.end))
    }
}
