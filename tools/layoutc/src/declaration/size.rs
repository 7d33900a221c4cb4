//! Sizes and offsets, as a compiler with a given alignment lays types out.

use super::{DeclarationError, Declarations, Fault, Member, Type, TypeId, Wrong, in_file};

/// Maximum depth of types that refer to each other.
const MAX_DEPTH: usize = 64;
/// The largest type in bytes, far beyond any area of the RAM.
const MAX_SIZE: u32 = 16 << 20;
/// Elementary types with a size that does not depend on the compiler, in bytes. A BOOL takes one byte.
const ELEMENTARY: [(&str, u32); 15] = [
    ("BOOL", 1),
    ("BYTE", 1),
    ("SINT", 1),
    ("USINT", 1),
    ("WORD", 2),
    ("INT", 2),
    ("UINT", 2),
    ("DWORD", 4),
    ("DINT", 4),
    ("UDINT", 4),
    ("REAL", 4),
    ("LWORD", 8),
    ("LINT", 8),
    ("ULINT", 8),
    ("LREAL", 8),
];
/// Elementary types with a size that depends on the compiler.
const UNSIZED: [&str; 5] = ["TIME", "DATE", "TIME_OF_DAY", "TOD", "DATE_AND_TIME"];

/// Maximum alignment of members: a member begins at a multiple of its own alignment, but at most of this one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Alignment {
    /// Members follow without a gap.
    Packed,
    /// At most 2.
    Two,
    /// At most 4.
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
    /// Array bounds, outermost first; empty if there is only one element.
    pub counts: Vec<u32>,
    /// The element's type.
    pub element: Element,
    /// Bytes of one element.
    pub size: u32,
}

/// An element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Element {
    /// Elementary, with its name in capitals.
    Scalar(&'static str),
    /// A structure.
    Struct(TypeId),
}

/// Members of a structure with their offsets.
pub(crate) type MemberOffsets<'a> = Vec<(u32, &'a Member)>;

/// A type in memory.
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
    /// In progress: a reference to the type now is circular.
    Open,
    Known(Extent),
}

/// Sizes of declared types, each worked out once.
pub struct Sizes<'a> {
    declarations: &'a Declarations,
    alignment: Alignment,
    known: Vec<SizeState>,
}

impl<'a> Sizes<'a> {
    /// For types that a compiler lays out with this alignment.
    pub fn new(declarations: &'a Declarations, alignment: Alignment) -> Self {
        let known = vec![SizeState::Unknown; declarations.types.all.len()];
        Self { declarations, alignment, known }
    }

    /// Size of a type in bytes. That of a structure is a multiple of its alignment.
    ///
    /// # Errors
    /// The type, or one it consists of, is not declared, has no fixed size, contains itself, is too large or too deep.
    pub fn size(&mut self, ty: TypeId) -> Result<u32, DeclarationError> {
        self.extent(ty, 0).map(|extent| extent.size).map_err(|fault| self.in_file(fault))
    }

