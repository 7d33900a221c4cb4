//! Reasons why declarations cannot be imported.

use crate::declaration::DeclarationError;
use crate::error::{Error, Reason};
use std::path::PathBuf;

/// Reason why nothing was imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The layout has an error before the import.
    #[error("{0}")]
    Layout(#[from] Error),
    /// The declarations cannot be parsed, or a required type has no size.
    #[error("{0}")]
    Declaration(#[from] DeclarationError),
    /// The file declares none of the layout's structures.
    #[error("{path} declares none of the layout's structures ({known}); its structures: {declared}")]
    NothingDeclared {
        /// The file with the declarations.
        path: String,
        /// Names of the structures of the layout.
        known: String,
        /// Names of the structures that the file declares.
        declared: String,
    },
    /// A pair of names of which one name does not exist.
    #[error("`{ours}={theirs}`: {right}")]
    Called {
        /// Name of a structure or register in the layout.
        ours: String,
        /// Name of a structure or register in the declarations.
        theirs: String,
        /// Text about the right names.
        right: String,
    },
    /// Several structures share a part, and would need different offsets in it.
    #[error(
        "`{register}` of `{part}` would be at offset {offset} for {user}, but at {other_offset} for {other}, \
         and the layout has `{part}` once for both{why}"
    )]
    Conflict {
        /// Name of the shared sub-structure or block.
        part: String,
        /// The register with different offsets, or `size`.
        register: String,
        /// First user of the part.
        user: String,
        /// Offset for the second user.
        offset: u32,
        /// Second user of the part.
        other: String,
        /// Offset for the second user.
        other_offset: u32,
        /// Reason why the layout contains the part only once: the rest of the sentence.
        why: &'static str,
    },
    /// The device has no library of types, so no declarations can state its offsets.
    #[error(
        "{path} cannot confirm the offsets of `{device}`: the layout names no library of the vendor that declares its \
         structures"
    )]
    NoLibrary {
        /// The file with the declarations.
        path: String,
        /// Name of the device, which has no library of types.
        device: String,
    },
    /// The library of another device has confirmed another offset of a shared register.
    #[error(
        "{}: `{register}` of `{structure}` would move from {before} to {after}, but {} has {before} from `{library}`, and \
         both devices use the structure; nothing is imported",
        .path.display(),
        .confirmed.display()
    )]
    Confirmed {
        /// The file with the declarations.
        path: PathBuf,
        /// Name of the shared structure, sub-structure or block.
        structure: String,
        /// Name of the register that would move, or `size` for the end of the structure.
        register: Box<str>,
        /// Offset in the layout, in bytes.
        before: u32,
        /// Offset in the declarations, in bytes.
        after: u32,
        /// The file with confirmed offsets.
        confirmed: PathBuf,
        /// The origin of the confirmed offsets, as the file names it.
        library: Box<str>,
    },
    /// The offsets would give an invalid layout.
    #[error("the layout would be refused with these offsets: {0}")]
    Refused(Box<Reason>),
    /// A file cannot be edited in its present form.
    #[error("{}: write the registers of `{name}` as a list of inline tables, one per line", .path.display())]
    Form {
        /// Path of the file of the layout that cannot be edited.
        path: PathBuf,
        /// Name of the structure in this file.
        name: String,
    },
}
