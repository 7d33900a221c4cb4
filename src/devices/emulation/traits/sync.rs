//! The SYNC signal of a bus: its source, its next edge, and edges that another bus forwards.

use crate::journal::{Journal, Origin};
use serde::{Deserialize, Serialize};

/// Properties of a SYNC signal. Masters that take over the signal need them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SyncSignal {
    /// Time between two edges in us.
    pub interval_us: u32,
    /// Baud rate in kbit/s. It is the rate of the bus on which the master that generates the signal is.
    pub kbit_s: u16,
}

/// Source of the SYNC signal of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncOrigin {
    /// The bus has no master that could generate the signal.
    NoMaster,
    /// The master has not started.
    Idle {
        /// Port of the master.
        port: Origin,
        /// Name of the status register of the master.
        register: &'static str,
        /// Value of the status register.
        state: u16,
    },
    /// The master of the bus generates the signal.
    Own(Origin),
    /// The master passes on the signal of another port of its device.
    Forwarded {
        /// Port of the master.
        port: Origin,
        /// The register and the value that make the master pass on the signal. Messages contain this text.
        setting: &'static str,
    },
}

/// The SYNC signal of a bus that has one ([`Bus::sync`](crate::devices::Bus::sync)).
pub trait SyncLine {
    /// True if the port takes its SYNC signal from another port of its device.
    fn takes_sync(&self, place: usize) -> bool;

    /// Handles an edge of a SYNC signal that another bus passes on to this bus.
    fn forwarded_edge(&mut self, place: usize, now: u64, signal: SyncSignal, journal: &mut Journal);

    /// If this bus generates the signal, returns the time of the next SYNC edge.
    fn next_sync(&self) -> Option<u64>;

    /// Source of the bus's SYNC signal.
    fn sync_origin(&self) -> SyncOrigin;
}
