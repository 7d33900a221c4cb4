//! The operations.

use crate::can::Frame;
use crate::door::DoorSpec;
use crate::fault::Fault;
use crate::journal::Keep;
use crate::layout::Test;
use crate::memory::Width;
use crate::memory::header::BoardSetting;
use core::num::NonZeroU16;

/// Maximum number of operations in a request.
pub const MAX_OPS: usize = 256;
/// Longest [`Op::ReadRange`] in bytes.
pub const MAX_RANGE: u32 = 65_536;
/// Maximum number of records in the answer to an [`Op::Journal`], and of changes in the answer to an [`Op::Changes`].
pub const MAX_RECORDS: u32 = 1024;
/// Maximum number of [`Op::Condition`]s for an [`Op::WaitFor`]: the number of bits of its answer.
pub const MAX_CONDITIONS: usize = 32;
/// Maximum advance of the clock in an operation: 24 h of emulated time, in microseconds.
pub const MAX_ADVANCE_US: u64 = 24 * 3_600_000_000;

/// An operation of a request.
///
/// `plc` is the PLC's number in the instance, from 0; `offset` is the byte in its image file, which the device's
/// [`spaces`](crate::layout::DeviceLayout::spaces) map to the address, and must suit the width. Times are emulated time in
/// microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// Reads a register. Answered by [`Reply::Value`](super::Reply::Value).
    Peek {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
    },
    /// Writes a register. Answered by [`Reply::Written`](super::Reply::Written).
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
    /// Writes `new` if the register holds `current`. Answered by [`Reply::Exchanged`](super::Reply::Exchanged).
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
    /// [`Reply::Bytes`](super::Reply::Bytes).
    ReadRange {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the first byte.
        offset: u32,
        /// Number of bytes, at most [`MAX_RANGE`].
        len: u32,
    },
    /// Waits until `register AND mask = value`. In stepped mode it advances the clock, event by event. Answered by
    /// [`Reply::Waited`](super::Reply::Waited), or refused with [`Code::NOT_IN_TIME`](super::Code::NOT_IN_TIME) and the
    /// last value.
    Wait {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
        /// The bits that count; must fit the width.
        mask: u32,
        /// New value of the bits in the mask; no bit outside the mask.
        value: u32,
        /// Longest wait in emulated microseconds, at most [`MAX_ADVANCE_US`].
        within_us: u64,
    },
    /// Adds a condition for the next [`Op::WaitFor`] of the request, at most [`MAX_CONDITIONS`]. Answered by
    /// [`Reply::Written`](super::Reply::Written).
    Condition {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
        /// Condition for the register; mask and value must fit the width.
        test: Test,
    },
    /// Waits until all conditions that precede it hold at the same moment, or any of them. In stepped mode it advances
    /// the clock, event by event. Answered by [`Reply::Waited`](super::Reply::Waited), with bit n of the value set if
    /// condition n (from 0) holds, or refused with [`Code::NOT_IN_TIME`](super::Code::NOT_IN_TIME) and the same.
    WaitFor {
        /// Whether a single condition is sufficient.
        any: bool,
        /// Longest wait in emulated microseconds, at most [`MAX_ADVANCE_US`].
        within_us: u64,
    },
    /// Advances the clock; stepped mode only. Answered by [`Reply::Time`](super::Reply::Time).
    Advance {
        /// Duration in microseconds, at most [`MAX_ADVANCE_US`].
        us: u64,
    },
    /// Advances the clock to the next SYNC of the medium at a port; stepped mode only. Answered by
    /// [`Reply::Time`](super::Reply::Time).
    AdvanceToSync {
        /// Number of the PLC.
        plc: u16,
        /// Number of the port of that PLC.
        node: u8,
    },
    /// Advances the clock to the next moment at which the emulator has something to do; stepped mode only. If there are
    /// events at the present time, they are handled now, and no time passes. Answered by
    /// [`Reply::Time`](super::Reply::Time).
    AdvanceToEvent {
        /// The longest time, in microseconds, at most [`MAX_ADVANCE_US`].
        within_us: u64,
    },
    /// Reads the journal from record number `from` on. Answered by [`Reply::Journal`](super::Reply::Journal).
    Journal {
        /// Number of the first record wanted; records that are no longer kept are left out.
        from: u64,
        /// Most records wanted; more than [`MAX_RECORDS`] are never sent.
        max: u32,
    },
    /// Records all changes from now on of the registers in a range. The plant runs as it would without it. Answered by
    /// [`Reply::Written`](super::Reply::Written).
    Follow {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the first byte.
        offset: u32,
        /// Number of bytes, at most [`MAX_RANGE`].
        len: u32,
        /// Destination of the changes.
        keep: Keep,
    },
    /// Returns whether all changes of a register are recorded in the journal. Answered by
    /// [`Reply::Value`](super::Reply::Value): 1 if they are, else 0.
    IsRecorded {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
    },
    /// Reads the changes that are kept for onlookers, from number `from` on. Changes are no longer collected for an
    /// onlooker after ten seconds of real time without a request. Answered by
    /// [`Reply::Changes`](super::Reply::Changes).
    Changes {
        /// Number of the first change wanted; changes that are no longer kept are left out.
        from: u64,
        /// Most changes wanted; more than [`MAX_RECORDS`] are never sent.
        max: u32,
    },
    /// Forces a register: it keeps the value against firmware and PLC. Answered by [`Reply::Written`](super::Reply::Written).
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
    /// Releases a forced register. Answered by [`Reply::Written`](super::Reply::Written).
    Unforce {
        /// Number of the PLC.
        plc: u16,
        /// Byte offset of the register.
        offset: u32,
        /// Its width.
        width: Width,
    },
    /// Returns the forced registers. Answered by [`Reply::Forces`](super::Reply::Forces).
    Forces,
    /// Adds a fault. Answered by [`Reply::FaultAdded`](super::Reply::FaultAdded).
    FaultAdd {
        /// The fault.
        fault: Fault,
    },
    /// Lists the faults that wait or act. Answered by [`Reply::Faults`](super::Reply::Faults).
    FaultList,
    /// Clears faults. Answered by [`Reply::FaultsCleared`](super::Reply::FaultsCleared).
    FaultClear {
        /// Number of the fault, at least 1; `None`: all.
        id: Option<NonZeroU16>,
    },
    /// Reads a PLC's board. Answered by [`Reply::Board`](super::Reply::Board).
    Board {
        /// Number of the PLC.
        plc: u16,
    },
    /// Changes a setting of a PLC's board, at the present emulated time. Answered by
    /// [`Reply::Written`](super::Reply::Written); a start that is not possible is refused.
    SetBoard {
        /// Number of the PLC.
        plc: u16,
        /// The setting.
        setting: BoardSetting,
    },
    /// Returns the findings of the access checker. Answered by [`Reply::Findings`](super::Reply::Findings).
    Findings,
    /// Clears the findings of the access checker. Answered by [`Reply::Cleared`](super::Reply::Cleared).
    ClearFindings,
    /// Asks for the buses, their doors and the guests there. Answered by [`Reply::Buses`](super::Reply::Buses).
    Buses,
    /// Reads the drives and their states. Answered by [`Reply::Drives`](super::Reply::Drives).
    Drives,
    /// Reads all details of a drive. Answered by [`Reply::Drive`](super::Reply::Drive).
    Drive {
        /// Position in the answer to [`Op::Drives`].
        drive: u16,
    },
    /// Sets a parameter of a drive, as a user does at the drive itself. Answered by
    /// [`Reply::Written`](super::Reply::Written).
    SetParameter {
        /// Position in the answer to [`Op::Drives`].
        drive: u16,
        /// Number of the parameter.
        number: u16,
        /// Its new value.
        value: i64,
    },
    /// Reads the present activity of the buses: their intervals and ports. Answered by
    /// [`Reply::Scene`](super::Reply::Scene).
    Scene,
    /// Opens a door to a bus. Answered by [`Reply::DoorOpened`](super::Reply::DoorOpened).
    DoorOpen {
        /// Number of the bus.
        bus: u16,
        /// The door.
        door: DoorSpec,
    },
    /// Closes doors to a bus; their guests leave. Answered by [`Reply::DoorsClosed`](super::Reply::DoorsClosed).
    DoorClose {
        /// Number of the bus.
        bus: u16,
        /// The door, with its real port or number; `None`: all.
        door: Option<DoorSpec>,
    },
    /// Takes part in a bus from now on, and sends a frame if one is given. Answered by
    /// [`Reply::Written`](super::Reply::Written).
    BusSend {
        /// Number of the bus.
        bus: u16,
        /// The frame.
        frame: Option<Frame>,
    },
    /// Keeps a snapshot of the plant. Answered by [`Reply::Value`](super::Reply::Value): its number. Stepped clock only, as for
    /// all of these.
    Save,
    /// Forgets a snapshot. Answered by [`Reply::Written`](super::Reply::Written).
    Forget {
        /// Its number.
        number: u32,
    },
    /// Reads a part of a snapshot as a file, at most [`MAX_RANGE`] bytes. Answered by [`Reply::Bytes`](super::Reply::Bytes): fewer
    /// at the end.
    ReadSaved {
        /// Its number.
        number: u32,
        /// The first byte of the part.
        from: u32,
    },
    /// Brings a part of a snapshot file, in the order of its bytes; byte 0 begins a new file. Answered by
    /// [`Reply::Written`](super::Reply::Written).
    BringSaved {
        /// The first byte of the part.
        at: u32,
        /// Number of bytes, up to 16.
        count: u8,
        /// The bytes; bytes after `count` are 0.
        bytes: [u8; 16],
    },
    /// Restores the snapshot in the file that was uploaded. Answered by [`Reply::Time`](super::Reply::Time), like the
    /// next two. `detached`, here and below: also if an outside participant cannot go back.
    Restore {
        /// See above.
        detached: bool,
    },
    /// Restores a kept snapshot.
    BackTo {
        /// Its number.
        number: u32,
        /// See [`Op::Restore`].
        detached: bool,
    },
    /// Goes back in time.
    Back {
        /// Duration in microseconds.
        us: u64,
        /// See [`Op::Restore`].
        detached: bool,
    },
    /// Goes back to the last moment before now at which the preceding conditions became true. Answered by
    /// [`Reply::Waited`](super::Reply::Waited).
    BackUntil {
        /// A single condition is sufficient.
        any: bool,
        /// See [`Op::Restore`].
        detached: bool,
    },
    /// Asks for the emulated time. Answered by [`Reply::Time`](super::Reply::Time).
    Time,
    /// Reads the description of the instance. Answered by [`Reply::Info`](super::Reply::Info).
    Info,
    /// Asks the emulator to end. Answered by [`Reply::Stopping`](super::Reply::Stopping).
    Stop,
}

