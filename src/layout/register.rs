//! A register of a device: a descriptor with a place and with indices.

use super::address::Address;
use super::decode;
use super::descriptor::{Area, AreaStructure, Owner, RegType, Register, Role, Structure};
use super::width::Width;
use core::fmt;

/// A register in an area. If the register is an array, this is the element that `index` selects.
#[derive(Clone, Copy)]
pub struct RegisterRef {
    /// Area that contains the register.
    pub area: &'static Area,
    /// The structure's place in the area.
    pub placed: &'static AreaStructure,
    /// Descriptor of the register.
    pub register: &'static Register,
    /// Index for each dimension of the descriptor; 0 for missing dimensions.
    pub index: [u16; 2],
    /// The role of the port of the area, if it is known.
    pub role: Option<Role>,
}

impl RegisterRef {
    /// Returns the structure in the area.
    #[must_use]
    pub const fn structure(&self) -> &'static Structure {
        self.placed.structure
    }

    /// True if the name `area.register` is ambiguous: the role of the port, which is unknown, decides which register it
    /// means.
    #[must_use]
    pub fn is_ambiguous(&self) -> bool {
        let others = self.area.structures.iter().filter(|placed| !placed.shares_role(self.placed));
        let mut twins = others.flat_map(|placed| placed.structure.registers);
        self.role.is_none()
            && twins.any(|twin| twin.has_name_of(self.register) && !twin.lies_like(self.register))
    }

    /// Returns the prefix of the register's name: the area, or the variable if the register is ambiguous.
    #[must_use]
    pub fn front(&self) -> &'static str {
        if self.is_ambiguous() { self.placed.variable } else { self.area.name }
    }

    /// Full name, for example `node2.a_RD_BMARRAY[3][0]`. If the place of a register depends on an unknown role of the
    /// port, the prefix is the variable: `_Master_Slot_G.b_STATREG_RDC1`.
    #[must_use]
    pub fn name(&self) -> String {
        self.to_string()
    }

    /// Returns the name without the area, for example `a_RD_BMARRAY[3][0]`.
    #[must_use]
    pub fn path(&self) -> String {
        Path(self, self.register.name).to_string()
    }

    /// Returns the name without the area, with the second name of the register ([`Register::also`]). `None` if there is no
    /// such name.
    pub(super) fn second_path(&self) -> Option<String> {
        let also = self.register.also;
        (!also.is_empty()).then(|| Path(self, also).to_string())
    }

    /// Returns the register's first byte in the image.
    #[must_use]
    pub fn offset(&self) -> u32 {
        self.area.first + self.offset_in_structure()
    }

    /// Returns the number of the register's first byte in the structure.
    #[must_use]
    pub fn offset_in_structure(&self) -> u32 {
        let elements = self.register.dims.iter().zip(self.index);
        self.register.offset + elements.map(|(dim, index)| dim.stride * u32::from(index)).sum::<u32>()
    }

    /// Returns the address at the register's own width, for example `%MW3.200002`.
    #[must_use]
    pub fn address(&self) -> Address {
        // The layout compiler has checked the alignment of every register.
        Address::new(Some(self.area.space), Width::of(self.register.ty), self.offset())
    }

    /// Returns the address of bit `bit` of the register; `None` if there is no such bit.
    #[must_use]
    pub fn bit_address(&self, bit: u32) -> Option<Address> {
        (bit < 8 * self.width()).then(|| self.address().of_bit(bit))
    }

    /// Returns the meaning of bit `bit` with value 0 or 1, and the decision on which the meaning is based. The result
    /// is empty if the meaning is not known, or if the bit has a meaning only together with other bits.
    #[must_use]
    pub fn decode_bit(&self, bit: u32, is_set: bool) -> String {
        if self.is_reserved() {
            return "reserved".to_owned();
        }
        decode::decode_bit(self.register.meaning, bit, is_set)
    }

    /// Returns the data type of the register.
    #[must_use]
    pub const fn ty(&self) -> RegType {
        self.register.ty
    }

    /// Returns the width in bytes: 1, 2 or 4.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.register.ty.width()
    }

    /// Returns the value after power-on, as a bit pattern.
    #[must_use]
    pub const fn reset(&self) -> u32 {
        self.register.reset
    }

    /// Writer of the register.
    #[must_use]
    pub const fn owner(&self) -> Owner {
        self.register.owner
    }

    /// True if the manual reserves this register, or this element of an array.
    #[must_use]
    pub fn is_reserved(&self) -> bool {
        self.register.reserved
            || self.register.dims.iter().zip(self.index).any(|(dim, index)| index >= dim.used)
    }

    /// Returns the meaning of `value`, for example "synchronous operation of the master is being set up". Bits above
    /// the register's width are ignored. A plain number is shown in decimal.
    #[must_use]
    pub fn decode(&self, value: u32) -> String {
        if self.is_reserved() {
            return "reserved".to_owned();
        }
        decode::decode(self.register.ty, self.register.meaning, value)
    }

    /// Formats `value` in IEC notation with all digits of the register: `16#0043`.
    #[must_use]
    pub fn format_value(&self, value: u32) -> String {
        decode::format_value(self.register.ty, value)
    }
}

impl PartialEq for RegisterRef {
    /// Two references are equal if they mean the same element of the same structure in the same area.
    fn eq(&self, other: &Self) -> bool {
        core::ptr::eq(self.area, other.area)
            && core::ptr::eq(self.register, other.register)
            && self.index == other.index
    }
}

impl Eq for RegisterRef {}

impl fmt::Debug for RegisterRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self} at {}", self.address())
    }
}

impl fmt::Display for RegisterRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&format!("{}.{}", self.front(), Path(self, self.register.name)))
    }
}

/// A register without its area, with one of its names.
struct Path<'a>(&'a RegisterRef, &'static str);

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Register { group, dims, group_dims, .. } = self.0.register;
        let mut index = self.0.index.iter().take(dims.len());
        if !group.is_empty() {
            f.write_str(group)?;
            for index in index.by_ref().take(*group_dims) {
                write!(f, "[{index}]")?;
            }
            f.write_str(".")?;
        }
        f.write_str(self.1)?;
        index.try_for_each(|index| write!(f, "[{index}]"))
    }
}
