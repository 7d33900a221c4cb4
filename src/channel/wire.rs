//! Requests and replies as fixed-width integers.
//!
//! A request is a slice of [`WireOp`], one per operation. A reply is a slice of [`Block`]: per operation one head
//! block, followed by the blocks of its data. Both sides may be hostile or of another build, so every bit pattern must
//! be decodable, if only into an error. Therefore the format has only integers, no `bool`, `char` or enum, and decoding
//! is checked. Both sides are on one machine, so integers have its byte order.
//!
//! `docs/reference/channel.md` describes the format for other languages. The type names contain its version: iceoryx2
//! refuses a client with other type names or sizes.

mod door;
mod fault;
mod findings;
mod forces;
#[cfg(test)]
mod format_tests;
mod journal;
mod reply;
mod serde_types;
#[cfg(test)]
mod tests;

pub use reply::{DecodeError, ReplyBuffer, decode};

use crate::can::Frame;
use crate::journal::Keep;
use crate::layout::{Compare, Test};
use crate::memory::Width;
use crate::memory::header::BoardSetting;
use crate::request::{MAX_OPS, MAX_RANGE, Op};
use core::num::NonZeroU16;
use iceoryx2::prelude::ZeroCopySend;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// Version of the format. A change of an operation, a reply, or a type of the program within a reply counts it up, here and
/// in the names of [`WireOp`] and [`Block`].
pub const WIRE_VERSION: u32 = 2;
/// Longest reply in bytes: four full ranges and some space for other replies.
pub const MAX_REPLY_BYTES: usize = 4 * MAX_RANGE as usize + 64 * MAX_OPS;
/// Longest reply in blocks.
pub const MAX_REPLY_BLOCKS: usize = MAX_REPLY_BYTES / size_of::<Block>();

/// One operation of a request. `fault.rs` defines the layout of a fault, `door.rs` that of a door.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout, ZeroCopySend,
)]
#[type_name("commram.channel.WireOp.v2")]
#[repr(C)]
pub struct WireOp {
    /// Kind of the operation: one of [`kind`].
    pub kind: u16,
    /// Number of the PLC or bus.
    pub plc: u16,
    /// Access width in bytes: 1, 2 or 4.
    pub width: u16,
    /// Number of the port, or operator of a condition.
    pub node: u16,
    /// Byte in the image, or number of a board setting.
    pub offset: u32,
    /// Value to write or awaited, length of a range, or number of records.
    pub value: u32,
    /// Mask of a wait, or expected value of a comparison.
    pub second: u32,
    /// Zero.
    pub reserved: u32,
    /// Emulated time in microseconds, or number of a record.
    pub time_us: u64,
}

/// A unit of a reply: a head, or 16 bytes of the data that follow a head.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout, ZeroCopySend,
)]
#[type_name("commram.channel.Block.v2")]
#[repr(C)]
pub struct Block {
    /// Kind of the reply: one of [`reply_kind`].
    pub kind: u16,
    /// Code of an error, or whether a comparison held.
    pub code: u16,
    /// Number of data bytes in the following blocks; the rest of the last block is zero.
    pub data_len: u32,
    /// The reply's number: a value, a time, or the end of the journal.
    pub value: u64,
}

const _: () = assert!(size_of::<WireOp>() == 32 && size_of::<Block>() == 16);