impl Op {
    /// Whether the operation changes nothing in the plant, so that the time of its execution makes no difference.
    pub fn only_looks(&self) -> bool {
        match self {
            Op::Peek { .. }
            | Op::ReadRange { .. }
            | Op::Journal { .. }
            | Op::IsRecorded { .. }
            | Op::Changes { .. }
            | Op::Forces
            | Op::FaultList
            | Op::Board { .. }
            | Op::Findings
            | Op::Buses
            | Op::Drives
            | Op::Drive { .. }
            | Op::Scene
            | Op::Time
            | Op::Info
            | Op::Stop => true,
            Op::Poke { .. }
            | Op::CompareExchange { .. }
            | Op::Wait { .. }
            | Op::Condition { .. }
            | Op::WaitFor { .. }
            | Op::Follow { .. }
            | Op::Advance { .. }
            | Op::AdvanceToSync { .. }
            | Op::AdvanceToEvent { .. }
            | Op::Force { .. }
            | Op::Unforce { .. }
            | Op::FaultAdd { .. }
            | Op::FaultClear { .. }
            | Op::SetBoard { .. }
            | Op::ClearFindings
            | Op::SetParameter { .. }
            | Op::Save
            | Op::Forget { .. }
            | Op::ReadSaved { .. }
            | Op::BringSaved { .. }
            | Op::Restore { .. }
            | Op::BackTo { .. }
            | Op::Back { .. }
            | Op::BackUntil { .. }
            | Op::DoorOpen { .. }
            | Op::DoorClose { .. }
            | Op::BusSend { .. } => false,
        }
    }

    /// Whether the operation only stores a register.
    pub(super) fn stores(&self) -> bool {
        matches!(self, Op::Poke { .. } | Op::CompareExchange { .. })
    }

    /// Whether the operation changes the plant in another way than by advancing the clock.
    pub(crate) fn acts(&self) -> bool {
        matches!(
            self,
            Op::Poke { .. }
                | Op::CompareExchange { .. }
                | Op::Follow { .. }
                | Op::Force { .. }
                | Op::Unforce { .. }
                | Op::FaultAdd { .. }
                | Op::FaultClear { .. }
                | Op::SetBoard { .. }
                | Op::ClearFindings
                | Op::SetParameter { .. }
                | Op::BusSend { .. }
        )
    }

    /// The emulated time this operation may take at most because it waits, in microseconds.
    pub fn waits_us(&self) -> u64 {
        match self {
            Op::Wait { within_us, .. } | Op::WaitFor { within_us, .. } => (*within_us).min(MAX_ADVANCE_US),
            _ => 0,
        }
    }
}
