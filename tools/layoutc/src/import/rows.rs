//! Report of an import.

use serde::Serialize;
use std::fmt;

/// Result of the comparison of a register with its declaration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The import does not change the offset of the register, or the size of the structure.
    Same,
    /// The register has another offset, or the structure another size.
    Moved,
    /// The import does not change the offset of the register. The declaration has another elementary type of equal
    /// width, and the layout keeps its type.
    Type,
    /// Only the declaration contains the register: the layout gets padding in its place.
    New,
    /// Only the layout contains the register.
    Missing,
    /// The register has another width or other array bounds, or is a structure in only one of layout and declaration.
    Unlike,
    /// The file does not declare the structure.
    Undeclared,
    /// The structure has a missing or different register, so its file stays unchanged.
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
    /// Offset in the layout in bytes. For an array, the offset of the first element; for a structure, its size.
    pub before: Option<u32>,
    /// Offset or size in the declaration.
    pub after: Option<u32>,
    /// Additional remark in the row.
    pub remark: String,
}
