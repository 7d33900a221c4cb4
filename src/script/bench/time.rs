//! The verbs in which time passes.

use super::Bench;
use crate::layout::split_plc;
use crate::request::Op;
use crate::script::{ScenarioError, Span};

impl Bench {
    /// Lets the time pass.
    ///
    /// # Errors
    /// No time, or more than the scenario may take.
    pub fn step(&mut self, time: impl Into<Span>) -> Result<(), ScenarioError> {
        let us = self.span(time)?;
        self.advance(us)
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
        self.ask(Op::AdvanceToSync { plc, node: number })?.time()?;
        Ok(())
    }

    /// The time in microseconds, if the scenario may still take it.
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
