//! Reasons for aborting a transfer.

use core::fmt;

/// Reason for aborting a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Abort {
    /// The toggle bit has not changed.
    Toggle,
    /// No answer arrived within the time.
    TimeOut,
    /// The command is unknown, or no transfer in progress can have this command.
    Command,
    /// The node is out of memory.
    Memory,
    /// An attempt to write a read-only entry.
    ReadOnly,
    /// The object does not exist.
    NoObject,
    /// The sub-index does not exist.
    NoSub,
    /// The value is longer than the entry.
    TooLong,
    /// The value is shorter than the entry.
    TooShort,
    /// The entry does not accept the value.
    Value,
}

impl Abort {
    /// Returns the code on the wire.
    #[must_use]
    pub(crate) const fn code(self) -> u32 {
        match self {
            Abort::Toggle => 0x0503_0000,
            Abort::TimeOut => 0x0504_0000,
            Abort::Command => 0x0504_0001,
            Abort::Memory => 0x0504_0005,
            Abort::ReadOnly => 0x0601_0002,
            Abort::NoObject => 0x0602_0000,
            Abort::TooLong => 0x0607_0012,
            Abort::TooShort => 0x0607_0013,
            Abort::NoSub => 0x0609_0011,
            Abort::Value => 0x0609_0030,
        }
    }
}

impl fmt::Display for Abort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "abort 16#{:08X}", self.code())
    }
}
