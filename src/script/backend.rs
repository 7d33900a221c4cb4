//! What the verbs need of a plant, be it in this process or behind a channel.

use crate::check::Entry;
use crate::fault::{Fault, Refusal};
use crate::journal::{Names, Record};
use crate::layout::flags;
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Address, MemoryError, Segment, Width};
use crate::plant::{ForceError, Forced};
use core::num::NonZeroU16;
use thiserror::Error;

/// Why a plant did not do what it was asked for.
#[derive(Debug, Error)]
pub enum BackendError {
    /// No register area covers the address.
    #[error("{address}: {}", flags::not_covered(*.address))]
    Unmapped {
        /// The refused access.
        address: Address,
    },
    /// Nobody sends SYNC on that bus, or there is no such bus.
    #[error("PLC '{plc}': nobody sends SYNC on the bus of node{node}; initialize its master first")]
    NoSync {
        /// Name of the PLC.
        plc: String,
        /// The CANsync node.
        node: u8,
    },
    /// The register cannot be forced.
    #[error("{address}: {source}")]
    Force {
        /// The register.
        address: Address,
        /// Why.
        source: ForceError,
    },
    /// The register is not forced.
    #[error("{address} is not forced")]
    NotForced {
        /// The register.
        address: Address,
    },
    /// The program cannot be started or stopped.
    #[error("PLC '{plc}': a start or stop needs a loaded program, the switch at RUN and the supply on")]
    StartRefused {
        /// Name of the PLC.
        plc: String,
    },
    /// The fault does not exist, or the plant cannot have it.
    #[error("{0}")]
    Fault(Refusal),
    /// The RAM cannot be mapped.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The instance at the other end of the channel.
    #[cfg(feature = "channel")]
    #[error(transparent)]
    Client(#[from] crate::channel::ClientError),
}

/// How a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waited {
    /// Whether the register matched in time.
    pub matched: bool,
    /// The register's last value.
    pub value: u32,
}

/// A register access: which PLC, where, how wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spot {
    /// Number of the PLC in the plant.
    pub plc: u16,
    /// Byte offset in segment 3.
    pub offset: u32,
    /// Width of the access.
    pub width: Width,
}

impl Spot {
    /// The address: `%MW3.200000`.
    pub fn address(&self) -> Address {
        self.width.at(self.offset)
    }
}

/// A plant that scenarios run on. Times are emulated time in microseconds.
///
/// The verbs have checked that PLC and address exist, so an error here is exceptional.
pub trait Backend {
    /// Names of the PLCs and buses.
    fn names(&self) -> &Names;

    /// Emulated time.
    ///
    /// # Errors
    /// As for all functions here: [`BackendError`].
    fn now(&mut self) -> Result<u64, BackendError>;

    /// Reads a register.
    fn load(&mut self, spot: Spot) -> Result<u32, BackendError>;

    /// Writes a register.
    fn store(&mut self, spot: Spot, value: u32) -> Result<(), BackendError>;

    /// Writes `new` if the register holds `current`; the inner result is what it held, `Ok` if written.
    fn compare_exchange(
        &mut self,
        spot: Spot,
        current: u32,
        new: u32,
    ) -> Result<Result<u32, u32>, BackendError>;

    /// Copies bytes of one area.
    fn read_range(&mut self, plc: u16, offset: u32, len: u32) -> Result<Vec<u8>, BackendError>;

    /// Lets the time pass; returns the time then.
    fn advance(&mut self, us: u64) -> Result<u64, BackendError>;

    /// Time up to the next SYNC on the bus of CANsync node `node`.
    fn advance_to_sync(&mut self, plc: u16, node: u8) -> Result<u64, BackendError>;

    /// Lets the time pass up to the next event, at most for `within_us`; returns the time then. On a clock that runs
    /// by itself a moment passes.
    fn advance_to_event(&mut self, within_us: u64) -> Result<u64, BackendError>;

    /// Waits until `register AND mask = value`.
    fn wait(&mut self, spot: Spot, mask: u32, value: u32, within_us: u64) -> Result<Waited, BackendError>;

    /// Makes a register keep a value.
    fn force(&mut self, spot: Spot, value: u32) -> Result<(), BackendError>;

    /// Lets a forced register go.
    fn unforce(&mut self, spot: Spot) -> Result<(), BackendError>;

    /// The forced registers.
    fn forces(&mut self) -> Result<Vec<Forced>, BackendError>;

    /// Adds a fault; returns its number.
    fn add_fault(&mut self, fault: Fault) -> Result<u16, BackendError>;

    /// Clears one fault, or all.
    fn clear_faults(&mut self, number: Option<NonZeroU16>) -> Result<(), BackendError>;

    /// The board of a PLC.
    fn board(&mut self, plc: u16) -> Result<BoardState, BackendError>;

    /// Does something to the board of a PLC.
    fn set_board(&mut self, plc: u16, setting: BoardSetting) -> Result<(), BackendError>;

    /// What the access checker has found.
    fn findings(&mut self) -> Result<Vec<Entry>, BackendError>;

    /// Forgets it.
    fn clear_findings(&mut self) -> Result<(), BackendError>;

    /// A program has run on the RAM of a PLC: what it has asked of the board is answered, in no time.
    fn answer_boards(&mut self) -> Result<(), BackendError>;

    /// The RAM of a PLC, as a program on that PLC has it.
    fn segment(&mut self, plc: u16) -> Result<Segment, BackendError>;

    /// Number of the journal record to come.
    fn journal_end(&mut self) -> Result<u64, BackendError>;

    /// The journal from record number `from` on, and the number of the record to come. What is still being
    /// counted comes last.
    fn journal(&mut self, from: u64) -> Result<(Vec<Record>, u64), BackendError>;
}