/// Values of [`WireOp::kind`].
#[allow(missing_docs)]
pub mod kind {
    pub const PEEK: u16 = 1;
    pub const POKE: u16 = 2;
    pub const COMPARE_EXCHANGE: u16 = 3;
    pub const READ_RANGE: u16 = 4;
    pub const WAIT: u16 = 5;
    pub const ADVANCE: u16 = 6;
    pub const ADVANCE_TO_SYNC: u16 = 7;
    pub const INFO: u16 = 8;
    pub const STOP: u16 = 9;
    pub const JOURNAL: u16 = 10;
    pub const ADVANCE_TO_EVENT: u16 = 11;
    pub const TIME: u16 = 12;
    pub const CONDITION: u16 = 13;
    pub const WAIT_FOR: u16 = 14;
    pub const FORCE: u16 = 30;
    pub const UNFORCE: u16 = 31;
    pub const FORCES: u16 = 32;
    pub const FAULT_ADD: u16 = 20;
    pub const FAULT_LIST: u16 = 21;
    pub const FAULT_CLEAR: u16 = 22;
    pub const BOARD: u16 = 40;
    pub const SET_BOARD: u16 = 41;
    pub const FINDINGS: u16 = 50;
    pub const CLEAR_FINDINGS: u16 = 51;
    pub const DRIVES: u16 = 80;
    pub const DRIVE: u16 = 81;
    pub const SET_PARAMETER: u16 = 82;
    pub const BUSES: u16 = 60;
    pub const DOOR_OPEN: u16 = 61;
    pub const DOOR_CLOSE: u16 = 62;
    pub const BUS_SEND: u16 = 63;
    pub const FOLLOW: u16 = 70;
    pub const CHANGES: u16 = 71;
    pub const SAVE: u16 = 72;
    pub const FORGET: u16 = 73;
    pub const READ_SAVED: u16 = 74;
    pub const BRING_SAVED: u16 = 75;
    pub const RESTORE: u16 = 76;
    pub const BACK_TO: u16 = 77;
    pub const BACK: u16 = 78;
    pub const BACK_UNTIL: u16 = 79;
    pub const SCENE: u16 = 85;
    pub const IS_RECORDED: u16 = 86;
}

/// Values of [`Block::kind`].
#[allow(missing_docs)]
pub mod reply_kind {
    pub const VALUE: u16 = 1;
    pub const WRITTEN: u16 = 2;
    pub const EXCHANGED: u16 = 3;
    pub const BYTES: u16 = 4;
    pub const WAITED: u16 = 5;
    pub const TIME: u16 = 6;
    pub const INFO: u16 = 7;
    pub const STOPPING: u16 = 8;
    pub const ERROR: u16 = 9;
    pub const JOURNAL: u16 = 10;
    pub const FORCES: u16 = 30;
    pub const FAULT_ADDED: u16 = 20;
    pub const FAULTS: u16 = 21;
    pub const FAULTS_CLEARED: u16 = 22;
    pub const BOARD: u16 = 40;
    pub const FINDINGS: u16 = 50;
    pub const CLEARED: u16 = 51;
    pub const DRIVES: u16 = 80;
    pub const DRIVE: u16 = 81;
    pub const BUSES: u16 = 60;
    pub const DOOR_OPENED: u16 = 61;
    pub const DOORS_CLOSED: u16 = 62;
    pub const CHANGES: u16 = 71;
    pub const SCENE: u16 = 85;
    pub const IS_RECORDED: u16 = 86;
}

/// A field of an operation without meaning, and its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} is 16#{value:X}")]
pub struct BadField {
    /// The field: "the kind".
    pub field: &'static str,
    /// Its content.
    pub value: u32,
}

impl BadField {
    fn new(field: &'static str, value: impl Into<u32>) -> Self {
        Self { field, value: value.into() }
    }
}

