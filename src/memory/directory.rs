//! A directory accessed through its descriptor only, so that no other process can exchange a part of its path.
//!
//! In a directory that others can write to, any file may be replaced by a link or a pipe. So files are opened without
//! following links and without waiting, and new files get an unused name.

use rustix::fs::{self, AtFlags, Mode, OFlags, Stat};
use rustix::io::Errno;
use std::fs::File;
#[cfg(feature = "emulator")]
use std::io;
#[cfg(feature = "emulator")]
use std::io::Write;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

/// Flags for opening a file. The open never waits, for example for the writer of a pipe.
const CAREFULLY: OFlags =
    OFlags::NOFOLLOW.union(OFlags::NONBLOCK).union(OFlags::NOCTTY).union(OFlags::CLOEXEC);

/// An open directory, which can be locked.
#[derive(Debug)]
pub(crate) struct Directory(File);

impl Directory {
    /// Opens the directory that `path` leads to.
    #[cfg(feature = "emulator")]
    pub(crate) fn open(path: &Path) -> Result<Self, Errno> {
        Self::open_with(path, OFlags::empty())
    }

    /// Opens the directory at `path`; refuses a link.
    pub(crate) fn open_itself(path: &Path) -> Result<Self, Errno> {
        Self::open_with(path, OFlags::NOFOLLOW)
    }

    fn open_with(path: &Path, flags: OFlags) -> Result<Self, Errno> {
        let flags = flags | OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
        Ok(Self(fs::open(path, flags, Mode::empty())?.into()))
    }

    /// Owner, mode and identity.
    pub(crate) fn stat(&self) -> Result<Stat, Errno> {
        fs::fstat(&self.0)
    }

    /// Removes all rights of other users.
    pub(crate) fn close_to_others(&self) -> Result<(), Errno> {
        fs::fchmod(&self.0, Mode::RWXU)
    }

    /// Takes the directory's lock; `false` if another process has it.
    #[cfg(feature = "channel")]
    pub(crate) fn try_lock(&self) -> io::Result<bool> {
        try_lock(&self.0)
    }

    /// Releases the lock of the directory.
    #[cfg(feature = "channel")]
    pub(crate) fn unlock(&self) -> io::Result<()> {
        self.0.unlock()
    }

    /// Opens the file `name` for reading.
    pub(crate) fn read(&self, name: &str) -> Result<File, Errno> {
        Ok(fs::openat(&self.0, name, OFlags::RDONLY | CAREFULLY, Mode::empty())?.into())
    }

    /// Opens the file `name` for reading and writing. Creates a missing file, accessible to this user only.
    pub(crate) fn read_write(&self, name: &str) -> Result<File, Errno> {
        let flags = OFlags::RDWR | OFlags::CREATE | CAREFULLY;
        Ok(fs::openat(&self.0, name, flags, Mode::RUSR | Mode::WUSR)?.into())
    }

    /// Writes a new file, accessible to this user only, and passes it to `then`, which gives it the final name. If the
    /// writing or `then` fails, removes the file. A reader of the final name sees the old content or the complete new
    /// one.
    #[cfg(feature = "emulator")]
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
    #[cfg(feature = "emulator")]
    pub(crate) fn rename(&self, from: &str, to: &str) -> Result<(), Errno> {
        fs::renameat(&self.0, from, &self.0, to)
    }

    /// Renames the file `from` to `to`, unless `to` exists.
    #[cfg(feature = "emulator")]
    pub(crate) fn rename_to_free(&self, from: &str, to: &str) -> Result<(), Errno> {
        // `rename` would replace an existing file.
        fs::linkat(&self.0, from, &self.0, to, AtFlags::empty())?;
        self.remove(from)
    }

    /// Returns a path to the directory for this process, valid even if the directory was renamed.
    pub(crate) fn path_by_descriptor(&self) -> PathBuf {
        format!("/proc/self/fd/{}", self.0.as_raw_fd()).into()
    }

    /// Removes the file `name`.
    pub(crate) fn remove(&self, name: &str) -> Result<(), Errno> {
        fs::unlinkat(&self.0, name, AtFlags::empty())
    }

    /// Writes the directory entries to the disk.
    #[cfg(feature = "emulator")]
    pub(crate) fn sync(&self) -> Result<(), Errno> {
        fs::fsync(&self.0)
    }

    /// Returns the status of the entry `name`, of any type.
    pub(crate) fn stat_of(&self, name: &str) -> Result<Stat, Errno> {
        fs::statat(&self.0, name, AtFlags::SYMLINK_NOFOLLOW)
    }
}

/// Takes the lock of a file or directory; `false` if another process has it.
#[cfg(feature = "emulator")]
pub(crate) fn try_lock(file: &File) -> io::Result<bool> {
    match file.try_lock() {
        Ok(()) => Ok(true),
        Err(std::fs::TryLockError::WouldBlock) => Ok(false),
        Err(std::fs::TryLockError::Error(error)) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn new_files_are_for_this_user_alone() {
        let parent = tempfile::tempdir().unwrap();
        let directory = Directory::open_itself(parent.path()).unwrap();
        let mode = || {
            let file = directory.read_write("new").unwrap();
            file.metadata().unwrap().permissions().mode() & 0o777
        };
        assert_eq!([mode(), mode()], [0o600; 2], "made, and then opened");
    }
}
