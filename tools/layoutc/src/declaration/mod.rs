//! IEC 61131-3 declarations of types, as engineering tools export them: read, and laid out in memory.
//!
//! Written for this purpose: the crates on crates.io parse the whole language. None of them keeps the place of
//! every member for error messages, and each is maintained only by its author.

mod error;
mod lexer;
mod parser;
mod size;

pub use error::{DeclarationError, TextPosition, Wrong};
pub(crate) use error::{Fault, in_file};
pub use size::{Alignment, Element, Shape, Sizes};

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

/// Maximum size of a file, in bytes; the types of a whole library have some hundred kilobytes.
pub const MAX_BYTES: u64 = 4 << 20;

/// The types that one file declares.
#[derive(Debug)]
pub struct Declarations {
    /// Path of the file as given.
    pub path: PathBuf,
    /// Whether commram has written the file itself: its declarations repeat the layout and prove nothing.
    pub is_own_export: bool,
    types: Types,
}

/// Beginning of the second line of a file that `commram export` has written.
const EXPORT_HEAD: &str = "(* Made by commram ";
/// Number of lines that are searched for `commram export`'s line.
const HEAD_LINES: usize = 20;

/// Number of a type, with a name or written in place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct TypeId(usize);

/// Every type with its place, and those that have a name.
#[derive(Debug, Default)]
struct Types {
    all: Vec<(TextPosition, Type)>,
    /// In the order of the file.
    named: Vec<(String, TypeId)>,
    /// By name in lower case.
    by_name: HashMap<String, TypeId>,
}

#[derive(Debug)]
enum Type {
    /// An elementary type or a separately declared type.
    Named(String),
    Array {
        counts: Vec<u32>,
        of: TypeId,
    },
    Struct(Vec<Member>),
    /// A type with a size that the standard leaves to the compiler.
    Unsized(&'static str),
}

/// A member of a structure.
#[derive(Debug)]
pub struct Member {
    /// Its name as written.
    pub name: String,
    /// Where it is declared.
    pub at: TextPosition,
    /// Its type.
    pub ty: TypeId,
}

impl Types {
    fn add(&mut self, at: TextPosition, ty: Type) -> TypeId {
        self.all.push((at, ty));
        TypeId(self.all.len() - 1)
    }

    fn declare(&mut self, name: &str, ty: TypeId) {
        self.named.push((name.to_owned(), ty));
        self.by_name.insert(name.to_ascii_lowercase(), ty);
    }

    fn of(&self, id: TypeId) -> &(TextPosition, Type) {
        &self.all[id.0]
    }
}

impl Declarations {
    /// Reads the contents of the file at `path`: UTF-8, or the Latin script of older Windows programs, which can only occur
    /// in comments.
    ///
    /// # Errors
    /// The file could not be read, is too long, or does not parse; with line and column.
    pub fn read(path: &Path, found: io::Result<Vec<u8>>) -> Result<Self, DeclarationError> {
        let begin = TextPosition { line: 1, column: 1 };
        let bytes = found.map_err(|error| in_file(path, (begin, Wrong::Unreadable(error.to_string()))))?;
        let text = decode(bytes).map_err(|wrong| in_file(path, (begin, wrong)))?;
        Self::parse(path, &text)
    }

    /// Reads declarations out of `text`, which came from `path`.
    ///
    /// # Errors
    /// It does not parse; with line and column.
    pub fn parse(path: &Path, text: &str) -> Result<Self, DeclarationError> {
        let types = parser::parse(text).map_err(|fault| in_file(path, fault))?;
        let is_own_export =
            text.lines().take(HEAD_LINES).any(|line| line.trim_start().starts_with(EXPORT_HEAD));
        Ok(Self { path: path.to_owned(), is_own_export, types })
    }

    /// The type of this name; upper and lower case are not distinguished.
    pub fn find(&self, name: &str) -> Option<TypeId> {
        self.types.by_name.get(&name.to_ascii_lowercase()).copied()
    }

    /// Names of the structures, in the order of the file.
    pub fn structures(&self) -> impl Iterator<Item = &str> {
        let named = self.types.named.iter();
        named.filter(|(_, ty)| matches!(self.types.of(*ty).1, Type::Struct(_))).map(|(name, _)| name.as_str())
    }

    /// The members of a structure; of other types none.
    pub fn members(&self, ty: TypeId) -> &[Member] {
        match &self.types.of(ty).1 {
            Type::Struct(members) => members,
            _ => &[],
        }
    }
}

fn decode(bytes: Vec<u8>) -> Result<String, Wrong> {
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Wrong::TooLong(MAX_BYTES));
    }
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err(Wrong::Utf16);
    }
    let text = String::from_utf8(bytes)
        .unwrap_or_else(|error| error.into_bytes().into_iter().map(char::from).collect());
    Ok(text.strip_prefix('\u{FEFF}').map(str::to_owned).unwrap_or(text))
}

#[cfg(test)]
mod tests;