impl From<&Op> for WireOp {
    fn from(op: &Op) -> Self {
        let register = |kind, plc, offset, width: Width| WireOp {
            kind,
            plc,
            offset,
            width: width_code(width),
            ..WireOp::default()
        };
        match *op {
            Op::Peek { plc, offset, width } => register(kind::PEEK, plc, offset, width),
            Op::Poke { plc, offset, width, value } => {
                WireOp { value, ..register(kind::POKE, plc, offset, width) }
            }
            Op::CompareExchange { plc, offset, width, current, new } => {
                WireOp { value: new, second: current, ..register(kind::COMPARE_EXCHANGE, plc, offset, width) }
            }
            Op::ReadRange { plc, offset, len } => {
                WireOp { kind: kind::READ_RANGE, plc, offset, value: len, ..WireOp::default() }
            }
            Op::Wait { plc, offset, width, mask, value, within_us } => {
                WireOp { value, second: mask, time_us: within_us, ..register(kind::WAIT, plc, offset, width) }
            }
            Op::Condition { plc, offset, width, test } => {
                let Test { mask, value, .. } = test;
                let node = compare_code(test);
                WireOp { value, second: mask, node, ..register(kind::CONDITION, plc, offset, width) }
            }
            Op::WaitFor { any, within_us } => {
                WireOp { kind: kind::WAIT_FOR, value: any.into(), time_us: within_us, ..WireOp::default() }
            }
            Op::Advance { us } => WireOp { kind: kind::ADVANCE, time_us: us, ..WireOp::default() },
            Op::AdvanceToSync { plc, node } => {
                WireOp { kind: kind::ADVANCE_TO_SYNC, plc, node: node.into(), ..WireOp::default() }
            }
            Op::AdvanceToEvent { within_us } => {
                WireOp { kind: kind::ADVANCE_TO_EVENT, time_us: within_us, ..WireOp::default() }
            }
            Op::Time => WireOp { kind: kind::TIME, ..WireOp::default() },
            Op::Journal { from, max } => {
                WireOp { kind: kind::JOURNAL, value: max, time_us: from, ..WireOp::default() }
            }
            Op::Follow { plc, offset, len, keep } => {
                let node = match keep {
                    Keep::InJournal => 0,
                    Keep::ForOnlookers => 1,
                };
                WireOp { kind: kind::FOLLOW, plc, node, offset, value: len, ..WireOp::default() }
            }
            Op::IsRecorded { plc, offset } => {
                WireOp { kind: kind::IS_RECORDED, plc, offset, ..WireOp::default() }
            }
            Op::Changes { from, max } => {
                WireOp { kind: kind::CHANGES, value: max, time_us: from, ..WireOp::default() }
            }
            Op::Force { plc, offset, width, value } => {
                WireOp { value, ..register(kind::FORCE, plc, offset, width) }
            }
            Op::Unforce { plc, offset, width } => register(kind::UNFORCE, plc, offset, width),
            Op::Forces => WireOp { kind: kind::FORCES, ..WireOp::default() },
            Op::FaultAdd { fault } => fault::encode(&fault),
            Op::FaultList => WireOp { kind: kind::FAULT_LIST, ..WireOp::default() },
            Op::FaultClear { id } => {
                let value = id.map_or(0, |id| u32::from(id.get()));
                WireOp { kind: kind::FAULT_CLEAR, value, ..WireOp::default() }
            }
            Op::Board { plc } => WireOp { kind: kind::BOARD, plc, ..WireOp::default() },
            Op::SetBoard { plc, setting } => {
                let (offset, value) = setting.numbers();
                WireOp { kind: kind::SET_BOARD, plc, offset, value, ..WireOp::default() }
            }
            Op::Findings => WireOp { kind: kind::FINDINGS, ..WireOp::default() },
            Op::ClearFindings => WireOp { kind: kind::CLEAR_FINDINGS, ..WireOp::default() },
            Op::Buses => WireOp { kind: kind::BUSES, ..WireOp::default() },
            Op::Scene => WireOp { kind: kind::SCENE, ..WireOp::default() },
            Op::Drives => WireOp { kind: kind::DRIVES, ..WireOp::default() },
            Op::Drive { drive } => WireOp { kind: kind::DRIVE, plc: drive, ..WireOp::default() },
            Op::SetParameter { drive, number, value } => WireOp {
                kind: kind::SET_PARAMETER,
                plc: drive,
                node: number,
                time_us: value as u64,
                ..WireOp::default()
            },
            Op::DoorOpen { bus, door } => {
                WireOp { kind: kind::DOOR_OPEN, plc: bus, ..door::encode(Some(door)) }
            }
            Op::DoorClose { bus, door } => WireOp { kind: kind::DOOR_CLOSE, plc: bus, ..door::encode(door) },
            Op::BusSend { bus, frame } => {
                let (offset, length, time_us) = frame.map_or((0, 0, 0), |frame| frame.numbers());
                let (width, node) = (u16::from(frame.is_some()), length.into());
                WireOp { kind: kind::BUS_SEND, plc: bus, width, node, offset, time_us, ..WireOp::default() }
            }
            Op::Save => WireOp { kind: kind::SAVE, ..WireOp::default() },
            Op::Forget { number } => WireOp { kind: kind::FORGET, value: number, ..WireOp::default() },
            Op::ReadSaved { number, from } => {
                WireOp { kind: kind::READ_SAVED, value: number, offset: from, ..WireOp::default() }
            }
            Op::BringSaved { at, count, bytes } => {
                let (value, second, time_us) = words_of(bytes);
                let wire =
                    WireOp { kind: kind::BRING_SAVED, node: count.into(), offset: at, ..WireOp::default() };
                WireOp { value, second, time_us, ..wire }
            }
            Op::Restore { detached } => {
                WireOp { kind: kind::RESTORE, node: detached.into(), ..WireOp::default() }
            }
            Op::BackTo { number, detached } => {
                WireOp { kind: kind::BACK_TO, node: detached.into(), value: number, ..WireOp::default() }
            }
            Op::Back { us, detached } => {
                WireOp { kind: kind::BACK, node: detached.into(), time_us: us, ..WireOp::default() }
            }
            Op::BackUntil { any, detached } => WireOp {
                kind: kind::BACK_UNTIL,
                node: detached.into(),
                value: any.into(),
                ..WireOp::default()
            },
            Op::Info => WireOp { kind: kind::INFO, ..WireOp::default() },
            Op::Stop => WireOp { kind: kind::STOP, ..WireOp::default() },
        }
    }
}

