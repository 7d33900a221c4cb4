//! The header page as data, for whoever writes declarations of it in another language.
//!
//! Offsets and kinds come from the Rust structs themselves; what a field means is read from the tables of
//! `docs/attach.md`, so there is one description and nothing to keep in step.

use super::header::*;
use super::{Bell, Cell8, Cell32, Cell64};

const CONTRACT: &str = include_str!("../../docs/attach.md");

/// Numbers of the header page that stand for something.
#[derive(Debug)]
pub struct Codes {
    /// What they tell, for example `ClockMode`.
    pub name: &'static str,
    /// Each number with its name and meaning.
    pub codes: &'static [(u32, &'static str, &'static str)],
}

/// All of them.
pub const CODES: [Codes; 11] = [
    State::CODES,
    ClockMode::CODES,
    RunSwitch::CODES,
    ProgramState::CODES,
    Project::CODES,
    Start::CODES,
    Power::CODES,
    InterruptResult::CODES,
    OptInitResult::CODES,
    InitialFlagResult::CODES,
    SeatState::CODES,
];

/// The structures of the header page, each before those that contain it; the page itself is the last.
#[must_use]
pub fn structures() -> Vec<&'static HeaderStruct> {
    fn add(of: &'static HeaderStruct, found: &mut Vec<&'static HeaderStruct>) {
        for field in of.fields {
            if let Kind::Struct(of) = field.kind {
                add(of, found);
            }
        }
        if !found.iter().any(|known| known.name == of.name) {
            found.push(of);
        }
    }
    let mut found = Vec::new();
    add(&Header::STRUCT, &mut found);
    found
}

/// What a field of the header page consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A little-endian unsigned integer of this many bytes: 1, 4 or 8.
    Integer(usize),
    /// A structure of the header page.
    Struct(&'static HeaderStruct),
}

/// A structure of the header page, or the page itself.
#[derive(Debug, PartialEq, Eq)]
pub struct HeaderStruct {
    /// Its name, for example `EventSlot`.
    pub name: &'static str,
    /// Size in bytes.
    pub bytes: usize,
    /// Its fields in ascending order; they leave no gap.
    pub fields: &'static [Field],
}

/// A field of the header page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Offset in the structure, in bytes.
    pub offset: usize,
    /// Its name.
    pub name: &'static str,
    /// What it, or one of its elements, is.
    pub kind: Kind,
    /// Number of elements; `None` if it is no array.
    pub count: Option<usize>,
}

impl Kind {
    /// Size in bytes.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Kind::Integer(bytes) => bytes,
            Kind::Struct(of) => of.bytes,
        }
    }
}

impl Field {
    /// The field of `S` that `_get` returns, at `offset`.
    pub(super) const fn of<S, T: Described>(offset: usize, name: &'static str, _get: fn(&S) -> &T) -> Self {
        Self { offset, name, kind: T::KIND, count: T::COUNT }
    }

    /// Size in bytes, with all elements.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.kind.bytes()
            * match self.count {
                Some(count) => count,
                None => 1,
            }
    }

    /// Whether the field only fills a gap.
    #[must_use]
    pub fn is_reserved(&self) -> bool {
        self.name.starts_with("reserved")
    }

    /// What the attach contract says about the field, without its Markdown; `None` if it says nothing.
    #[must_use]
    pub fn meaning(&self) -> Option<String> {
        let Self { offset, name, .. } = self;
        // Offsets in a part of the page have a sign.
        let rows = ["", "+"].map(|sign| format!("| {sign}{offset} | {} | `{name}` |", self.bytes()));
        let line = CONTRACT.lines().find(|line| rows.iter().any(|row| line.starts_with(row)))?;
        let last = line.trim_end().trim_end_matches('|').rsplit('|').next()?;
        Some(last.trim().replace('`', ""))
    }
}

/// What a type contributes to a [`Field`].
pub(super) trait Described {
    const KIND: Kind;
    const COUNT: Option<usize> = None;
}

macro_rules! described {
    ($($ty:ty => $kind:expr),* $(,)?) => {
        $(impl Described for $ty { const KIND: Kind = $kind; })*
    };
}

described! {
    Cell8 => Kind::Integer(1),
    Cell32 => Kind::Integer(4),
    Cell64 => Kind::Integer(8),
    Bell => Kind::Struct(&Bell::STRUCT),
    EventSlot => Kind::Struct(&EventSlot::STRUCT),
    Interrupt => Kind::Struct(&Interrupt::STRUCT),
    TimerSetup => Kind::Struct(&TimerSetup::STRUCT),
    OptInit => Kind::Struct(&OptInit::STRUCT),
    InitialFlag => Kind::Struct(&InitialFlag::STRUCT),
    Seat => Kind::Struct(&Seat::STRUCT),
    Board => Kind::Struct(&Board::STRUCT),
    Program => Kind::Struct(&Program::STRUCT),
    AreaEntry => Kind::Struct(&AreaEntry::STRUCT),
    PortEntry => Kind::Struct(&PortEntry::STRUCT),
}

impl<T: Described, const N: usize> Described for [T; N] {
    const KIND: Kind = T::KIND;
    const COUNT: Option<usize> = Some(N);
}

/// Publishes the offsets of a structure, which the compiler checks, as its `STRUCT`.
macro_rules! publish {
    ($ty:ident: $($offset:literal => $field:ident),* $(,)?) => {
        $(const _: () = assert!(core::mem::offset_of!($ty, $field) == $offset);)*

        impl $ty {
            /// The structure as data.
            pub const STRUCT: $crate::memory::contract::HeaderStruct = $crate::memory::contract::HeaderStruct {
                name: stringify!($ty),
                bytes: size_of::<$ty>(),
                fields: &[$($crate::memory::contract::Field::of(
                    $offset,
                    stringify!($field),
                    |of: &$ty| &of.$field,
                )),*],
            };
        }
    };
}
pub(super) use publish;

#[cfg(test)]
mod tests {
    use super::*;

    /// Every byte of the page is in the contract's tables, under the name it has here.
    #[test]
    fn the_attach_contract_describes_every_byte() {
        for of in structures() {
            let mut end = 0;
            for field in of.fields {
                assert_eq!(field.offset, end, "{}.{}", of.name, field.name);
                end += field.bytes();
                let meaning = field.meaning();
                assert!(meaning.is_some(), "docs/attach.md lacks {}.{}", of.name, field.name);
                assert_eq!(meaning == Some(String::new()), field.is_reserved(), "{}.{}", of.name, field.name);
            }
            assert_eq!(end, of.bytes, "{}", of.name);
        }
    }

    #[test]
    fn a_field_knows_what_it_is() {
        let field = |name| Header::STRUCT.fields.iter().find(|field| field.name == name).unwrap();
        let events = field("events");
        assert_eq!((events.count, events.bytes()), (Some(16), 256));
        assert_eq!(events.kind, Kind::Struct(&EventSlot::STRUCT));
        assert_eq!((field("magic").kind, field("magic").count), (Kind::Integer(8), None));
        assert_eq!(field("instance").kind, Kind::Integer(1));
        assert_eq!(field("magic").meaning().unwrap(), "commram and a zero");
        assert_eq!(Bell::STRUCT.fields[0].meaning().unwrap(), "number of rings, wrapping; the futex");
    }
}
