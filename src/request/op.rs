//! The operations, as the table in `ops.rs` declares them.

use super::Code;
use super::forms::{self, KeepForm, TestForm};
use super::ops::ops;
use super::out_of_range::OutOfRange;
use crate::can::Frame;
use crate::door::DoorSpec;
use crate::fault::Fault;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::Keep;
use crate::layout::Test;
use crate::memory::Width;
use crate::memory::header::BoardSetting;
use core::num::NonZeroU16;
use serde::{Deserialize, Serialize};

/// Maximum number of operations in a request.
pub const MAX_OPS: usize = 256;
/// Longest [`Op::ReadRange`] in bytes.
pub const MAX_RANGE: u32 = 65_536;

/// Divides the `len` bytes from `offset` on into ranges that one operation can name. Each range consists of its first
/// byte and its length.
#[cfg(feature = "script")]
pub(crate) fn ranges(offset: u32, len: u32) -> impl Iterator<Item = (u32, u32)> {
    let starts = (0..len).step_by(MAX_RANGE as usize);
    starts.map(move |start| (offset + start, MAX_RANGE.min(len - start)))
}

/// Maximum number of records in the answer to an [`Op::Journal`], and of changes in the answer to an [`Op::Changes`].
pub const MAX_RECORDS: u32 = 1024;
/// Maximum number of [`Op::Condition`]s for an [`Op::WaitFor`]. The answer has one bit for each condition.
pub const MAX_CONDITIONS: usize = 32;
/// Maximum advance of the clock in an operation: 24 h of emulated time, in microseconds.
pub const MAX_ADVANCE_US: u64 = 24 * 3_600_000_000;
/// Highest speed of a real-time clock: emulated time per real time x 1000.
pub const MAX_SPEED: u32 = 1_000_000;

/// The kind of change that an operation makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Class {
    /// Changes nothing in the plant. So it may be executed at any time, even before an earlier request.
    Looks,
    /// The operation only stores a register.
    Stores,
    /// Changes the plant in another way.
    Acts,
    /// Advances the clock, or is part of an operation that advances it.
    Advances,
    /// Returns the plant to an earlier moment, or to another state from a file.
    Travels,
    /// The operation changes something outside the plant: doors, kept snapshots, the speed of the clock.
    Manages,
    /// Ends the emulator, in any state of the plant.
    Ends,
}

/// Declares [`Op`], with the class of each operation.
macro_rules! declare {
    ($(
        $(#[$doc:meta])*
        $op:ident = $number:literal, $name:ident, $class:ident -> $reply:ident
        $({$(
            $(#[$field_doc:meta])*
            $field:ident: $type:ty $([..=$most:ident, $code:ident])? => $($column:ident)+
        ),+ $(,)?})?
    ),+ $(,)?) => {
        /// An operation of a request.
        ///
        /// `plc` is the PLC's number in the instance, from 0. `offset` is a byte offset in the image file of this PLC;
        /// the device's [`spaces`](crate::layout::DeviceLayout::spaces) map it to an address. It must suit the width.
        /// Times are emulated time in microseconds.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case", deny_unknown_fields)]
        pub enum Op {
            $(
                $(#[$doc])*
                ///
                #[doc = concat!("Answered by [`Reply::", stringify!($reply), "`](super::Reply::", stringify!($reply), ").")]
                $op $({$(
                    $(#[$field_doc])*
                    $(#[doc = concat!("\n\nAt most [`", stringify!($most), "`].")])?
                    $field: $type,
                )+})?,
            )+
        }

        impl Op {
            /// Returns the kind of change that the operation makes.
            pub(crate) fn class(&self) -> Class {
                match self {
                    $(Op::$op { .. } => Class::$class,)+
                }
            }

            /// Checks the fields that the table limits.
            ///
            /// # Errors
            /// The first field with a value out of range.
            pub(crate) fn check_ranges(&self) -> Result<(), OutOfRange> {
                match self {
                    $(Op::$op $({ $($field),+ })? => {
                        $($(
                            let _ = $field;
                            $(OutOfRange::check([stringify!($name), stringify!($field)], *$field, $most, Code::$code)?;)?
                        )+)?
                    })+
                }
                Ok(())
            }
        }
    };
}

ops!(declare);

impl Op {
    /// True if the operation changes nothing in the plant. It may then be executed at any time, even before an earlier
    /// request.
    pub fn only_looks(&self) -> bool {
        matches!(self.class(), Class::Looks | Class::Ends)
    }

    /// True if the operation changes the plant in another way than by advancing the clock.
    pub(crate) fn acts(&self) -> bool {
        matches!(self.class(), Class::Stores | Class::Acts)
    }

    /// Maximum emulated time that this operation waits, in microseconds.
    pub fn waits_us(&self) -> u64 {
        match self {
            Op::Wait { within_us, .. } | Op::WaitFor { within_us, .. } => (*within_us).min(MAX_ADVANCE_US),
            _ => 0,
        }
    }

    /// True if the operation returns to an earlier moment. The emulator may compute a long time again for it, and answers no
    /// other request during this.
    #[cfg(feature = "cli")]
    pub(crate) fn travels(&self) -> bool {
        self.class() == Class::Travels
    }

    /// Maximum emulated time by which this operation advances the clock, in microseconds, if it is known.
    #[cfg(feature = "cli")]
    pub(crate) fn advances_us(&self) -> u64 {
        match self {
            Op::Advance { us } | Op::AdvanceToEvent { within_us: us } => (*us).min(MAX_ADVANCE_US),
            _ => self.waits_us(),
        }
    }

    /// Returns the operations that send a snapshot file to the emulator, in order.
    pub fn bring(file: &[u8]) -> impl Iterator<Item = Op> {
        let parts = file.chunks(FilePart::MAX).filter_map(FilePart::new);
        (0..).step_by(FilePart::MAX).zip(parts).map(|(at, part)| Op::BringSaved { at, part })
    }
}

/// A part of a snapshot file in an operation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "Vec<u8>", into = "Vec<u8>")]
pub struct FilePart {
    count: u8,
    /// 0 from `count` on.
    bytes: [u8; Self::MAX],
}

impl FilePart {
    /// Maximum number of bytes.
    pub const MAX: usize = 16;

    /// Returns the part with these bytes; `None` if there are more than [`FilePart::MAX`].
    #[must_use]
    pub fn new(part: &[u8]) -> Option<Self> {
        let mut bytes = [0; Self::MAX];
        bytes.get_mut(..part.len())?.copy_from_slice(part);
        Some(Self { count: part.len() as u8, bytes })
    }

    /// Returns the bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.count.into()).unwrap_or(&self.bytes)
    }
}

impl From<FilePart> for Vec<u8> {
    fn from(part: FilePart) -> Self {
        part.bytes().to_vec()
    }
}

impl TryFrom<Vec<u8>> for FilePart {
    type Error = &'static str;

    fn try_from(part: Vec<u8>) -> Result<Self, Self::Error> {
        FilePart::new(&part).ok_or("a part has 16 bytes at most")
    }
}
