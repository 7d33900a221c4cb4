//! What a request can be refused for. These errors travel over the wire with all their fields.

use super::op::{MAX_ADVANCE_US, MAX_OPS, MAX_RANGE};
use super::wire::MAX_REPLY_BYTES;
use crate::fault::Refusal;
use crate::layout::flags;
use crate::memory::{Address, Width};

/// Why the emulator refused an operation: what, where, and what would be right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChannelError {
    /// No register area covers the register.
    #[error("{address}: {}", flags::not_covered(*.address))]
    Unmapped {
        /// The refused access.
        address: Address,
    },
    /// A range leaves the register areas.
    #[error("{}, {len} bytes: no register area covers {}; read each area for itself", Address::byte(*.offset), Address::byte(*.hole))]
    RangeUnmapped {
        /// First byte of the range.
        offset: u32,
        /// Its length in bytes.
        len: u32,
        /// The first byte that is not covered.
        hole: u32,
    },
    /// The address does not suit the width.
    #[error("{address}: {}", .address.width().alignment_rule())]
    Misaligned {
        /// The refused access.
        address: Address,
    },
    /// A range is longer than one operation may read.
    #[error("{}: a range of {len} bytes is too long, at most {MAX_RANGE} per operation", Address::byte(*.offset))]
    RangeTooLong {
        /// First byte of the range.
        offset: u32,
        /// Its length in bytes.
        len: u32,
    },
    /// The replies of one request together are too long.
    #[error(
        "the replies of one request may have {MAX_REPLY_BYTES} bytes in all; spread the ranges over several requests"
    )]
    ReplyTooLong,
    /// The value, mask or comparison value has more bits than the register.
    #[error("{address}: 16#{value:X} does not fit, a {} holds at most 16#{:X}", .address.width(), .address.width().max_value())]
    ValueTooWide {
        /// The register.
        address: Address,
        /// The refused value.
        value: u32,
    },
    /// The awaited value has bits outside the mask.
    #[error(
        "{address}: 16#{value:X} can never match under the mask 16#{mask:X}; clear the bits outside the mask"
    )]
    NeverMatches {
        /// The register.
        address: Address,
        /// The bits that count.
        mask: u32,
        /// The value awaited.
        value: u32,
    },
    /// The instance has no PLC of that number.
    #[error("PLC {plc} does not exist; the instance has {count}, numbered from 0")]
    UnknownPlc {
        /// The number asked for.
        plc: u16,
        /// Number of PLCs in the instance.
        count: u16,
    },
    /// The time cannot be stepped.
    #[error(
        "the clock runs in real time; time can be advanced in stepped mode only (use a wait, or start the instance stepped)"
    )]
    ClockIsRealTime,
    /// The register did not match in time.
    #[error("{address} did not become the awaited value in time; at {time_us} us it is 16#{:0digits$X}", .last, digits = digits(.address.width()))]
    WaitTimedOut {
        /// The register.
        address: Address,
        /// Its last value.
        last: u32,
        /// Emulated time when the wait ended, in microseconds.
        time_us: u64,
    },
    /// Nobody sends SYNC on that bus, or there is no such bus.
    #[error("PLC {plc}: nobody sends SYNC on the bus of CANsync node {node}")]
    NoSync {
        /// Number of the PLC.
        plc: u16,
        /// The node asked for.
        node: u8,
    },
    /// The request has too many operations.
    #[error("{count} operations in one request are too many, at most {MAX_OPS}")]
    TooManyOperations {
        /// Number of operations.
        count: u32,
    },
    /// The operation's bytes mean nothing.
    #[error(
        "operation {index} of the request is malformed ({field} is 16#{value:X}); do client and emulator have the same version?"
    )]
    Malformed {
        /// Position of the operation, from 0.
        index: u16,
        /// The field that has no meaning.
        field: Field,
        /// Its content.
        value: u32,
    },
    /// The time to let pass is too long.
    #[error("{us} us are too long, at most {MAX_ADVANCE_US} us (24 h of emulated time) per operation")]
    AdvanceTooLong {
        /// The time asked for, in microseconds.
        us: u64,
    },
    /// Only a part of a register shall be forced, or several registers.
    #[error("{asked}: only a whole register can be forced, here {right}")]
    NotWhole {
        /// What was to be forced.
        asked: Address,
        /// The register there.
        right: Address,
    },
    /// Too many registers are forced.
    #[error("{count} registers are forced, which is all that can be; unforce one first")]
    TooManyForces {
        /// Number of forced registers.
        count: u32,
    },
    /// The register is not forced.
    #[error("{address} is not forced")]
    NotForced {
        /// The register.
        address: Address,
    },
    /// No program can be started or stopped on that PLC.
    #[error("PLC {plc}: a start or stop needs a loaded program, the switch at RUN and the supply on")]
    StartRefused {
        /// Number of the PLC.
        plc: u16,
    },
    /// A fault that cannot be added or cleared.
    #[error(transparent)]
    Fault(Refusal),
    /// The emulator is ending.
    #[error("the emulator is shutting down")]
    ShuttingDown,
}

/// A field of an operation on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Which operation it is.
    Kind,
    /// The access width.
    Width,
    /// The CANsync node.
    Node,
    /// The setting of a board.
    Board,
    /// A field this operation does not use, which must be zero.
    Unused,
    /// The description of a fault.
    Fault,
}

impl core::fmt::Display for Field {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Field::Kind => "the kind",
            Field::Width => "the width",
            Field::Node => "the node",
            Field::Board => "the setting",
            Field::Unused => "an unused field",
            Field::Fault => "the fault",
        })
    }
}

/// Hexadecimal digits of a register.
fn digits(width: Width) -> usize {
    width.bytes() as usize * 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_name_the_address_and_what_would_be_right() {
        let word = Width::Word.at(200_001);
        let text = |e: ChannelError| e.to_string();
        assert_eq!(
            text(ChannelError::Misaligned { address: word }),
            "%MW3.200001: a WORD needs an even address"
        );
        assert_eq!(
            text(ChannelError::ValueTooWide { address: Width::Byte.at(9), value: 0x1FF }),
            "%MB3.9: 16#1FF does not fit, a BYTE holds at most 16#FF"
        );
        assert_eq!(
            text(ChannelError::WaitTimedOut { address: Width::Word.at(4), last: 0x43, time_us: 8_000 }),
            "%MW3.4 did not become the awaited value in time; at 8000 us it is 16#0043"
        );
        assert_eq!(
            text(ChannelError::UnknownPlc { plc: 2, count: 2 }),
            "PLC 2 does not exist; the instance has 2, numbered from 0"
        );
        assert_eq!(
            text(ChannelError::TooManyOperations { count: 257 }),
            "257 operations in one request are too many, at most 256"
        );
    }
}
