//! Requests and replies as fixed-width integers.
//!
//! A request is a slice of [`WireOp`], one for each operation. A reply is a slice of [`Block`]: for each operation a
//! head block, followed by the blocks of its data. The other side may be hostile or of another build, so the decoder
//! must accept every bit pattern, and return an error for invalid ones. Therefore the format has only integers, no
//! `bool`, `char` or enum. Both sides are on the same machine, so integers have the byte order of this machine.
//!
//! `docs/reference/channel.md` describes the format for other languages. The type names contain its version: iceoryx2
//! refuses a client with other type names or sizes.

mod columns;
mod content;
mod door;
mod fault;
mod findings;
mod forces;
#[cfg(test)]
mod format_tests;
mod journal;
#[cfg(test)]
mod json_tests;
mod reply;
mod serde_types;
#[cfg(test)]
mod table_tests;
#[cfg(test)]
mod tests;

pub(crate) use reply::{DecodeError, ReplyBuffer, decode};

use crate::memory::Width;
use crate::request::ops::ops;
use crate::request::{MAX_OPS, MAX_RANGE, Op};
use columns::InColumns;
use iceoryx2::prelude::ZeroCopySend;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// Version of the format. Increment it, here and in the names of [`WireOp`] and [`Block`], after a change of
/// an operation, of a reply, or of a type in a reply that only this program can decode (`serde_types.rs`).
pub(crate) const WIRE_VERSION: u32 = 5;
/// Longest reply in bytes: four full ranges and some space for other replies.
pub(crate) const MAX_REPLY_BYTES: usize = 4 * MAX_RANGE as usize + 64 * MAX_OPS;
/// Longest reply in blocks.
pub(crate) const MAX_REPLY_BLOCKS: usize = MAX_REPLY_BYTES / size_of::<Block>();

/// One operation of a request. The table of operations (`ops!`) lists the columns of each field, and `columns.rs`
/// defines their content.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout, ZeroCopySend,
)]
#[type_name("commram.channel.WireOp.v5")]
#[repr(C)]
pub struct WireOp {
    /// Number of the operation.
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
    /// Reserved; always zero.
    pub reserved: u32,
    /// Emulated time in microseconds, or number of a record.
    pub time_us: u64,
}

/// A unit of a reply: a head, or 16 bytes of the data that follow a head.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout, ZeroCopySend,
)]
#[type_name("commram.channel.Block.v5")]
#[repr(C)]
pub(crate) struct Block {
    /// Number of the reply.
    pub kind: u16,
    /// Code of an error, number of a history, or whether a comparison held.
    pub code: u16,
    /// Number of data bytes in the blocks that follow this head. The unused bytes of the last block are zero.
    pub data_len: u32,
    /// The reply's number: a value, a time, or the end of the journal.
    pub value: u64,
}

const _: () = assert!(size_of::<WireOp>() == 32 && size_of::<Block>() == 16);

/// A field of an operation, with content that has no meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} is 16#{value:X}")]
pub struct BadField {
    /// Name of the invalid field with an article, for example "the kind".
    pub field: &'static str,
    /// Value of the field in the request or reply.
    pub value: u32,
}

impl BadField {
    fn new(field: &'static str, value: impl Into<u32>) -> Self {
        Self { field, value: value.into() }
    }
}

/// Declares the conversions between operations and their wire format.
macro_rules! codec {
    ($(
        $(#[$doc:meta])*
        $op:ident = $number:literal, $name:ident, $class:ident -> $reply:ident
        $({$(
            $(#[$field_doc:meta])*
            $field:ident: $type:ty $([..=$most:ident, $code:ident])? => $($column:ident)+
        ),+ $(,)?})?
    ),+ $(,)?) => {
        impl From<&Op> for WireOp {
            fn from(op: &Op) -> Self {
                let mut wire = WireOp::default();
                match *op {
                    $(Op::$op $({ $($field),+ })? => {
                        wire.kind = $number;
                        $($(($(wire.$column,)+) = $field.columns();)+)?
                    })+
                }
                wire
            }
        }

        impl TryFrom<WireOp> for Op {
            type Error = BadField;

            fn try_from(wire: WireOp) -> Result<Self, BadField> {
                let op = match wire.kind {
                    $($number => Op::$op $({ $($field: InColumns::of_columns(($(wire.$column,)+))?),+ })?,)+
                    _ => return Err(BadField::new("the kind", wire.kind)),
                };
                // A later version may give an unused field a meaning, so this version refuses an operation
                // with content in an unused field.
                if WireOp::from(&op) != wire {
                    return Err(BadField::new("an unused field", wire.kind));
                }
                Ok(op)
            }
        }
    };
}

ops!(codec);

/// Returns the width on the wire: its length in bytes.
pub(super) const fn width_code(width: Width) -> u16 {
    width.bytes() as u16
}

/// Inverse of [`width_code`].
pub(super) const fn width_from_code(code: u16) -> Option<Width> {
    Width::of_bytes(code as u32)
}
