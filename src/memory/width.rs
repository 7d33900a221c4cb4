//! Access widths, and addresses written the way a PLC programmer writes them.

use core::fmt;

/// The width of one register access.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Width {
    /// 8 bits: BYTE, SINT, USINT, `%MB`.
    Byte,
    /// 16 bits: WORD, INT, UINT, `%MW`.
    Word,
    /// 32 bits: DWORD, DINT, UDINT, `%MD`.
    Dword,
}

impl Width {
    /// Length in bytes: 1, 2 or 4. It is also the alignment the address needs.
    pub const fn bytes(self) -> u32 {
        match self {
            Width::Byte => 1,
            Width::Word => 2,
            Width::Dword => 4,
        }
    }

    /// The largest value that fits.
    pub const fn max_value(self) -> u32 {
        u32::MAX >> (32 - 8 * self.bytes())
    }

    /// The IEC type name.
    pub const fn iec_name(self) -> &'static str {
        match self {
            Width::Byte => "BYTE",
            Width::Word => "WORD",
            Width::Dword => "DWORD",
        }
    }

    /// The address of a register of this width that starts at byte `offset` of segment 3.
    pub const fn at(self, offset: u32) -> Address {
        Address { offset, width: self }
    }

    /// The address rule of this width, for error messages.
    pub(super) const fn alignment_rule(self) -> &'static str {
        match self {
            Width::Byte => "a BYTE may have any address",
            Width::Word => "a WORD needs an even address",
            Width::Dword => "a DWORD needs an address divisible by 4",
        }
    }
}

impl fmt::Display for Width {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.iec_name())
    }
}

/// A register's place in segment 3; prints as `%MB3.n`, `%MW3.n` or `%MD3.n`.
///
/// The number is always the byte offset, whatever the width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// Byte offset in segment 3.
    pub offset: u32,
    /// Width of the access.
    pub width: Width,
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let letter = match self.width {
            Width::Byte => 'B',
            Width::Word => 'W',
            Width::Dword => 'D',
        };
        write!(f, "%M{letter}3.{}", self.offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_print_as_the_programmer_writes_them() {
        assert_eq!(Width::Byte.at(3_262_143).to_string(), "%MB3.3262143");
        assert_eq!(Width::Word.at(200_000).to_string(), "%MW3.200000");
        assert_eq!(Width::Dword.at(80_000).to_string(), "%MD3.80000");
    }

    #[test]
    fn largest_values() {
        assert_eq!(Width::Byte.max_value(), 0xFF);
        assert_eq!(Width::Word.max_value(), 0xFFFF);
        assert_eq!(Width::Dword.max_value(), 0xFFFF_FFFF);
    }
}
