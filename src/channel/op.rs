//! Operations and replies, as the callers of both ends see them.

use super::ChannelError;
use crate::check::Entry;
use crate::fault::{Fault, FaultStatus};
use crate::journal::Record;
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{ClockMode, Width};
use crate::plant::Forced;
use core::num::NonZeroU16;

/// Most operations one request may carry.
pub const MAX_OPS: usize = 256;
/// Longest [`Op::ReadRange`] in bytes.
pub const MAX_RANGE: u32 = 65_536;
/// Most records one [`Op::Journal`] is answered with.
pub const MAX_RECORDS: u32 = 1024;
/// Longest time one operation may let pass: 24 h of emulated time, in microseconds.
pub const MAX_ADVANCE_US: u64 = 24 * 3_600_000_000;

/// One operation of a request.
///
/// `plc` is the PLC's number in the instance, from 0; `offset` is the byte offset in segment 3, the `n`
/// of `%MB3.n`, and must suit the width. Times are emulated time in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// Reads a register. Answered by [`Reply::Value`].
    Peek {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
    },
    /// Writes a register. Answered by [`Reply::Written`].
    Poke {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
        /// The value; must fit the width.
        value: u32,
    },
    /// Writes `new` if the register holds `current`. Answered by [`Reply::Exchanged`].
    CompareExchange {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
        /// The value expected in the register; must fit the width.
        current: u32,
        /// The value to write; must fit the width.
        new: u32,
    },
    /// Copies bytes. Registers may tear against each other, never within themselves. Answered by
    /// [`Reply::Bytes`].
    ReadRange {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the first byte.
        offset: u32,
        /// Number of bytes, at most [`MAX_RANGE`].
        len: u32,
    },
    /// Waits until `register AND mask = value`. In stepped mode it lets the time pass, event by event.
    /// Answered by [`Reply::Waited`], or by [`ChannelError::WaitTimedOut`] with the last value seen.
    Wait {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
        /// The bits that count; must fit the width.
        mask: u32,
        /// What those bits shall be; no bit outside the mask.
        value: u32,
        /// Longest wait in emulated microseconds, at most [`MAX_ADVANCE_US`].
        within_us: u64,
    },
    /// Lets the emulated time pass; stepped mode only. Answered by [`Reply::Advanced`].
    Advance {
        /// How long, in microseconds, at most [`MAX_ADVANCE_US`].
        us: u64,
    },
    /// Lets the time pass up to the next SYNC of a CANsync node's bus; stepped mode only. Answered by
    /// [`Reply::Advanced`].
    AdvanceToSync {
        /// Number of the PLC.
        plc: u16,
        /// CANsync node (interface) of that PLC.
        node: u8,
    },
    /// Lets the time pass up to the next moment at which the emulator has something to do; stepped mode only. What is
    /// due now is done now, and no time passes. Answered by [`Reply::Advanced`].
    AdvanceToEvent {
        /// The longest time, in microseconds, at most [`MAX_ADVANCE_US`].
        within_us: u64,
    },
    /// Reads the journal from record number `from` on. Answered by [`Reply::Journal`].
    Journal {
        /// Number of the first record wanted; what is no longer kept is left out.
        from: u64,
        /// Most records wanted; more than [`MAX_RECORDS`] are never sent.
        max: u32,
    },
    /// Forces a register: it keeps the value against firmware and PLC. Answered by [`Reply::Written`].
    Force {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
        /// The value it keeps; must fit the width.
        value: u32,
    },
    /// Lets a forced register go. Answered by [`Reply::Written`].
    Unforce {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
    },
    /// Asks which registers are forced. Answered by [`Reply::Forces`].
    Forces,
    /// Adds a fault. Answered by [`Reply::FaultAdded`].
    FaultAdd {
        /// The fault.
        fault: Fault,
    },
    /// Lists the faults that wait or act. Answered by [`Reply::Faults`].
    FaultList,
    /// Clears faults. Answered by [`Reply::FaultsCleared`].
    FaultClear {
        /// Number of the fault, at least 1; `None`: all.
        id: Option<NonZeroU16>,
    },
    /// Looks at a PLC's board. Answered by [`Reply::Board`].
    Board {
        /// Number of the PLC.
        plc: u16,
    },
    /// Does something to a PLC's board, at the present emulated time. Answered by [`Reply::Written`]; a start that is
    /// not possible is refused.
    SetBoard {
        /// Number of the PLC.
        plc: u16,
        /// What.
        setting: BoardSetting,
    },
    /// Asks what the access checker has found. Answered by [`Reply::Findings`].
    Findings,
    /// Forgets what the access checker has found. Answered by [`Reply::Cleared`].
    ClearFindings,
    /// Asks who answers. Answered by [`Reply::Info`].
    Info,
    /// Asks the emulator to end. Answered by [`Reply::Stopping`].
    Stop,
}

impl Op {
    /// The emulated time this operation may take at most because it waits, in microseconds.
    pub(super) fn waits_us(&self) -> u64 {
        match self {
            Op::Wait { within_us, .. } => (*within_us).min(MAX_ADVANCE_US),
            _ => 0,
        }
    }
}

/// The answer to one operation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// The register's value.
    Value(u32),
    /// The register was written.
    Written,
    /// The comparison was made.
    Exchanged {
        /// Whether the register held the expected value and was written.
        ok: bool,
        /// What it held before.
        found: u32,
    },
    /// The bytes of a range.
    Bytes(Vec<u8>),
    /// The register matched.
    Waited {
        /// Emulated time of the match, in microseconds.
        time_us: u64,
        /// The register's whole value.
        value: u32,
    },
    /// The time has passed.
    Advanced {
        /// Emulated time now, in microseconds.
        time_us: u64,
    },
    /// A part of the journal.
    Journal {
        /// Records in the order of their numbers. If they reach the end, those that are still being counted
        /// follow ([`Record::is_pending`]).
        records: Vec<Record>,
        /// The number that the next record will have.
        end: u64,
    },
    /// The forced registers, in the order of PLCs and addresses.
    Forces(Vec<Forced>),
    /// The fault was added.
    FaultAdded {
        /// Its number in the instance.
        id: u16,
    },
    /// The faults that wait or act, in the order in which they were added.
    Faults(Vec<FaultStatus>),
    /// Faults were cleared.
    FaultsCleared {
        /// How many.
        count: u16,
    },
    /// A PLC's board.
    Board(BoardState),
    /// What the access checker has found, in the order of the first findings.
    Findings(Vec<Entry>),
    /// It is forgotten.
    Cleared,
    /// Who answers.
    Info(Box<InstanceInfo>),
    /// The emulator is going to end.
    Stopping,
    /// The operation failed; those behind it were not executed.
    Error(ChannelError),
    /// An earlier operation of the request failed.
    NotExecuted,
}

/// What an emulator says about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InstanceInfo {
    /// Name of the instance.
    pub name: String,
    /// What drives the emulated time.
    pub clock_mode: ClockMode,
    /// Emulated time per real time x 1000 (1000 is real time); 0 in stepped mode.
    pub speed: u32,
    /// Emulated time since the start, in microseconds.
    pub time_us: u64,
    /// Counts the emulators that have used the image, from 1.
    pub generation: u32,
    /// Process id of the emulator.
    pub pid: u32,
    /// Hash of the register map.
    pub layout_hash: u64,
    /// Version of the attach contract.
    pub abi_version: u32,
    /// Version of the program, as in `commram --version`.
    pub version: String,
    /// Names of the PLCs, in the order of their numbers.
    pub plcs: Vec<String>,
    /// Names of the buses, in the order of their numbers.
    pub buses: Vec<String>,
}
