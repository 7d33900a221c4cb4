//! A directory accessed through its descriptor only, so that no other process can exchange a part of its path.
//!
//! In a directory that others can write to, any file may be replaced by a link or a pipe. So files are opened without
//! following links and without waiting, and new files get an unused name.

#[cfg(feature = "emulator")]
pub(crate) mod writing;

use rustix::fs::{self, AtFlags, Mode, OFlags, Stat};
use rustix::io::Errno;
use std::fs::File;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};

/// Flags for opening a file. The open never waits, for example for the writer of a pipe.
const CAREFULLY: OFlags =
    OFlags::NOFOLLOW.union(OFlags::NONBLOCK).union(OFlags::NOCTTY).union(OFlags::CLOEXEC);

/// An open directory, which can be locked.
#[derive(Debug)]
pub(crate) struct Directory(File);

impl Directory {
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

    /// Opens the file `name` for reading.
    pub(crate) fn read(&self, name: &str) -> Result<File, Errno> {
        Ok(fs::openat(&self.0, name, OFlags::RDONLY | CAREFULLY, Mode::empty())?.into())
    }

    /// Opens the file `name` for reading and writing. Creates a missing file, accessible to this user only, and then also
    /// returns true.
    pub(crate) fn open_or_create(&self, name: &str) -> Result<(File, bool), Errno> {
        let open = |flags: OFlags| {
            let flags = OFlags::RDWR | CAREFULLY | flags;
            fs::openat(&self.0, name, flags, Mode::RUSR | Mode::WUSR).map(File::from)
        };
        loop {
            match open(OFlags::CREATE | OFlags::EXCL) {
                Err(Errno::EXIST) => {}
                created => return created.map(|file| (file, true)),
            }
            match open(OFlags::empty()) {
                // Another process has removed the file in the meantime.
                Err(Errno::NOENT) => {}
                opened => return opened.map(|file| (file, false)),
            }
        }
    }

    /// Returns a path to the directory for this process, valid even if the directory was renamed.
    pub(crate) fn path_by_descriptor(&self) -> PathBuf {
        format!("/proc/self/fd/{}", self.0.as_raw_fd()).into()
    }

    /// Removes the file `name`.
    pub(crate) fn remove(&self, name: &str) -> Result<(), Errno> {
        fs::unlinkat(&self.0, name, AtFlags::empty())
    }

    /// Returns the status of the entry `name`, of any type.
    pub(crate) fn stat_of(&self, name: &str) -> Result<Stat, Errno> {
        fs::statat(&self.0, name, AtFlags::SYMLINK_NOFOLLOW)
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
            let (file, is_new) = directory.open_or_create("new").unwrap();
            (file.metadata().unwrap().permissions().mode() & 0o777, is_new)
        };
        assert_eq!([mode(), mode()], [(0o600, true), (0o600, false)]);
    }
}
