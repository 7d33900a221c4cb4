//! Registers of a structure and their data types.

use super::{Meaning, Provenance};
use core::fmt;

/// A register, or an array of registers.
#[derive(Debug)]
pub struct Register {
    /// Name of the sub-structure to which the register belongs, for example `a_DATA_PARAMETER`; empty without a
    /// sub-structure.
    pub group: &'static str,
    /// Type name of the sub-structure; empty without a sub-structure.
    pub group_type: &'static str,
    /// Source of the sub-structure's type name.
    pub group_type_from: Provenance,
    /// Size of a sub-structure in bytes; 0 without a sub-structure.
    pub group_bytes: u32,
    /// The vendor's name, for example `w_CPU_CONTROL`.
    pub name: &'static str,
    /// Data type of the register.
    pub ty: RegType,
    /// Offset of the (first) register in the structure, in bytes.
    pub offset: u32,
    /// Array bounds of the sub-structure, followed by the array bounds of the register itself; at most two.
    pub dims: &'static [Dim],
    /// Number of `dims` that are dimensions of the sub-structure.
    pub group_dims: usize,
    /// The vendor's name for the type of the whole array; empty if this name follows from the element's name and the
    /// number of elements.
    pub array_type: &'static str,
    /// Another name of the register in the vendor's manual; empty if there is none. The name is accepted as input, but
    /// never shown.
    pub also: &'static str,
    /// Writer of the register.
    pub owner: Owner,
    /// Value after power-on, in two's complement of the register's width.
    pub reset: u32,
    /// True if the manual reserves the register.
    pub reserved: bool,
    /// Purpose of the register.
    pub doc: &'static str,
    /// Pages of the manual. For a register of a sub-structure, these are the pages for its use in this structure.
    pub page: &'static str,
    /// Meanings of the values; `None` for plain numbers.
    pub meaning: Option<&'static Meaning>,
    /// Source of the name.
    pub name_from: Provenance,
    /// Source of the offset.
    pub offset_from: Provenance,
    /// Source of the data type.
    pub type_from: Provenance,
    /// Source of the owner.
    pub owner_from: Provenance,
    /// Source of the reset value.
    pub reset_from: Provenance,
}

impl Register {
    /// Returns the facts about the register itself, each with its source. The meaning is not included, because it has
    /// its own sources.
    #[must_use]
    pub const fn facts(&self) -> [(&'static str, Provenance); 5] {
        [
            ("name", self.name_from),
            ("offset", self.offset_from),
            ("type", self.type_from),
            ("owner", self.owner_from),
            ("reset", self.reset_from),
        ]
    }

    /// Returns `manual`, or the inferred facts with their decisions: `offset D-02, reset D-320`.
    #[must_use]
    pub fn provenance(&self) -> String {
        Provenance::summary(&self.facts())
    }
}

/// A dimension of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dim {
    /// Number of elements. Indices begin at 0.
    pub count: u16,
    /// Number of used elements. The elements from this index on are reserved.
    pub used: u16,
    /// Number of bytes from an element to the next.
    pub stride: u32,
}

/// The writer of a register. All participants may read it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Owner {
    /// The application (a PLC program) writes the register.
    Plc,
    /// The firmware of the device writes the register.
    Firmware,
    /// Both sides write the register, in a handshake.
    Both,
}

impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Owner::Plc => "PLC",
            Owner::Firmware => "firmware",
            Owner::Both => "both",
        })
    }
}

/// The elementary data types.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RegType {
    /// 8 bits.
    Byte,
    /// 16 bits.
    Word,
    /// 32 bits.
    Dword,
    /// 8 bits, signed.
    Sint,
    /// 16 bits, signed.
    Int,
    /// 32 bits, signed.
    Dint,
    /// 8 bits, unsigned.
    Usint,
    /// 16 bits, unsigned.
    Uint,
    /// 32 bits, unsigned.
    Udint,
}

impl RegType {
    /// Returns the width in bytes: 1, 2 or 4. It is also the alignment.
    #[must_use]
    pub const fn width(self) -> u32 {
        match self {
            RegType::Byte | RegType::Sint | RegType::Usint => 1,
            RegType::Word | RegType::Int | RegType::Uint => 2,
            RegType::Dword | RegType::Dint | RegType::Udint => 4,
        }
    }

    /// Returns the name in IEC 61131-3.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            RegType::Byte => "BYTE",
            RegType::Word => "WORD",
            RegType::Dword => "DWORD",
            RegType::Sint => "SINT",
            RegType::Int => "INT",
            RegType::Dint => "DINT",
            RegType::Usint => "USINT",
            RegType::Uint => "UINT",
            RegType::Udint => "UDINT",
        }
    }

    /// True if the type has negative numbers.
    #[must_use]
    pub const fn is_signed(self) -> bool {
        matches!(self, RegType::Sint | RegType::Int | RegType::Dint)
    }

    /// Returns the type of a bit pattern of this width.
    pub(crate) const fn pattern(self) -> Self {
        match self {
            RegType::Byte | RegType::Sint | RegType::Usint => RegType::Byte,
            RegType::Word | RegType::Int | RegType::Uint => RegType::Word,
            RegType::Dword | RegType::Dint | RegType::Udint => RegType::Dword,
        }
    }

    /// Largest value as a bit pattern.
    #[must_use]
    pub const fn mask(self) -> u32 {
        u32::MAX >> (32 - 8 * self.width())
    }

    /// Returns the number for `value`, which is a bit pattern of this type.
    #[must_use]
    pub const fn number(self, value: u32) -> i64 {
        match self {
            RegType::Sint => value as i8 as i64,
            RegType::Int => value as i16 as i64,
            RegType::Dint => value as i32 as i64,
            _ => (value & self.mask()) as i64,
        }
    }
}

impl fmt::Display for RegType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
