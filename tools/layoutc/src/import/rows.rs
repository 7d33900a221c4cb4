//! Report of an import.

use serde::Serialize;
use std::fmt;

/// How a register of the layout and its declaration compare.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// At the same offset; a structure of the same size.
    Same,
    /// At another offset; a structure of another size.
    Moved,
    /// At the same offset, but of another elementary type of the same width; the layout keeps its own.
    Type,
    /// Only in the declaration: the layout gets padding for it.
    New,
    /// Only in the layout.
    Missing,
    /// Another width, other array bounds, or a structure in one of them only.
    Unlike,
    /// A structure that the file does not declare.
    Undeclared,
    /// A structure with something missing or unlike: its file stays as it is.
    Left,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Verdict::Same => "same",
            Verdict::Moved => "moved",
            Verdict::Type => "type",
            Verdict::New => "new",
            Verdict::Missing => "missing",
            Verdict::Unlike => "unlike",
            Verdict::Undeclared => "undeclared",
            Verdict::Left => "left",
        })
    }
}

/// A register, or with an empty `member` a structure.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Row {
    /// The structure's name in the layout.
    pub structure: String,
    /// The register's path in the structure, without indices; empty for the structure itself.
    pub member: String,
    /// How it compares.
    pub verdict: Verdict,
    /// Offset in the layout, of arrays that of the first element; of a structure its size. In bytes.
    pub before: Option<u32>,
    /// Offset or size in the declaration.
    pub after: Option<u32>,
    /// Additional remark.
    pub remark: String,
}
