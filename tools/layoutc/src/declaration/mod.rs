//! Reads IEC 61131-3 declarations of types, as engineering tools export them, and lays them out in memory.
//!
//! This parser was written for commram: the crates on crates.io parse the whole language. None of these crates keeps
//! the place of every member for error messages, and each is maintained only by its author.
//!
//! The parser skips all parts of a file other than types and constants; [`Declarations::notes`] reports them (D-785).

mod encoding;
mod error;
mod expression;
mod lexer;
mod parser;
mod plcopen;
mod size;
mod twincat;
mod xml;

use encoding::decode;
pub use error::{DeclarationError, TextPosition, Wrong};
pub(crate) use error::{Fault, in_file};
use expression::Expression;
pub use size::{Alignment, Element, Shape, Sizes};

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

/// Maximum size of all files together, in bytes; the types of a whole library have some hundred kilobytes.
pub const MAX_BYTES: u64 = 4 << 20;
/// Maximum depth of nested type definitions. Types that refer to others by name do not count.
const MAX_DEPTH: usize = 16;
/// Maximum number of skipped parts of a file that a note names.
const MAX_NAMED: usize = 5;

/// The types that files declare.
#[derive(Debug, Default)]
pub struct Declarations {
    /// True if `commram export` has written one of the files: such declarations only repeat the layout.
    pub is_own_export: bool,
    files: Vec<PathBuf>,
    /// Size of all files, in bytes.
    bytes: u64,
    types: Vec<Declared>,
    /// Types with names, in the order of the files.
    named: Vec<Named>,
    /// Indices of `named`, by name in lower case.
    by_name: HashMap<String, usize>,
    /// The second file that declares a type and the place there, by name in lower case.
    several: HashMap<String, (usize, TextPosition)>,
    /// Constants by their names in lower case.
    constants: HashMap<String, Constant>,
    skipped: Vec<SkippedPart>,
}

/// Start of the second line of a file that `commram export` has written.
const EXPORT_HEAD: &str = "(* Made by commram ";
/// Number of lines that are searched for `commram export`'s line.
const HEAD_LINES: usize = 20;

/// Number of a type. The type has a name, or is written inside another type.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct TypeId(usize);

/// A type, and the place where its declaration begins.
#[derive(Debug)]
struct Declared {
    /// An index into [`Declarations::files`].
    file: usize,
    at: TextPosition,
    ty: Type,
}

/// A type with a name, and the place of the name.
#[derive(Debug)]
struct Named {
    name: String,
    file: usize,
    at: TextPosition,
    ty: TypeId,
}

#[derive(Debug)]
enum Type {
    /// An elementary type or a separately declared type.
    Named(String),
    Array {
        /// Lower and upper bound of each dimension, with the place of the lower bound.
        bounds: Vec<(TextPosition, Expression, Expression)>,
        of: TypeId,
    },
    Record(Record),
    /// A type without a fixed size: the standard leaves the size to the compiler.
    Unsized(&'static str),
}

/// A structure or union.
#[derive(Debug, Default)]
struct Record {
    members: Vec<Member>,
    /// The structure that this structure extends; its members come first.
    base: Option<String>,
    /// True if all members begin at the same address.
    is_union: bool,
    /// Largest alignment of members in bytes, if the declaration states it.
    pack: Option<u32>,
    /// The first member that states its own address.
    located: Option<TextPosition>,
}

/// A member of a structure.
#[derive(Debug)]
pub struct Member {
    /// Name of the member as written.
    pub name: String,
    /// Place of the declaration.
    pub at: TextPosition,
    /// Type of the member.
    pub ty: TypeId,
}

/// A constant of a list of global variables. Lists can have constants of the same name.
#[derive(Debug)]
enum Constant {
    Once(Expression),
    Several,
}

/// A part of a file that declares no types.
#[derive(Debug)]
struct SkippedPart {
    file: usize,
    line: usize,
    /// Kind and name of the part.
    what: String,
}

impl Declarations {
    /// Reads the contents of the file at `path`: text, PLCopen XML or an object of TwinCAT; UTF-8, UTF-16, or the Latin
    /// script of older Windows programs.
    ///
    /// # Errors
    /// The file could not be read, all files together are too long, or the file cannot be parsed; the error has the line and
    /// the column.
    pub fn read(path: &Path, found: io::Result<Vec<u8>>) -> Result<Self, DeclarationError> {
        let mut declarations = Self::default();
        declarations.add(path, found)?;
        Ok(declarations)
    }

