//! Errors of NOVRAM files.

use crate::memory::MemoryError;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Error of a NOVRAM file or its directory.
#[derive(Debug, Error)]
pub enum NovramError {
    /// The operating system refuses the operation.
    #[error("NOVRAM {}: cannot {doing}: {source}; --novram needs a writable directory", path.display())]
    Io {
        /// Path of the file or directory for which the operation failed.
        path: PathBuf,
        /// The operation that failed, for example "open it".
        doing: &'static str,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Another emulator uses the directory for its NOVRAM.
    #[error(
        "NOVRAM {}: another emulator uses this directory; give each instance a separate one",
        path.display()
    )]
    InUse {
        /// Path of the directory that another emulator uses.
        path: PathBuf,
    },
    /// Two PLCs would have one file, because the file system does not distinguish upper and lower case.
    #[error(
        "NOVRAM {}: the file system does not distinguish upper and lower case, so the PLCs '{one}' and '{other}' would have \
         one file; rename one of them, or use another file system",
        path.display()
    )]
    Namesakes {
        /// Path of the directory.
        path: PathBuf,
        /// Name of a PLC.
        one: String,
        /// Name of the other PLC.
        other: String,
    },
    /// The directory belongs to another user, and that user could exchange the files.
    #[error(
        "NOVRAM {}: this directory belongs to user {owner}, not to user {user}; use one of your own, mode 0700",
        path.display()
    )]
    Foreign {
        /// Path of the directory that belongs to another user.
        path: PathBuf,
        /// User id of the directory's owner.
        owner: u32,
        /// User id of this process.
        user: u32,
    },
    /// Other users can write to the directory.
    #[error(
        "NOVRAM {}: others can write to this directory (mode {mode:o}) and exchange its files; use a separate \
            directory, or remove this right with `chmod go-w`",
        path.display()
    )]
    Writable {
        /// Path of the directory to which other users can write.
        path: PathBuf,
        /// Permission bits of the directory.
        mode: u32,
    },
    /// The file is not a regular file.
    #[error(
        "NOVRAM {}: this is {found}; it must be a regular file, or missing for the delivery state",
        path.display()
    )]
    NotAFile {
        /// Path at which a NOVRAM file should be.
        path: PathBuf,
        /// Type of the object at the path, for example "a directory".
        found: &'static str,
    },
    /// The file has another version.
    #[error(
        "NOVRAM {}: the file has version {found}, this commram ({}) reads version {read}; use the commram that has \
         written it, or move the file away for the delivery state",
        path.display(), env!("CARGO_PKG_VERSION")
    )]
    OtherVersion {
        /// Path of the NOVRAM file that has another version.
        path: PathBuf,
        /// Version of the file format in the file.
        found: u32,
        /// Version that this program reads.
        read: u32,
    },
    /// The last attempt to write has failed, too.
    #[error("the last changes are lost, and there is no further attempt: {source}")]
    Lost {
        /// Error of the last attempt to write.
        source: Box<NovramError>,
    },
    /// An access to the RAM is refused.
    #[error(transparent)]
    Memory(#[from] MemoryError),
}
