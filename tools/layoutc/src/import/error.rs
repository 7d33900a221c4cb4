//! Reasons why declarations cannot be imported.

use crate::declaration::DeclarationError;
use crate::error::{Error, Reason};
use std::path::PathBuf;

/// Reason why nothing was imported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The layout is wrong as it is.
    #[error("{0}")]
    Layout(#[from] Error),
    /// The declarations do not parse, or a required type has no size.
    #[error("{0}")]
    Declaration(#[from] DeclarationError),
    /// The file declares none of the layout's structures.
    #[error("{path} declares none of the layout's structures ({known}); its structures: {declared}")]
    NothingDeclared {
        /// The declarations.
        path: String,
        /// Structures of the layout.
        known: String,
        /// Structures of the file.
        declared: String,
    },
    /// A pair of names of which one does not exist.
    #[error("`{ours}={theirs}`: {right}")]
    Called {
        /// The layout's name.
        ours: String,
        /// The declaration's name.
        theirs: String,
        /// The error, with the correct form.
        right: String,
    },
    /// A part that several structures share would need different offsets in them.
    #[error(
        "`{register}` of `{part}` would be at offset {offset} for {user}, but at {other_offset} for {other}, \
         and the layout has `{part}` once for both{why}"
    )]
    Conflict {
        /// The sub-structure or block.
        part: String,
        /// The register that lies differently, or `size`.
        register: String,
        /// Where it is used.
        user: String,
        /// Offset there.
        offset: u32,
        /// Where it is used too.
        other: String,
        /// Offset there.
        other_offset: u32,
        /// Reason why the layout has the part once: the rest of the sentence.
        why: &'static str,
    },
    /// The device has no library of types, so no declarations can state its offsets.
    #[error(
        "{path} cannot confirm the offsets of `{device}`: the layout names no library of the vendor that declares its \
         structures"
    )]
    NoLibrary {
        /// The declarations.
        path: String,
        /// Name of the device.
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
        /// The declarations.
        path: PathBuf,
        /// The shared structure, sub-structure or block.
        structure: String,
        /// The register, or `size`.
        register: Box<str>,
        /// Offset in the layout.
        before: u32,
        /// Offset in the declarations.
        after: u32,
        /// The file with confirmed offsets.
        confirmed: PathBuf,
        /// The origin of the confirmed offsets, as the file names it.
        library: Box<str>,
    },
    /// The result would be an incorrect layout.
    #[error("the layout would be refused with these offsets: {0}")]
    Refused(Box<Reason>),
    /// A file cannot be edited in its present form.
    #[error("{}: write the registers of `{name}` as a list of inline tables, one per line", .path.display())]
    Form {
        /// The file.
        path: PathBuf,
        /// The structure.
        name: String,
    },
}
