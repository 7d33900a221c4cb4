//! The SYNC signal of a bus: its source, its next edge, and edges that another bus forwards.

use crate::journal::{Journal, Origin};
use serde::{Deserialize, Serialize};

/// Properties of a SYNC signal, for masters that take the signal over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SyncSignal {
    /// Time between two edges in us.
    pub interval_us: u32,
    /// Baud rate, in kbit/s, of the bus of the master that generates the signal.
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
        /// The register and the value that make the master pass on the signal. Used in messages.
        setting: &'static str,
    },
}

/// The SYNC signal of a bus that has one ([`Bus::sync`](crate::devices::Bus::sync)).
pub trait SyncLine {
    /// True if the port takes its SYNC signal from another port of its device.
    fn takes_sync(&self, place: usize) -> bool;

    /// Handles an edge of a SYNC signal that another bus forwards.
    fn forwarded_edge(&mut self, place: usize, now: u64, signal: SyncSignal, journal: &mut Journal);

    /// Returns the time of the next SYNC edge, if this bus generates the signal.
    fn next_sync(&self) -> Option<u64>;

    /// Source of the bus's SYNC signal.
    fn sync_origin(&self) -> SyncOrigin;
}
