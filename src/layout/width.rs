//! Access widths.

use super::descriptor::RegType;
use core::fmt;

/// The width of one register access.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "emulator", derive(serde::Serialize, serde::Deserialize))]
pub enum Width {
    /// 8 bits: BYTE, SINT, USINT, `%MB`.
    Byte,
    /// 16 bits: WORD, INT, UINT, `%MW`.
    Word,
    /// 32 bits: DWORD, DINT, UDINT, `%MD`.
    Dword,
}

impl Width {
    /// Returns the length in bytes: 1, 2 or 4. The address must be divisible by it.
    pub const fn bytes(self) -> u32 {
        match self {
            Width::Byte => 1,
            Width::Word => 2,
            Width::Dword => 4,
        }
    }

    /// Returns the largest value that fits.
    pub const fn max_value(self) -> u32 {
        u32::MAX >> (32 - 8 * self.bytes())
    }

    /// Returns the IEC type name.
    pub const fn iec_name(self) -> &'static str {
        match self {
            Width::Byte => "BYTE",
            Width::Word => "WORD",
            Width::Dword => "DWORD",
        }
    }

    /// Returns the letter of the width in an address: `W` of `%MW3.200000`.
    #[must_use]
    pub const fn letter(self) -> char {
        match self {
            Width::Byte => 'B',
            Width::Word => 'W',
            Width::Dword => 'D',
        }
    }

    /// Returns the width with the given number of bytes, if there is one.
    pub(crate) const fn of_bytes(bytes: u32) -> Option<Self> {
        match bytes {
            1 => Some(Width::Byte),
            2 => Some(Width::Word),
            4 => Some(Width::Dword),
            _ => None,
        }
    }

    /// Returns the unsigned type of this width, for a register with an unknown type.
    #[cfg(feature = "emulator")]
    pub(crate) const fn bits(self) -> RegType {
        match self {
            Width::Byte => RegType::Byte,
            Width::Word => RegType::Word,
            Width::Dword => RegType::Dword,
        }
    }

    /// Returns the access that a register of this type needs.
    #[must_use]
    pub const fn of(ty: RegType) -> Self {
        match ty.width() {
            1 => Width::Byte,
            2 => Width::Word,
            _ => Width::Dword,
        }
    }

    /// Returns the address rule of this width, for error messages.
    pub(crate) const fn alignment_rule(self) -> &'static str {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn largest_values() {
        assert_eq!(Width::Byte.max_value(), 0xFF);
        assert_eq!(Width::Word.max_value(), 0xFFFF);
        assert_eq!(Width::Dword.max_value(), 0xFFFF_FFFF);
    }
}
