//! Reasons for refusing the device of a folder.

use std::path::PathBuf;

/// Reason why a folder is not a device.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// A file of the layout is wrong; the message begins with file, line and column.
    #[error(transparent)]
    Layout(#[from] commram_layoutc::Error),
    /// A table of handshakes is wrong.
    #[error("{}:{line}: {what}", path.display())]
    Table {
        /// Path of the file of the folder that has the error.
        path: PathBuf,
        /// Line of the error in the file, from 1.
        line: usize,
        /// Description of the error, and of the correct form.
        what: String,
    },
    /// The script is wrong.
    #[error("{}:{line}: {what}", path.display())]
    Script {
        /// Path of the file of the folder that has the error.
        path: PathBuf,
        /// Line of the error in the file, from 1.
        line: usize,
        /// Description of the error, and of the correct form.
        what: String,
    },
    /// The folder has a script, but this library was built without feature `script`.
    #[error("{}: the device has a firmware.rhai; this library was built without the feature `script`", dir.display())]
    NoScripts {
        /// Path of the device's folder.
        dir: PathBuf,
    },
    /// The folder cannot be opened.
    #[error("{}: {reason}; name a folder with a device.toml", dir.display())]
    Missing {
        /// Path of the folder that cannot be read.
        dir: PathBuf,
        /// Error of the operating system.
        reason: std::io::Error,
    },
    /// The path contains control characters, or is not UTF-8.
    #[error("{}: the path of a device's folder is text in UTF-8 without control characters", dir.display())]
    BadPath {
        /// Path of the folder, which is not UTF-8 or has control characters.
        dir: PathBuf,
    },
    /// The folder lacks a file that devices read, and contains a file with a similar name.
    #[error("{}: no device reads a file of this name{hint}", path.display())]
    Misnamed {
        /// Path of the file with the unknown name.
        path: PathBuf,
        /// `; did you mean ...?`
        hint: String,
    },
    /// The device exceeds a limit.
    #[error("{}: the device has {count} {what}; a device in a folder has at most {most}", dir.display())]
    TooMuch {
        /// Path of the device's folder.
        dir: PathBuf,
        /// Plural of the items that are too many: "registers", "areas" ...
        what: &'static str,
        /// Number of items that exceeds the limit.
        count: u64,
        /// Largest number of these items in a device.
        most: u64,
    },
    /// A name is too long for its field in the header page.
    #[error("{}: the name '{name}' of {what} has {} bytes; it has at most {most}", dir.display(), name.len())]
    LongName {
        /// Path of the device's folder.
        dir: PathBuf,
        /// "the device" or "an area".
        what: &'static str,
        /// Name with too many bytes.
        name: String,
        /// Largest length of such a name, in bytes.
        most: usize,
    },
    /// A device of the program already has the name or the layout hash.
    #[error("{}: '{name}' has {what} of the device '{other}'; give it another name", dir.display())]
    Taken {
        /// Path of the device's folder.
        dir: PathBuf,
        /// "the name" or "the layout hash".
        what: &'static str,
        /// Name of the folder's device.
        name: String,
        /// Name of the device that already has this name or this layout hash.
        other: &'static str,
    },
    /// This process has already read the maximum number of folders.
    #[error("{}: this process has read {most} folders of devices; start another one", dir.display())]
    TooManyFolders {
        /// Path of the folder that exceeds the limit.
        dir: PathBuf,
        /// Largest number of folders that a process can read.
        most: usize,
    },
}
