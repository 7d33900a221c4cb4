//! Object dictionaries: the objects that service data objects (SDO) access.

use super::descriptor::{DeviceLayout, Provenance};
use core::fmt;

/// An entry of the object dictionary.
#[derive(Debug, PartialEq, Eq)]
pub struct Object {
    /// Index of the entry in the object dictionary.
    pub index: u16,
    /// Sub-index of the entry.
    pub sub: u8,
    /// Name of the entry in the manual.
    pub name: &'static str,
    /// Data type; `None` if the entry is not implemented.
    pub ty: Option<Type>,
    /// Permitted access by SDO.
    pub access: Access,
    /// Default value of the entry.
    pub default: Default,
    /// True if the device keeps the value without supply.
    pub saved: bool,
    /// Page of the manual.
    pub page: &'static str,
    /// Description of the entry.
    pub doc: &'static str,
    /// Source of the entry and its type.
    pub row_from: Provenance,
    /// Source of the default value.
    pub default_from: Provenance,
}

/// A data type of the object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Type {
    /// Unsigned number of 1 byte.
    U8,
    /// Unsigned number of 2 bytes.
    U16,
    /// Unsigned number of 4 bytes.
    U32,
    /// Text of any length.
    String,
    /// Any number of bytes.
    Domain,
}

impl Type {
    /// Returns the manual's abbreviation.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Type::U8 => "u8",
            Type::U16 => "u16",
            Type::U32 => "u32",
            Type::String => "str",
            Type::Domain => "dom",
        }
    }

    /// Returns the length in bytes; `None` if it is not fixed.
    #[must_use]
    pub const fn bytes(self) -> Option<usize> {
        match self {
            Type::U8 => Some(1),
            Type::U16 => Some(2),
            Type::U32 => Some(4),
            Type::String | Type::Domain => None,
        }
    }
}

/// Access to an entry by SDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// The entry can be read.
    ReadOnly,
    /// The entry can be read and written.
    ReadWrite,
    /// The entry cannot be accessed: the manual names it as not implemented.
    NotImplemented,
}

impl Access {
    /// Returns the manual's abbreviation.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Access::ReadOnly => "ro",
            Access::ReadWrite => "rw",
            Access::NotImplemented => "not implemented",
        }
    }
}

/// Default value of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Default {
    /// The entry has no default value.
    Nothing,
    /// The value is this number.
    Number(u32),
    /// The value is this number plus the Node-ID.
    PlusNode(u32),
    /// The value is this text.
    Text(&'static str),
}

impl Default {
    /// Returns the default value as a number, for a device with Node-ID `node`; 0 if it is not a number.
    #[must_use]
    pub const fn at_node(self, node: u8) -> u32 {
        match self {
            Default::Nothing | Default::Text(_) => 0,
            Default::Number(number) => number,
            Default::PlusNode(number) => number.wrapping_add(node as u32),
        }
    }
}

/// Formats the default: `16#20002`, `16#180 + Node-ID`, `ecomat 100`.
impl fmt::Display for Default {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Default::Nothing => Ok(()),
            Default::Number(number) => write!(f, "16#{number:X}"),
            Default::PlusNode(0) => f.write_str("Node-ID"),
            Default::PlusNode(number) => write!(f, "16#{number:X} + Node-ID"),
            Default::Text(text) => f.write_str(text),
        }
    }
}

/// `1400h sub 1 COB ID`
impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h sub {} {}", self.index, self.sub, self.name)
    }
}

impl DeviceLayout {
    /// Returns this entry of the object dictionary, if it exists.
    #[must_use]
    pub fn object(&self, index: u16, sub: u8) -> Option<&'static Object> {
        let at =
            self.objects.binary_search_by_key(&(index, sub), |object| (object.index, object.sub)).ok()?;
        self.objects.get(at)
    }

    /// True if the object dictionary has entries with this index.
    #[must_use]
    pub fn has_index(&self, index: u16) -> bool {
        let at = self.objects.partition_point(|object| object.index < index);
        self.objects.get(at).is_some_and(|object| object.index == index)
    }
}
