//! The directory of the NOVRAM files: one emulator at a time, regular files of a bounded size, no links followed.
//!
//! Everything goes through the open directory, so that nothing on the way there can be exchanged meanwhile.

use super::NovramError;
use rustix::fs::{self, AtFlags, FileType, FlockOperation, Mode, OFlags};
use rustix::io::Errno;
use std::fs::{DirBuilder, File};
use std::io::{self, Read, Write};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How long a starting emulator waits for the lock: its holder may have been killed a moment ago and not be gone yet.
const PATIENCE: Duration = Duration::from_millis(500);

/// A directory that is locked for as long as this value lives.
#[derive(Debug)]
pub struct Directory {
    path: PathBuf,
    handle: File,
}

impl Directory {
    /// Opens and locks a directory, which is made if missing, for this user alone.
    ///
    /// # Errors
    /// [`NovramError::InUse`] if another emulator has it, [`NovramError::Io`] if it cannot be made or used.
    pub fn open(path: &Path) -> Result<Self, NovramError> {
        let failed = |doing| move |source| NovramError::Io { path: path.to_owned(), doing, source };
        DirBuilder::new().recursive(true).mode(0o700).create(path).map_err(failed("make this directory"))?;
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
        let handle = fs::open(path, flags, Mode::empty())
            .map_err(|errno| failed("open this directory")(errno.into()))?;
        let since = Instant::now();
        loop {
            match fs::flock(&handle, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => return Ok(Directory { path: path.to_owned(), handle: handle.into() }),
                Err(Errno::INTR) => {}
                Err(Errno::WOULDBLOCK) if since.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(Errno::WOULDBLOCK) => return Err(NovramError::InUse { path: path.to_owned() }),
                Err(errno) => return Err(failed("lock this directory")(errno.into())),
            }
        }
    }

    /// Path of a file in it.
    pub(super) fn path_of(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The content of a file; one byte more than `longest` if it is longer than that. `None`: there is none.
    pub(super) fn read(&self, name: &str, longest: usize) -> Result<Option<Vec<u8>>, NovramError> {
        // NONBLOCK: a pipe under this name must be refused, not waited for.
        let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
        let file = match fs::openat(&self.handle, name, flags, Mode::empty()) {
            Ok(file) => File::from(file),
            Err(Errno::NOENT) => return Ok(None),
            Err(Errno::LOOP) => return Err(self.not_a_file(name, FileType::Symlink)),
            // What a socket and a device without a driver answer.
            Err(Errno::NXIO | Errno::NODEV) => return Err(self.not_a_file(name, FileType::Unknown)),
            Err(errno) => return Err(self.failed(name, "read it")(errno.into())),
        };
        let stat = fs::fstat(&file).map_err(|errno| self.failed(name, "look at it")(errno.into()))?;
        match FileType::from_raw_mode(stat.st_mode) {
            FileType::RegularFile => {}
            other => return Err(self.not_a_file(name, other)),
        }
        let mut bytes = Vec::with_capacity(longest + 1);
        file.take(longest as u64 + 1).read_to_end(&mut bytes).map_err(self.failed(name, "read it"))?;
        Ok(Some(bytes))
    }

    /// Puts a file with this content in the place of the one of this name: a new file, synced, renamed over the old
    /// one, directory synced. Whatever goes wrong, no other file stays. A directory that has gone is made again.
    pub(super) fn replace(&mut self, name: &str, bytes: &[u8]) -> Result<(), NovramError> {
        let mut result = self.try_replace(name, bytes);
        if result == Err(Errno::NOENT) {
            *self = Self::open(&self.path)?;
            result = self.try_replace(name, bytes);
        }
        result.map_err(|errno| self.failed(name, "write it")(errno.into()))
    }

    /// Tries whether such a content could be written, and leaves everything as it is.
    pub(super) fn probe(&self, name: &str, bytes: &[u8]) -> Result<(), NovramError> {
        self.with_new(name, bytes, |new| fs::unlinkat(&self.handle, new, AtFlags::empty()))
            .map_err(|errno| self.failed(name, "write it")(errno.into()))
    }

    fn try_replace(&self, name: &str, bytes: &[u8]) -> Result<(), Errno> {
        self.with_new(name, bytes, |new| fs::renameat(&self.handle, new, &self.handle, name))?;
        fs::fsync(&self.handle)
    }

    /// Writes `<name>.new`, gives it to `then`, and removes it if either fails.
    fn with_new(
        &self,
        name: &str,
        bytes: &[u8],
        then: impl FnOnce(&str) -> Result<(), Errno>,
    ) -> Result<(), Errno> {
        let new = format!("{name}.new");
        // A killed emulator may have left one. It is not written to: it may be a link.
        match fs::unlinkat(&self.handle, &new, AtFlags::empty()) {
            Ok(()) | Err(Errno::NOENT) => {}
            Err(errno) => return Err(errno),
        }
        let flags = OFlags::CREATE | OFlags::EXCL | OFlags::WRONLY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let mut file = File::from(fs::openat(&self.handle, &new, flags, Mode::RUSR | Mode::WUSR)?);
        let written = file.write_all(bytes).and_then(|()| file.sync_all()).map_err(|error| errno(&error));
        let result = written.and_then(|()| then(&new));
        if result.is_err() {
            // It may have its final name by now, or the directory has gone.
            let _ = fs::unlinkat(&self.handle, &new, AtFlags::empty());
        }
        result
    }

    /// Renames a file that cannot be used to the first free `<name>.bad-<n>`.
    pub(super) fn set_aside(&self, name: &str) -> Result<PathBuf, NovramError> {
        for n in 1u32.. {
            let aside = format!("{name}.bad-{n}");
            // A hard link fails if the name is taken, a rename would replace it.
            match fs::linkat(&self.handle, name, &self.handle, &aside, AtFlags::empty()) {
                Ok(()) => {
                    fs::unlinkat(&self.handle, name, AtFlags::empty())
                        .map_err(|errno| self.failed(name, "set it aside")(errno.into()))?;
                    return Ok(self.path_of(&aside));
                }
                Err(Errno::EXIST) => {}
                Err(errno) => return Err(self.failed(name, "set it aside")(errno.into())),
            }
        }
        unreachable!("a directory does not hold 2^32 files")
    }

    fn failed(&self, name: &str, doing: &'static str) -> impl Fn(io::Error) -> NovramError + use<> {
        let path = self.path_of(name);
        move |source| NovramError::Io { path: path.clone(), doing, source }
    }

    fn not_a_file(&self, name: &str, found: FileType) -> NovramError {
        let found = match found {
            FileType::Symlink => "a symbolic link",
            FileType::Directory => "a directory",
            FileType::Fifo => "a pipe",
            FileType::CharacterDevice | FileType::BlockDevice => "a device",
            _ => "something else",
        };
        NovramError::NotAFile { path: self.path_of(name), found }
    }
}

fn errno(error: &io::Error) -> Errno {
    // `write_all` alone makes up an error of its own, if nothing can be written at all.
    Errno::from_io_error(error).unwrap_or(Errno::NOSPC)
}
