//! Sizes and offsets of types for a compiler with a given alignment.

use super::expression::{Expression, Values};
use super::{DeclarationError, Declarations, Member, Record, TextPosition, Type, TypeId, Wrong, in_file};

/// Maximum depth of types that refer to each other.
const MAX_DEPTH: usize = 64;
/// The largest type in bytes, far beyond any area of the RAM.
const MAX_SIZE: u32 = 16 << 20;
/// Maximum number of elements of a dimension of an array.
const MAX_ELEMENTS: i64 = 1 << 24;
/// Elementary types with a size that does not depend on the compiler, in bytes. A BOOL takes one byte.
const ELEMENTARY: [(&str, u32); 21] = [
    ("BOOL", 1),
    ("BYTE", 1),
    ("CHAR", 1),
    ("SINT", 1),
    ("USINT", 1),
    ("WORD", 2),
    ("INT", 2),
    ("UINT", 2),
    ("WCHAR", 2),
    ("DWORD", 4),
    ("DINT", 4),
    ("UDINT", 4),
    ("REAL", 4),
    ("LWORD", 8),
    ("LINT", 8),
    ("ULINT", 8),
    ("LREAL", 8),
    ("LTIME", 8),
    ("LDATE", 8),
    ("LTOD", 8),
    ("LDT", 8),
];
/// Elementary types with a size that depends on the compiler.
const UNSIZED: [&str; 12] = [
    "TIME",
    "DATE",
    "TIME_OF_DAY",
    "TOD",
    "DATE_AND_TIME",
    "DT",
    "BIT",
    "ANY",
    "ANY_NUM",
    "ANY_INT",
    "ANY_BIT",
    "PVOID",
];

/// Maximum alignment of members. A member begins at a multiple of its own alignment, or of the maximum alignment if
/// this is smaller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alignment {
    /// Members follow without a gap.
    Packed,
    /// At most 2 bytes.
    Two,
    /// At most 4 bytes.
    Four,
    /// The alignment of the type itself.
    Natural,
}

impl Alignment {
    const fn limit(self) -> u32 {
        match self {
            Self::Packed => 1,
            Self::Two => 2,
            Self::Four => 4,
            Self::Natural => u32::MAX,
        }
    }
}

/// A type with all names resolved: its elements and their number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shape {
    /// Numbers of elements of the dimensions, outermost first. Empty if the type is not an array.
    pub counts: Vec<u32>,
    /// Type of the elements.
    pub element: Element,
    /// Size of one element, in bytes.
    pub size: u32,
}

/// Type of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Element {
    /// An elementary type, with its name in capitals.
    Scalar(&'static str),
    /// The element is a structure.
    Struct(TypeId),
}

/// Members of a structure with their offsets.
pub(crate) type MemberOffsets<'a> = Vec<(u32, &'a Member)>;

/// Size, alignment and depth of a type in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Extent {
    size: u32,
    align: u32,
    /// Nesting depth of the type.
    depth: usize,
}

#[derive(Clone, Copy)]
enum SizeState {
    Unknown,
    /// The size is being computed. A reference to the type at this time is circular.
    Open,
    Known(Extent),
}

/// Sizes of declared types. Each is computed once.
pub struct Sizes<'a> {
    declarations: &'a Declarations,
    alignment: Alignment,
    known: Vec<SizeState>,
    values: Values<'a>,
}

/// A type without a size: its number, the place and the reason.
type Misfit = (TypeId, TextPosition, Wrong);

impl<'a> Sizes<'a> {
    /// Creates a calculator of sizes for a compiler with this alignment.
    pub fn new(declarations: &'a Declarations, alignment: Alignment) -> Self {
        let known = vec![SizeState::Unknown; declarations.types.len()];
        Self { declarations, alignment, known, values: Values::new(declarations) }
    }

