//! Report of an import.

use serde::Serialize;
use std::fmt;

/// Result of the comparison of a register with its declaration.
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
    /// Another width, other array bounds, or a structure in only one of layout and declaration.
    Unlike,
    /// A structure that the file does not declare.
    Undeclared,
    /// A structure with a missing or different register: its file stays unchanged.
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
    /// Result of the comparison.
    pub verdict: Verdict,
    /// Offset in the layout in bytes, for an array of the first element; for a structure its size.
    pub before: Option<u32>,
    /// Offset or size in the declaration.
    pub after: Option<u32>,
    /// Additional remark.
    pub remark: String,
}
