//! The access checker for the ports of a bus.

use crate::journal::{Journal, PortPhase};

/// The watches over the registers of a bus's ports ([`Bus::watch`](crate::devices::Bus::watch)). The bus owns
/// the watches, because the family of the bus defines the rules and the firmware of the ports.
pub trait PortWatch {
    /// Called before the firmware runs. Checks the writes of clients to the registers of a port since the
    /// last [`PortWatch::store_baseline`].
    fn judge_writes(&mut self, place: usize, now: u64, journal: &mut Journal);

    /// Called when the firmware has run. Stores the registers of a port as the baseline.
    fn store_baseline(&mut self, place: usize);

    /// Checks a write of `bytes` bytes at byte `offset` of the image that came through the channel. Only
    /// bytes in registers of a port are checked.
    fn judge_write(&mut self, place: usize, offset: u32, bytes: u32, now: u64, journal: &mut Journal);

    /// Checks the values that firmware takes over at a SYNC edge. Called when all devices have been notified
    /// of an edge that [`Bus::event`](crate::devices::Bus::event) has returned.
    fn judge_edge(&mut self, now: u64, journal: &mut Journal) {
        let _ = (now, journal);
    }

    /// Returns the phases of the ports, for ports with structures that have common addresses. Ports that the
    /// result does not contain are in their first phase.
    fn phases(&mut self) -> Vec<PortPhase> {
        Vec::new()
    }
}