    /// Reads one more file, which can use the types and constants of the other files.
    ///
    /// # Errors
    /// Returns the errors of [`Declarations::read`].
    pub fn add(&mut self, path: &Path, found: io::Result<Vec<u8>>) -> Result<(), DeclarationError> {
        let wrong = |wrong| in_file(path, (TextPosition::BEGIN, wrong));
        let bytes = found.map_err(|error| {
            wrong(match error.kind() {
                io::ErrorKind::FileTooLarge => Wrong::TooLong(MAX_BYTES),
                _ => Wrong::Unreadable(error.to_string()),
            })
        })?;
        self.bytes = self.bytes.saturating_add(bytes.len() as u64);
        if self.bytes > MAX_BYTES {
            return Err(wrong(match self.files.is_empty() {
                true => Wrong::TooLong(MAX_BYTES),
                false => Wrong::TooLongTogether(MAX_BYTES),
            }));
        }
        self.add_text(path, &decode(bytes))
    }

    /// Reads declarations out of `text`, which came from `path`.
    ///
    /// # Errors
    /// The text cannot be parsed; the error has the line and the column.
    pub fn parse(path: &Path, text: &str) -> Result<Self, DeclarationError> {
        let mut declarations = Self::default();
        declarations.add_text(path, text)?;
        Ok(declarations)
    }

    fn add_text(&mut self, path: &Path, text: &str) -> Result<(), DeclarationError> {
        self.files.push(path.to_owned());
        let is_xml = text.trim_start().starts_with('<');
        let read =
            if is_xml { xml::read(text, self) } else { parser::parse(text, TextPosition::BEGIN, self) };
        read.map_err(|fault| in_file(path, fault))?;
        self.is_own_export |=
            text.lines().take(HEAD_LINES).any(|line| line.trim_start().starts_with(EXPORT_HEAD));
        Ok(())
    }

    /// Returns the type of this name; ignores case and namespaces.
    pub fn find(&self, name: &str) -> Option<TypeId> {
        let found = self.by_name.get(&unqualified(name))?;
        Some(self.named[*found].ty)
    }

    /// Returns the type of this name, if only one file declares it.
    ///
    /// # Errors
    /// Two files declare the type.
    pub fn find_only(&self, name: &str) -> Result<Option<TypeId>, DeclarationError> {
        self.resolve(name).map_err(|wrong| {
            let (file, at) = self.several[&unqualified(name)];
            in_file(&self.files[file], (at, wrong))
        })
    }

    /// Returns the type of this name, if only one file declares it.
    fn resolve(&self, name: &str) -> Result<Option<TypeId>, Wrong> {
        let key = unqualified(name);
        let Some((file, at)) = self.several.get(&key) else { return Ok(self.find(name)) };
        let first = &self.named[self.by_name[&key]];
        let place = |file: usize, at: TextPosition| -> Box<str> {
            format!("{}:{}:{}", self.files[file].display(), at.line, at.column).into()
        };
        Err(Wrong::SeveralTypes(first.name.as_str().into(), place(first.file, first.at), place(*file, *at)))
    }

    /// Returns the file that declares a type.
    pub fn file_of(&self, ty: TypeId) -> &Path {
        &self.files[self.of(ty).file]
    }

