//! The directory of the NOVRAM files: one emulator at a time, regular files of a bounded size, no links followed.

use super::NovramError;
use crate::memory::directory;
use rustix::fs::{FileType, Stat};
use rustix::io::Errno;
use std::fs::DirBuilder;
use std::io::{self, Read};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How long a starting emulator waits for the lock: its holder may have been killed a moment ago and not be gone yet.
const PATIENCE: Duration = Duration::from_millis(500);

/// The right of others to write, in a mode.
const OTHERS_WRITE: u32 = 0o022;

/// A directory that is locked for as long as this value lives.
#[derive(Debug)]
pub struct Directory {
    path: PathBuf,
    open: directory::Directory,
}

impl Directory {
    /// Opens and locks a directory, which is made if missing, for this user alone.
    ///
    /// # Errors
    /// [`NovramError::InUse`] if another emulator has it, [`NovramError::Foreign`] and [`NovramError::Writable`] if
    /// others could put their files there, [`NovramError::Io`] if it cannot be made or used.
    pub fn open(path: &Path) -> Result<Self, NovramError> {
        let failed = |doing| move |source| NovramError::Io { path: path.to_owned(), doing, source };
        DirBuilder::new().recursive(true).mode(0o700).create(path).map_err(failed("make this directory"))?;
        let open =
            directory::Directory::open(path).map_err(|errno| failed("open this directory")(errno.into()))?;
        let stat = open.stat().map_err(|errno| failed("look at this directory")(errno.into()))?;
        judge(path, &stat, rustix::process::geteuid().as_raw())?;
        let since = Instant::now();
        loop {
            match open.try_lock() {
                Ok(true) => return Ok(Directory { path: path.to_owned(), open }),
                Ok(false) if since.elapsed() < PATIENCE => std::thread::sleep(Duration::from_millis(1)),
                Ok(false) => return Err(NovramError::InUse { path: path.to_owned() }),
                Err(error) => return Err(failed("lock this directory")(error)),
            }
        }
    }

    /// Path of a file in it.
    pub(super) fn path_of(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The content of a file; one byte more than `longest` if it is longer than that. `None`: there is none.
    pub(super) fn read(&self, name: &str, longest: usize) -> Result<Option<Vec<u8>>, NovramError> {
        let file = match self.open.read(name) {
            Ok(file) => file,
            Err(Errno::NOENT) => return Ok(None),
            Err(Errno::LOOP) => return Err(self.not_a_file(name, FileType::Symlink)),
            // What a socket and a device without a driver answer.
            Err(Errno::NXIO | Errno::NODEV) => return Err(self.not_a_file(name, FileType::Unknown)),
            Err(errno) => return Err(self.failed(name, "read it")(errno.into())),
        };
        let stat = rustix::fs::fstat(&file).map_err(|errno| self.failed(name, "look at it")(errno.into()))?;
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
        if result.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
            *self = Self::open(&self.path)?;
            result = self.try_replace(name, bytes);
        }
        result.map_err(self.failed(name, "write it"))
    }

    /// Tries whether such a content could be written, and leaves everything as it is.
    pub(super) fn probe(&self, name: &str, bytes: &[u8]) -> Result<(), NovramError> {
        self.with_new(name, bytes, |new| self.open.remove(new)).map_err(self.failed(name, "write it"))
    }

    fn try_replace(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        self.with_new(name, bytes, |new| self.open.rename(new, name))?;
        Ok(self.open.sync()?)
    }

    /// Writes `<name>.new`, synced, gives it to `then`, and removes it if either fails.
    fn with_new(
        &self,
        name: &str,
        bytes: &[u8],
        then: impl FnOnce(&str) -> Result<(), Errno>,
    ) -> io::Result<()> {
        let new = format!("{name}.new");
        // A killed emulator may have left one. It is not written to: it may be a link.
        match self.open.remove(&new) {
            Ok(()) | Err(Errno::NOENT) => {}
            Err(errno) => return Err(errno.into()),
        }
        self.open.with_new(&new, bytes, |file| {
            file.sync_all()?;
            Ok(then(&new)?)
        })
    }

    /// Renames a file that cannot be used to the first free `<name>.bad-<n>`.
    pub(super) fn set_aside(&self, name: &str) -> Result<PathBuf, NovramError> {
        for n in 1u32.. {
            let aside = format!("{name}.bad-{n}");
            match self.open.rename_to_free(name, &aside) {
                Ok(()) => return Ok(self.path_of(&aside)),
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

/// Refuses a directory in which others than `user` could exchange files.
fn judge(path: &Path, stat: &Stat, user: u32) -> Result<(), NovramError> {
    let path = || path.to_owned();
    if stat.st_uid != user {
        return Err(NovramError::Foreign { path: path(), owner: stat.st_uid, user });
    }
    if stat.st_mode & OTHERS_WRITE != 0 {
        return Err(NovramError::Writable { path: path(), mode: stat.st_mode & 0o7777 });
    }
    Ok(())
}