    /// Returns the size of a type in bytes. The size of a structure is a multiple of its alignment.
    ///
    /// # Errors
    /// The type, or one of its parts, is not declared, has no fixed size, contains itself, is too large or is nested
    /// too deeply.
    pub fn size(&mut self, ty: TypeId) -> Result<u32, DeclarationError> {
        self.extent(ty, 0).map(|extent| extent.size).map_err(|misfit| self.in_file(misfit))
    }

    /// Returns the members of a structure with their offsets. Other types have no members.
    ///
    /// # Errors
    /// Returns the errors of [`Sizes::size`].
    pub fn members(&mut self, ty: TypeId) -> Result<MemberOffsets<'a>, DeclarationError> {
        let Some(record) = self.declarations.record(ty) else { return Ok(Vec::new()) };
        self.place(ty, record, 0).map(|(placed, _)| placed).map_err(|misfit| self.in_file(misfit))
    }

    /// Returns the type with names and arrays of arrays resolved.
    ///
    /// # Errors
    /// Returns the errors of [`Sizes::size`].
    pub fn shape(&mut self, ty: TypeId) -> Result<Shape, DeclarationError> {
        // This returns an error for a type without a size. Otherwise, all parts of the type are known, and it does not
        // contain itself.
        self.size(ty)?;
        let mut counts = Vec::new();
        let mut element = ty;
        loop {
            match &self.declarations.of(element).ty {
                Type::Array { bounds, of } => {
                    let more = self.counts(element, bounds).map_err(|misfit| self.in_file(misfit))?;
                    counts.extend(more);
                    element = *of;
                }
                Type::Named(name) => match self.declarations.find(name) {
                    Some(ty) => element = ty,
                    None => {
                        let (name, size) = elementary(name).unwrap_or(("", 0));
                        return Ok(Shape { counts, element: Element::Scalar(name), size });
                    }
                },
                Type::Record(_) | Type::Unsized(_) => {
                    let size = self.size(element)?;
                    return Ok(Shape { counts, element: Element::Struct(element), size });
                }
            }
        }
    }

    fn in_file(&self, (ty, at, wrong): Misfit) -> DeclarationError {
        in_file(self.declarations.file_of(ty), (at, wrong))
    }

    fn extent(&mut self, id: TypeId, depth: usize) -> Result<Extent, Misfit> {
        let at = self.declarations.of(id).at;
        match self.known[id.0] {
            SizeState::Known(extent) if depth + extent.depth > MAX_DEPTH => {
                return Err((id, at, Wrong::DeepType(MAX_DEPTH)));
            }
            SizeState::Known(extent) => return Ok(extent),
            SizeState::Open => return Err((id, at, Wrong::Circular(self.type_text(id)))),
            SizeState::Unknown if depth >= MAX_DEPTH => return Err((id, at, Wrong::DeepType(MAX_DEPTH))),
            SizeState::Unknown => {}
        }
        self.known[id.0] = SizeState::Open;
        let extent = self.work_out(id, depth).map(|extent| Extent { depth: extent.depth + 1, ..extent });
        self.known[id.0] = extent.as_ref().map_or(SizeState::Unknown, |extent| SizeState::Known(*extent));
        extent
    }

    fn work_out(&mut self, id: TypeId, depth: usize) -> Result<Extent, Misfit> {
        let declared = self.declarations.of(id);
        let misfit = |wrong| (id, declared.at, wrong);
        match &declared.ty {
            Type::Named(name) => match self.declarations.resolve(name).map_err(misfit)? {
                Some(named) => self.extent(named, depth + 1),
                None => self.elementary(name).map_err(misfit),
            },
            Type::Array { bounds, of } => {
                let counts = self.counts(id, bounds)?;
                let of = self.extent(*of, depth + 1)?;
                let size = counts.iter().try_fold(of.size, |size, count| size.checked_mul(*count));
                let size =
                    size.filter(|size| *size <= MAX_SIZE).ok_or_else(|| misfit(Wrong::TooLarge(MAX_SIZE)))?;
                Ok(Extent { size, ..of })
            }
            Type::Record(record) => self.place(id, record, depth).map(|(_, extent)| extent),
            Type::Unsized(what) => Err(misfit(Wrong::NoSize((*what).to_owned()))),
        }
    }

    /// Returns the number of elements of each dimension of the array `id`.
    fn counts(
        &mut self,
        id: TypeId,
        bounds: &'a [(TextPosition, Expression, Expression)],
    ) -> Result<Vec<u32>, Misfit> {
        let mut count = |(first, last): (&'a Expression, &'a Expression)| {
            let (first, last) = (self.values.of(first)?, self.values.of(last)?);
            let count = last - first + 1;
            if (1..=MAX_ELEMENTS).contains(&count) {
                Ok(count as u32)
            } else {
                Err(Wrong::Bounds { first, last })
            }
        };
        let counts =
            bounds.iter().map(|(at, first, last)| count((first, last)).map_err(|wrong| (id, *at, wrong)));
        counts.collect()
    }

    fn elementary(&self, name: &str) -> Result<Extent, Wrong> {
        if UNSIZED.iter().any(|known| known.eq_ignore_ascii_case(name)) {
            return Err(Wrong::NoSize(name.to_owned()));
        }
        let (_, size) = elementary(name).ok_or_else(|| Wrong::UnknownType(name.to_owned()))?;
        Ok(Extent { size, align: size.min(self.alignment.limit()), depth: 0 })
    }

    /// Places the members of a structure one after the other, each at the next multiple of its alignment. The members
    /// of a union have the same address.
    fn place(
        &mut self,
        id: TypeId,
        record: &'a Record,
        depth: usize,
    ) -> Result<(MemberOffsets<'a>, Extent), Misfit> {
        if let Some(at) = record.located {
            return Err((id, at, Wrong::OwnAddress));
        }
        let limit = record.pack.unwrap_or(u32::MAX);
        let (mut placed, mut whole) = match &record.base {
            Some(base) => self.base(id, base, depth)?,
            None => (Vec::new(), Extent { size: 0, align: 1, depth: 0 }),
        };
        for member in &record.members {
            let extent = self.extent(member.ty, depth + 1)?;
            let align = extent.align.min(limit);
            // The sum cannot overflow: neither part is larger than MAX_SIZE.
            let offset = if record.is_union { 0 } else { whole.size.next_multiple_of(align) };
            whole.size = whole.size.max(offset + extent.size);
            if whole.size > MAX_SIZE {
                return Err((id, member.at, Wrong::TooLarge(MAX_SIZE)));
            }
            whole.align = whole.align.max(align);
            whole.depth = whole.depth.max(extent.depth);
            placed.push((offset, member));
        }
        whole.size = whole.size.next_multiple_of(whole.align);
        Ok((placed, whole))
    }

    /// Returns the members of the structure that `id` extends. They come first, like a member with this structure as
    /// its type.
    fn base(&mut self, id: TypeId, name: &str, depth: usize) -> Result<(MemberOffsets<'a>, Extent), Misfit> {
        let at = self.declarations.of(id).at;
        let unknown = || (id, at, Wrong::UnknownBase(name.to_owned()));
        let base = self.declarations.resolve(name).map_err(|wrong| (id, at, wrong))?.ok_or_else(unknown)?;
        let record = self.declarations.record(base).ok_or_else(unknown)?;
        let extent = self.extent(base, depth + 1)?;
        let (placed, _) = self.place(base, record, depth + 1)?;
        Ok((placed, extent))
    }

    fn type_text(&self, id: TypeId) -> String {
        let named = self.declarations.named.iter().find(|named| named.ty == id);
        named.map_or_else(|| "this type".to_owned(), |named| named.name.clone())
    }
}

fn elementary(name: &str) -> Option<(&'static str, u32)> {
    ELEMENTARY.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).copied()
}
