//! Structures of the header page as data, for code that lists them ([`super::contract`]).

use super::{Cell8, Cell32, Cell64};

const CONTRACT: &str = include_str!("../../docs/reference/attach.md");

/// Named numbers of the header page.
#[derive(Debug)]
pub struct Codes {
    /// Name of the set, for example `ClockMode`.
    pub name: &'static str,
    /// Each number with its name and meaning.
    pub codes: &'static [(u32, &'static str, &'static str)],
}

/// Type of a field of the header page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// A little-endian unsigned integer of this many bytes: 1, 4 or 8.
    Integer(usize),
    /// A structure of the header page.
    Struct(&'static HeaderStruct),
}

/// A structure of the header page, or the page itself.
#[derive(Debug, PartialEq, Eq)]
pub struct HeaderStruct {
    /// Name of the structure, for example `EventSlot`.
    pub name: &'static str,
    /// Size of the field in bytes.
    pub bytes: usize,
    /// The fields of the structure in ascending order, without gaps.
    pub fields: &'static [Field],
}

/// A field of the header page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Offset in the structure, in bytes.
    pub offset: usize,
    /// Name of the field.
    pub name: &'static str,
    /// Type of the field, or of one element.
    pub kind: FieldKind,
    /// Number of elements; `None` if it is not an array.
    pub count: Option<usize>,
}

impl FieldKind {
    /// Returns the size in bytes.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            FieldKind::Integer(bytes) => bytes,
            FieldKind::Struct(of) => of.bytes,
        }
    }
}

impl Field {
    /// Describes a field of `S`. `_get` only tells the compiler the type of the field.
    pub(super) const fn of<S, T: Described>(offset: usize, name: &'static str, _get: fn(&S) -> &T) -> Self {
        Self { offset, name, kind: T::KIND, count: T::COUNT }
    }

    /// Returns the size in bytes, with all elements.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.kind.bytes()
            * match self.count {
                Some(count) => count,
                None => 1,
            }
    }

    /// True if the field only fills a gap.
    #[must_use]
    pub fn is_reserved(&self) -> bool {
        self.name.starts_with("reserved")
    }

    /// Meaning of the field in the attach contract, without Markdown; `None` if the contract has no row for it.
    #[must_use]
    pub fn meaning(&self) -> Option<String> {
        let Self { offset, name, .. } = self;
        // The contract writes offsets within a sub-structure with a sign.
        let rows = ["", "+"].map(|sign| format!("| {sign}{offset} | {} | `{name}` |", self.bytes()));
        let line = CONTRACT.lines().find(|line| rows.iter().any(|row| line.starts_with(row)))?;
        let last = line.trim_end().trim_end_matches('|').rsplit('|').next()?;
        Some(last.trim().replace('`', ""))
    }
}

/// The part of a [`Field`] that depends on its type.
pub(super) trait Described {
    const KIND: FieldKind;
    const COUNT: Option<usize> = None;
}

macro_rules! described {
    ($($ty:ty => $kind:expr),* $(,)?) => {
        $(impl Described for $ty { const KIND: FieldKind = $kind; })*
    };
}

described! {
    Cell8 => FieldKind::Integer(1),
    Cell32 => FieldKind::Integer(4),
    Cell64 => FieldKind::Integer(8),
}

impl<T: Described, const N: usize> Described for [T; N] {
    const KIND: FieldKind = T::KIND;
    const COUNT: Option<usize> = Some(N);
}

/// Publishes the offsets of a structure, which the compiler checks, as its `STRUCT`. A structure that is part of
/// another one must be published, too.
macro_rules! publish {
    ($ty:ident: $($offset:literal => $field:ident),* $(,)?) => {
        $(const _: () = assert!(core::mem::offset_of!($ty, $field) == $offset);)*

        impl $ty {
            /// The structure as data.
            pub const STRUCT: $crate::memory::struct_tables::HeaderStruct = $crate::memory::struct_tables::HeaderStruct {
                name: stringify!($ty),
                bytes: size_of::<$ty>(),
                fields: &[$($crate::memory::struct_tables::Field::of(
                    $offset,
                    stringify!($field),
                    |of: &$ty| &of.$field,
                )),*],
            };
        }

        impl $crate::memory::struct_tables::Described for $ty {
            const KIND: $crate::memory::struct_tables::FieldKind = $crate::memory::struct_tables::FieldKind::Struct(&$ty::STRUCT);
        }
    };
}
pub(super) use publish;