    /// Returns the name of the files in messages. A verb after the name is in the singular.
    pub fn title(&self) -> String {
        let first = self.files.first().map_or_else(String::new, |path| path.display().to_string());
        match self.files.len() {
            0 | 1 => first,
            2 => format!("{first} with another file"),
            count => format!("{first} with {} other files", count - 1),
        }
    }

    /// Returns the names of the structures, in the order of the files.
    pub fn structures(&self) -> impl Iterator<Item = &str> {
        let is_structure =
            |named: &&Named| matches!(&self.of(named.ty).ty, Type::Record(record) if !record.is_union);
        self.named.iter().filter(is_structure).map(|named| named.name.as_str())
    }

    /// Returns the own members of a structure or union. Other types have no members.
    pub fn members(&self, ty: TypeId) -> &[Member] {
        self.record(ty).map_or(&[], |record| &record.members)
    }

    /// Returns one sentence for each file with parts that were skipped.
    pub fn notes(&self) -> Vec<String> {
        let parts = self.skipped.chunk_by(|one, other| one.file == other.file);
        parts
            .map(|parts| {
                let named = parts.iter().take(MAX_NAMED);
                let mut names: Vec<_> =
                    named.map(|part| format!("{} in line {}", part.what, part.line)).collect();
                if parts.len() > MAX_NAMED {
                    names.push(format!("{} more", parts.len() - MAX_NAMED));
                }
                let file = self.files[parts[0].file].display();
                format!("{file}: skipped, because only types are read: {}", names.join(", "))
            })
            .collect()
    }

    fn record(&self, ty: TypeId) -> Option<&Record> {
        match &self.of(ty).ty {
            Type::Record(record) => Some(record),
            Type::Named(_) | Type::Array { .. } | Type::Unsized(_) => None,
        }
    }

    fn of(&self, id: TypeId) -> &Declared {
        &self.types[id.0]
    }

    /// Returns the index of the file that is read now.
    fn current_file(&self) -> usize {
        self.files.len().saturating_sub(1)
    }

    fn add_type(&mut self, at: TextPosition, ty: Type) -> TypeId {
        self.types.push(Declared { file: self.current_file(), at, ty });
        TypeId(self.types.len() - 1)
    }

    fn declare(&mut self, name: &str, at: TextPosition, ty: TypeId) -> Result<(), Fault> {
        let file = self.current_file();
        let key = name.to_ascii_lowercase();
        if let Some(first) = self.by_name.get(&key) {
            let first = &self.named[*first];
            if first.file == file {
                return Err((at, Wrong::Duplicate(name.to_owned(), first.at.to_string())));
            }
            self.several.entry(key).or_insert((file, at));
            return Ok(());
        }
        self.by_name.insert(key, self.named.len());
        self.named.push(Named { name: name.to_owned(), file, at, ty });
        Ok(())
    }

    fn declare_constant(&mut self, name: &str, value: Expression) {
        self.constants
            .entry(name.to_ascii_lowercase())
            .and_modify(|known| *known = Constant::Several)
            .or_insert(Constant::Once(value));
    }

    fn skip_part(&mut self, at: TextPosition, kind: &str, name: &str) {
        let what = printable(&format!("{kind} {name}"));
        self.skipped.push(SkippedPart { file: self.current_file(), line: at.line, what });
    }
}

/// Returns the text with `?` in place of each character that is not a letter, a digit or another printable character of
/// ASCII. Such a character may end a line, or change the direction of the text.
pub(crate) fn printable(text: &str) -> String {
    let is_printable = |sign: char| sign.is_alphanumeric() || sign.is_ascii_graphic() || sign == ' ';
    text.replace(|sign| !is_printable(sign), "?")
}

#[cfg(test)]
mod exports_tests;
/// Returns the last part of a name with namespaces, in lower case.
fn unqualified(name: &str) -> String {
    name.rsplit('.').next().unwrap_or(name).to_ascii_lowercase()
}

#[cfg(test)]
mod tests;
