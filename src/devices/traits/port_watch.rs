//! The access checker for the ports of a bus.

use crate::journal::{Journal, PortPhase};

/// The watches over the registers of a bus's ports ([`Bus::watch`](crate::devices::Bus::watch)). The bus owns the
/// watches, because its family has the rules and the firmware of the ports.
pub trait PortWatch {
    /// Called before the firmware runs: checks the writes of clients to the registers of a port since
    /// [`PortWatch::store_baseline`].
    fn judge_writes(&mut self, place: usize, now: u64, journal: &mut Journal);

    /// Called after the firmware has run: stores the registers of a port as the baseline.
    fn store_baseline(&mut self, place: usize);

    /// Checks a write of `bytes` bytes at byte `offset` of the image, which came through the channel, if it hit
    /// registers of a port.
    fn judge_write(&mut self, place: usize, offset: u32, bytes: u32, now: u64, journal: &mut Journal);

    /// Checks the values that firmware takes over at a SYNC edge. Called after all devices were notified of an edge
    /// that [`Bus::event`](crate::devices::Bus::event) has returned.
    fn judge_edge(&mut self, now: u64, journal: &mut Journal) {
        let _ = (now, journal);
    }

    /// Returns the phases of the ports, if structures of registers overlay each other. Ports that are missing in the
    /// result are in their first phase.
    fn phases(&mut self) -> Vec<PortPhase> {
        Vec::new()
    }
}