impl TryFrom<WireOp> for Op {
    type Error = BadField;

    fn try_from(wire: WireOp) -> Result<Self, BadField> {
        let WireOp { kind, plc, offset, value, second, time_us, .. } = wire;
        let width = || width_from_code(wire.width).ok_or(BadField::new("the width", wire.width));
        let op = match kind {
            kind::PEEK => Op::Peek { plc, offset, width: width()? },
            kind::POKE => Op::Poke { plc, offset, width: width()?, value },
            kind::COMPARE_EXCHANGE => {
                Op::CompareExchange { plc, offset, width: width()?, current: second, new: value }
            }
            kind::READ_RANGE => Op::ReadRange { plc, offset, len: value },
            kind::WAIT => Op::Wait { plc, offset, width: width()?, mask: second, value, within_us: time_us },
            kind::CONDITION => {
                let compare = Compare::ALL.get(usize::from(wire.node % SIGNED)).copied();
                let compare = compare.ok_or(BadField::new("the comparison", wire.node))?;
                let test = Test { mask: second, compare, is_signed: wire.node >= SIGNED, value };
                Op::Condition { plc, offset, width: width()?, test }
            }
            kind::WAIT_FOR => Op::WaitFor { any: value != 0, within_us: time_us },
            kind::ADVANCE => Op::Advance { us: time_us },
            kind::ADVANCE_TO_SYNC => Op::AdvanceToSync {
                plc,
                node: u8::try_from(wire.node).map_err(|_| BadField::new("the node", wire.node))?,
            },
            kind::ADVANCE_TO_EVENT => Op::AdvanceToEvent { within_us: time_us },
            kind::TIME => Op::Time,
            kind::JOURNAL => Op::Journal { from: time_us, max: value },
            kind::FOLLOW => {
                let keep = match wire.node {
                    0 => Keep::InJournal,
                    1 => Keep::ForOnlookers,
                    other => return Err(BadField::new("the node", other)),
                };
                Op::Follow { plc, offset, len: value, keep }
            }
            kind::IS_RECORDED => Op::IsRecorded { plc, offset },
            kind::CHANGES => Op::Changes { from: time_us, max: value },
            kind::FORCE => Op::Force { plc, offset, width: width()?, value },
            kind::UNFORCE => Op::Unforce { plc, offset, width: width()? },
            kind::FORCES => Op::Forces,
            kind::FAULT_ADD => {
                let bad = |number| BadField::new("the fault", number);
                Op::FaultAdd { fault: fault::decode(&wire).map_err(bad)? }
            }
            kind::FAULT_LIST => Op::FaultList,
            kind::FAULT_CLEAR => {
                let id = u16::try_from(value).map_err(|_| BadField::new("the fault", value))?;
                Op::FaultClear { id: NonZeroU16::new(id) }
            }
            kind::BOARD => Op::Board { plc },
            kind::SET_BOARD => Op::SetBoard {
                plc,
                setting: BoardSetting::from_numbers(offset, value)
                    .ok_or(BadField::new("the setting", offset))?,
            },
            kind::FINDINGS => Op::Findings,
            kind::CLEAR_FINDINGS => Op::ClearFindings,
            kind::BUSES => Op::Buses,
            kind::SCENE => Op::Scene,
            kind::DRIVES => Op::Drives,
            kind::DRIVE => Op::Drive { drive: plc },
            kind::SET_PARAMETER => Op::SetParameter { drive: plc, number: wire.node, value: time_us as i64 },
            kind::DOOR_OPEN => {
                let door = door::decode(&wire)?.ok_or(BadField::new("the door", wire.width))?;
                Op::DoorOpen { bus: plc, door }
            }
            kind::DOOR_CLOSE => Op::DoorClose { bus: plc, door: door::decode(&wire)? },
            kind::BUS_SEND => {
                let length = u8::try_from(wire.node).ok();
                let frame = length.and_then(|length| Frame::of_numbers(offset, length, time_us));
                let frame = frame.ok_or(BadField::new("the length", wire.node))?;
                Op::BusSend { bus: plc, frame: (wire.width != 0).then_some(frame) }
            }
            kind::SAVE => Op::Save,
            kind::FORGET => Op::Forget { number: value },
            kind::READ_SAVED => Op::ReadSaved { number: value, from: offset },
            kind::BRING_SAVED => {
                let bytes = bytes_of(value, second, time_us);
                let count = u8::try_from(wire.node).ok().filter(|count| usize::from(*count) <= bytes.len());
                let count = count.ok_or(BadField::new("the node", wire.node))?;
                if bytes.iter().skip(count.into()).any(|byte| *byte != 0) {
                    return Err(BadField::new("an unused field", kind));
                }
                Op::BringSaved { at: offset, count, bytes }
            }
            kind::RESTORE => Op::Restore { detached: wire.node != 0 },
            kind::BACK_TO => Op::BackTo { number: value, detached: wire.node != 0 },
            kind::BACK => Op::Back { us: time_us, detached: wire.node != 0 },
            kind::BACK_UNTIL => Op::BackUntil { any: value != 0, detached: wire.node != 0 },
            kind::INFO => Op::Info,
            kind::STOP => Op::Stop,
            _ => return Err(BadField::new("the kind", kind)),
        };
        // A field may get a meaning in a later version, so this version must not ignore it.
        if WireOp::from(&op) != wire {
            return Err(BadField::new("an unused field", kind));
        }
        Ok(op)
    }
}