    /// The members of a structure with their offsets; of other types none.
    ///
    /// # Errors
    /// As [`Sizes::size`].
    pub fn members(&mut self, ty: TypeId) -> Result<MemberOffsets<'a>, DeclarationError> {
        self.place(ty, 0).map(|(placed, _)| placed).map_err(|fault| self.in_file(fault))
    }

    /// Returns the type with names and arrays of arrays resolved.
    ///
    /// # Errors
    /// As [`Sizes::size`].
    pub fn shape(&mut self, ty: TypeId) -> Result<Shape, DeclarationError> {
        // A type with a size is finite and known in all parts.
        self.size(ty)?;
        let mut counts = Vec::new();
        let mut element = ty;
        loop {
            match &self.declarations.types.of(element).1 {
                Type::Array { counts: more, of } => {
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
                Type::Struct(_) | Type::Unsized(_) => {
                    let size = self.size(element)?;
                    return Ok(Shape { counts, element: Element::Struct(element), size });
                }
            }
        }
    }

    fn in_file(&self, fault: Fault) -> DeclarationError {
        in_file(&self.declarations.path, fault)
    }

    fn extent(&mut self, id: TypeId, depth: usize) -> Result<Extent, Fault> {
        let at = &self.declarations.types.of(id).0;
        match self.known[id.0] {
            SizeState::Known(extent) if depth + extent.depth > MAX_DEPTH => {
                return Err((*at, Wrong::DeepType(MAX_DEPTH)));
            }
            SizeState::Known(extent) => return Ok(extent),
            SizeState::Open => return Err((*at, Wrong::Circular(self.type_text(id)))),
            SizeState::Unknown if depth >= MAX_DEPTH => return Err((*at, Wrong::DeepType(MAX_DEPTH))),
            SizeState::Unknown => {}
        }
        self.known[id.0] = SizeState::Open;
        let extent = self.work_out(id, depth).map(|extent| Extent { depth: extent.depth + 1, ..extent });
        self.known[id.0] = extent.as_ref().map_or(SizeState::Unknown, |extent| SizeState::Known(*extent));
        extent
    }

    fn work_out(&mut self, id: TypeId, depth: usize) -> Result<Extent, Fault> {
        let (at, ty) = self.declarations.types.of(id);
        match ty {
            Type::Named(name) => match self.declarations.find(name) {
                Some(named) => self.extent(named, depth + 1),
                None => self.elementary(name).map_err(|wrong| (*at, wrong)),
            },
            Type::Array { counts, of } => {
                let of = self.extent(*of, depth + 1)?;
                let size = counts.iter().try_fold(of.size, |size, count| size.checked_mul(*count));
                let size = size.filter(|size| *size <= MAX_SIZE).ok_or((*at, Wrong::TooLarge(MAX_SIZE)))?;
                Ok(Extent { size, ..of })
            }
            Type::Struct(_) => self.place(id, depth).map(|(_, extent)| extent),
            Type::Unsized(what) => Err((*at, Wrong::NoSize((*what).to_owned()))),
        }
    }

    fn elementary(&self, name: &str) -> Result<Extent, Wrong> {
        if UNSIZED.iter().any(|known| known.eq_ignore_ascii_case(name)) {
            return Err(Wrong::NoSize(name.to_owned()));
        }
        let (_, size) = elementary(name).ok_or_else(|| Wrong::UnknownType(name.to_owned()))?;
        Ok(Extent { size, align: size.min(self.alignment.limit()), depth: 0 })
    }

    /// Places members one after the other, each at the next multiple of its alignment.
    fn place(&mut self, id: TypeId, depth: usize) -> Result<(MemberOffsets<'a>, Extent), Fault> {
        let members = self.declarations.members(id);
        let mut whole = Extent { size: 0, align: 1, depth: 0 };
        let mut placed = Vec::with_capacity(members.len());
        for member in members {
            let extent = self.extent(member.ty, depth + 1)?;
            // No sum overflows: neither part is larger than MAX_SIZE.
            let offset = whole.size.next_multiple_of(extent.align);
            whole.size = offset + extent.size;
            if whole.size > MAX_SIZE {
                return Err((member.at, Wrong::TooLarge(MAX_SIZE)));
            }
            whole.align = whole.align.max(extent.align);
            whole.depth = whole.depth.max(extent.depth);
            placed.push((offset, member));
        }
        whole.size = whole.size.next_multiple_of(whole.align);
        Ok((placed, whole))
    }

    fn type_text(&self, id: TypeId) -> String {
        let declared = &self.declarations.types.named;
        declared
            .iter()
            .find(|(_, ty)| *ty == id)
            .map_or_else(|| "this type".to_owned(), |(name, _)| name.clone())
    }
}

fn elementary(name: &str) -> Option<(&'static str, u32)> {
    ELEMENTARY.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).copied()
}
