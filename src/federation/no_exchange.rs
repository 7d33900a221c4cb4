//! An exchange for a single federate.

use super::Exchange;

/// Exchange of a federation that has only one federate: the plant runs on one host and exchanges values with other
/// simulators.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoExchange;

impl Exchange for NoExchange {
    fn send(&mut self, _: &[u8]) -> Result<(), String> {
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<(u8, Vec<u8>)>, String> {
        Ok(None)
    }

    fn leave(&mut self, _: &[u8]) {}
}