/// 16 contiguous bytes of an operation.
fn words_of(bytes: [u8; 16]) -> (u32, u32, u64) {
    let [value, second] = [0, 4].map(|at| bytes[at..at + 4].try_into().map_or(0, u32::from_ne_bytes));
    (value, second, bytes[8..].try_into().map_or(0, u64::from_ne_bytes))
}

/// Inverse of [`words_of`].
fn bytes_of(value: u32, second: u32, time_us: u64) -> [u8; 16] {
    let mut bytes = [0; 16];
    bytes[..4].copy_from_slice(&value.to_ne_bytes());
    bytes[4..8].copy_from_slice(&second.to_ne_bytes());
    bytes[8..].copy_from_slice(&time_us.to_ne_bytes());
    bytes
}

/// Added to the number of a signed comparison.
const SIGNED: u16 = 256;

/// A comparison on the wire.
fn compare_code(test: Test) -> u16 {
    let number = Compare::ALL.iter().position(|compare| *compare == test.compare).unwrap_or_default();
    number as u16 + if test.is_signed { SIGNED } else { 0 }
}

/// The width on the wire: its length in bytes.
pub(super) const fn width_code(width: Width) -> u16 {
    width.bytes() as u16
}

/// Inverse of [`width_code`].
pub(super) const fn width_from_code(code: u16) -> Option<Width> {
    Width::of_bytes(code as u32)
}
