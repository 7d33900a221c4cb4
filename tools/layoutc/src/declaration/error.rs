//! Errors in a declaration, with their places.

use crate::error::Location;
use std::fmt;
use std::path::Path;

/// A declaration that cannot be used: place and reason. Printed as `file:line:column: reason`.
#[derive(Debug, thiserror::Error)]
#[error("{at}: {reason}")]
pub struct DeclarationError {
    /// Place of the error in the file of declarations.
    pub at: Location,
    /// Kind of the error, with the correct form.
    pub reason: Wrong,
}

/// A place in the text: line and column in characters, both from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TextPosition {
    /// Number of the line, from 1.
    pub line: usize,
    /// Number of the column, from 1.
    pub column: usize,
}

impl TextPosition {
    /// The first character of a text.
    pub(crate) const BEGIN: Self = Self { line: 1, column: 1 };

    /// Moves the position past the character `c`.
    pub(crate) fn advance(&mut self, c: char) {
        match c {
            '\n' => *self = Self { line: self.line + 1, column: 1 },
            _ => self.column += 1,
        }
    }
}

impl fmt::Display for TextPosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// A reason with its place, before the file is known.
pub(crate) type Fault = (TextPosition, Wrong);

/// Adds the file to the place of a fault.
pub(crate) fn in_file(file: &Path, (place, reason): Fault) -> DeclarationError {
    let at = Location { file: file.to_owned(), line: place.line, column: place.column };
    DeclarationError { at, reason }
}

/// The kinds of wrong declarations.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "each message says it all")]
pub enum Wrong {
    #[error("cannot read this file: {0}")]
    Unreadable(String),
    #[error("the file has more than {} MiB", .0 >> 20)]
    TooLong(u64),
    #[error("the files have more than {} MiB together", .0 >> 20)]
    TooLongTogether(u64),
    #[error("this is no well-formed XML: {0}")]
    Xml(String),
    #[error("the elements of this XML are nested more than {0} deep")]
    DeepXml(usize),
    #[error(
        "`{0}` is no XML with declarations; export PLCopen XML, an object of TwinCAT (.TcDUT) or plain text"
    )]
    OtherXml(String),
    #[error("`<{0}>` needs the attribute `{1}`")]
    NoAttribute(&'static str, &'static str),
    #[error("`<{0}>` has no type")]
    NoType(&'static str),
    #[error("`{0}` is not allowed in a declaration")]
    Character(char),
    #[error("`*)` without a comment before it")]
    NoComment,
    #[error("this {0} has no end")]
    Unfinished(&'static str),
    #[error("expected {expected}, found {found}")]
    Unexpected { expected: &'static str, found: String },
    #[error("`{0}` is a keyword, not a name")]
    Keyword(String),
    #[error("type definitions are nested more than {0} deep")]
    TooDeep(usize),
    #[error("`{0}` is already declared at {1}; names do not distinguish upper and lower case")]
    Duplicate(String, String),
    #[error("`{0}` is no array bound; bounds are whole numbers")]
    BadBound(String),
    #[error("`{0}` is no constant of the given files; add the file that declares it")]
    UnknownConstant(String),
    #[error("the constant `{0}` is declared more than once")]
    SeveralConstants(String),
    #[error("the constant `{0}` depends on itself")]
    CircularConstant(String),
    #[error("the constant `{0}` depends on others more than {1} deep")]
    DeepConstant(String, usize),
    #[error("this expression has more than {0} parts")]
    LongExpression(usize),
    #[error("the array's bounds {first}..{last} must ascend and hold at most 16777216 elements")]
    Bounds { first: i64, last: i64 },
    #[error(
        "`{0}` is neither an elementary type nor declared in the given files; add the file that declares it"
    )]
    UnknownType(String),
    #[error("`{0}` is declared at {1} and at {2}; name only one of these files")]
    SeveralTypes(Box<str>, Box<str>, Box<str>),
    #[error("`{0}` is no structure of the given files; add the file that declares it")]
    UnknownBase(String),
    #[error("this member has its own address, which is not read; declare the structure without AT")]
    OwnAddress,
    #[error("the size of {0} is not fixed by IEC 61131-3, so no offset after it is known")]
    NoSize(String),
    #[error("`{0}` contains itself")]
    Circular(String),
    #[error("this type is nested more than {0} deep")]
    DeepType(usize),
    #[error("this type has more than {} MiB", .0 >> 20)]
    TooLarge(u32),
}
