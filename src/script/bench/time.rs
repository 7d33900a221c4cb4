//! The verbs that advance the clock.

use super::Bench;
use crate::identity::DeviceIndex;
use crate::layout::split_plc;
use crate::request::Op;
use crate::script::{ScenarioError, Span};

impl Bench {
    /// Advances the clock.
    ///
    /// # Errors
    /// The time is invalid, or longer than the limit of the scenario.
    pub fn step(&mut self, time: impl Into<Span>) -> Result<(), ScenarioError> {
        let us = self.span(time)?;
        self.advance(us)
    }

    /// Advances the clock to the next SYNC on the bus of a port, for example `node2`, with the PLC as a prefix if
    /// there are several. An empty name means the device's first master.
    ///
    /// # Errors
    /// There is no such port, or there is no SYNC signal.
    pub fn step_to_sync(&mut self, port: &str) -> Result<(), ScenarioError> {
        let (plc, name) = split_plc(port);
        // A text without a PLC is ambiguous if there are several PLCs. The message shows a port of the first PLC as an
        // example.
        let example = self.names.fitted(DeviceIndex(0)).port_or_master(name).map_or(name, |port| port.name);
        let plc = self.plc(plc, example)?;
        let node = self.names.fitted(plc).port_or_master(name)?.number;
        self.within_limit(0)?;
        self.ask(Op::AdvanceToSync { plc, node })?.time()?;
        Ok(())
    }

    /// Keeps a snapshot of the whole plant and returns its number for [`Bench::back_to`]. At most 64 snapshots are kept
    /// at a time.
    ///
    /// # Errors
    /// The maximum number is reached, or the clock is not stepped.
    pub fn save(&mut self) -> Result<u32, ScenarioError> {
        let number = self.ask(Op::Save)?.value()?;
        self.saved.push(number);
        Ok(number)
    }

    /// Deletes a snapshot, so that another one can be kept.
    ///
    /// # Errors
    /// There is no such snapshot.
    pub fn forget(&mut self, saved: u32) -> Result<(), ScenarioError> {
        self.ask(Op::Forget { number: saved })?.written()?;
        self.saved.retain(|number| *number != saved);
        Ok(())
    }

    /// Releases the snapshots of this bench. Errors are ignored: another client may have released a snapshot, and an
    /// ended instance keeps none.
    pub(in crate::script) fn forget_saved(&mut self) {
        for number in core::mem::take(&mut self.saved) {
            if self.ask(Op::Forget { number }).is_err() {
                break;
            }
        }
    }

    /// Goes back to a snapshot: the plant, its clock and its journal are restored. Function blocks and other memory
    /// of a program keep their content.
    ///
    /// # Errors
    /// There is no such snapshot, or a client of a running instance takes part and cannot go back.
    pub fn back_to(&mut self, saved: u32) -> Result<(), ScenarioError> {
        self.note_required_faults()?;
        self.returned_us = Some(self.ask(Op::BackTo { number: saved, detached: false })?.time()?);
        self.forget_required_faults()
    }

    /// Returns the time in microseconds, if it is within the limit of the scenario.
    pub(in crate::script) fn span(&mut self, time: impl Into<Span>) -> Result<u64, ScenarioError> {
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
}
