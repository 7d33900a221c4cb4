//! Writing of files into a directory, and locks: only emulators use them.

use super::{CAREFULLY, Directory};
use rustix::fs::{self, AtFlags, Mode, OFlags};
use rustix::io::Errno;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

impl Directory {
    /// Opens the directory that `path` leads to.
    pub(crate) fn open(path: &Path) -> Result<Self, Errno> {
        Self::open_with(path, OFlags::empty())
    }

    /// Writes a new file, accessible to this user only, and passes it to `then`, which gives it the final name. If the
    /// writing or `then` fails, removes the file. A reader of the final name sees the old content or the complete new
    /// one.
    pub(crate) fn with_new(
        &self,
        new: &str,
        content: &[u8],
        then: impl FnOnce(&File) -> io::Result<()>,
    ) -> io::Result<()> {
        let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL | CAREFULLY;
        let mut file = File::from(fs::openat(&self.0, new, flags, Mode::RUSR | Mode::WUSR)?);
        file.write_all(content).and_then(|()| then(&file)).inspect_err(|_| {
            let _ = self.remove(new);
        })
    }

    /// Renames the file `from` to `to`; replaces an existing file.
    pub(crate) fn rename(&self, from: &str, to: &str) -> Result<(), Errno> {
        fs::renameat(&self.0, from, &self.0, to)
    }

    /// Renames the file `from` to `to`, unless `to` exists.
    pub(crate) fn rename_to_free(&self, from: &str, to: &str) -> Result<(), Errno> {
        // `rename` would replace an existing file.
        match fs::linkat(&self.0, from, &self.0, to, AtFlags::empty()) {
            Ok(()) => self.remove(from),
            Err(Errno::EXIST) => Err(Errno::EXIST),
            // A file system without hard links: `rename` replaces an empty file that no other process has created.
            Err(_) => {
                let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL | CAREFULLY;
                fs::openat(&self.0, to, flags, Mode::RUSR | Mode::WUSR)?;
                self.rename(from, to).inspect_err(|_| {
                    let _ = self.remove(to);
                })
            }
        }
    }

    /// Writes the directory entries to the disk. Some file systems, such as shared folders of virtual machines, have no such
    /// operation for directories.
    pub(crate) fn sync(&self) -> Result<(), Errno> {
        match fs::fsync(&self.0) {
            Err(Errno::INVAL | Errno::OPNOTSUPP) => Ok(()),
            synced => synced,
        }
    }
}

/// The lock of the directory of a channel.
#[cfg(feature = "channel")]
impl Directory {
    /// Takes the directory's lock; `false` if another process has it.
    pub(crate) fn try_lock(&self) -> io::Result<bool> {
        try_lock(&self.0)
    }

    /// Releases the lock of the directory.
    pub(crate) fn unlock(&self) -> io::Result<()> {
        self.0.unlock()
    }
}

/// Takes the lock of a file or directory; `false` if another process has it.
pub(crate) fn try_lock(file: &File) -> io::Result<bool> {
    match file.try_lock() {
        Ok(()) => Ok(true),
        Err(std::fs::TryLockError::WouldBlock) => Ok(false),
        Err(std::fs::TryLockError::Error(error)) => Err(error),
    }
}
