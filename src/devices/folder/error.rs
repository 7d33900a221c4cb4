//! Reasons for refusing the device of a folder.

use std::path::PathBuf;

/// Reason for which a folder is not a device.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// A file of the layout is wrong; the message begins with file, line and column.
    #[error(transparent)]
    Layout(#[from] commram_layoutc::Error),
    /// A table of handshakes is wrong.
    #[error("{}:{line}: {what}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// Description of the error, and of the correct form.
        what: String,
    },
    /// The script is wrong.
    #[error("{}:{line}: {what}", path.display())]
    Script {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// Description of the error, and of the correct form.
        what: String,
    },
    /// The folder has a script, but this library was built without feature `script`.
    #[error("{}: the device has a firmware.rhai; this library was built without the feature `script`", dir.display())]
    NoScripts {
        /// The folder.
        dir: PathBuf,
    },
    /// The folder cannot be opened.
    #[error("{}: {reason}; name a folder with a device.toml", dir.display())]
    Missing {
        /// The folder.
        dir: PathBuf,
        /// Cause of the error.
        reason: std::io::Error,
    },
    /// The path has control characters, or is not text.
    #[error("{}: the path of a device's folder is text in UTF-8 without control characters", dir.display())]
    BadPath {
        /// The folder.
        dir: PathBuf,
    },
    /// A file has nearly the name of a file that devices read, and the folder does not have that file.
    #[error("{}: no device reads a file of this name{hint}", path.display())]
    Misnamed {
        /// The file.
        path: PathBuf,
        /// `; did you mean ...?`
        hint: String,
    },
    /// The device exceeds a limit.
    #[error("{}: the device has {count} {what}; a device in a folder has at most {most}", dir.display())]
    TooMuch {
        /// The folder.
        dir: PathBuf,
        /// "registers", "areas" ...
        what: &'static str,
        /// Number of items that exceeds the limit.
        count: u64,
        /// The limit.
        most: u64,
    },
    /// A name is too long for the header page.
    #[error("{}: the name '{name}' of {what} has {} bytes; it has at most {most}", dir.display(), name.len())]
    LongName {
        /// The folder.
        dir: PathBuf,
        /// "the device" or "an area".
        what: &'static str,
        /// The name.
        name: String,
        /// The limit in bytes.
        most: usize,
    },
    /// The name or the hash belongs to a device of the program.
    #[error("{}: '{name}' has {what} of the device '{other}'; give it another name", dir.display())]
    Taken {
        /// The folder.
        dir: PathBuf,
        /// "the name" or "the layout hash".
        what: &'static str,
        /// Name of the folder's device.
        name: String,
        /// The owner.
        other: &'static str,
    },
    /// This process has already read as many folders as it can.
    #[error("{}: this process has read {most} folders of devices; start another one", dir.display())]
    TooManyFolders {
        /// The folder.
        dir: PathBuf,
        /// The limit.
        most: usize,
    },
}
