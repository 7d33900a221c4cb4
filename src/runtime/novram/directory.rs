//! The directory of the NOVRAM files. One emulator at a time uses it. Only regular files of a bounded size are read,
//! and no links are followed.

use super::NovramError;
use crate::memory::directory;
use rustix::fs::{FileType, Mode, Stat};
use rustix::io::Errno;
use std::fs::{DirBuilder, File};
use std::io::{self, Read};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

/// Longest wait of a starting emulator for the lock. The process that holds the lock may have been killed a moment ago
/// and may not have ended yet.
const PATIENCE: Duration = Duration::from_millis(500);

/// Name of the lock file. Other users cannot open this file, so they cannot take its lock. The directory itself has no
/// lock, because a user who can read a directory can also lock it.
const LOCK: &str = ".lock";

/// Number of unusable files of a PLC that are kept (D-862). A device that starts with a damaged file at each start, for example
/// because of a broken disk, must not fill the disk.
const KEPT: usize = 8;

/// Write rights of other users in a mode.
const OTHERS_WRITE: u32 = 0o022;

/// The new files and directories of all starts in this process.
static MADE: Mutex<Vec<Weak<Made>>> = Mutex::new(Vec::new());

/// A directory, locked for the lifetime of this value.
#[derive(Debug)]
pub struct Directory {
    path: PathBuf,
    open: Arc<directory::Directory>,
    /// The lock file; its lock is released when the file is closed.
    lock: Arc<File>,
    /// The new files and directories, if there are any. The value removes them if they are unused.
    _made: Option<Arc<Made>>,
}

/// New files and directories of a start.
#[derive(Debug)]
struct Made {
    open: Arc<directory::Directory>,
    lock: Arc<File>,
    /// The directory and its parents, as far as the start has created them, the innermost first.
    directories: Vec<PathBuf>,
}

impl Directory {
    /// Removes the new files and directories of the starts in this process, if they are unused. Only for a process that ends at once, because its
    /// start takes too long.
    #[cfg(feature = "cli")]
    pub(crate) fn remove_unfinished() {
        let all = core::mem::take(&mut *MADE.lock().unwrap_or_else(PoisonError::into_inner));
        all.iter().filter_map(Weak::upgrade).for_each(|made| made.remove_unused());
    }

    /// Checks that only this user can write to a directory, without creating, locking or changing it. A missing
    /// directory is not an error, because [`Directory::open`] creates it.
    ///
    /// # Errors
    /// Returns the errors of [`Directory::open`], except [`NovramError::InUse`].
    pub fn check(path: &Path) -> Result<(), NovramError> {
        let failed = |doing| {
            move |errno: Errno| NovramError::Io { path: path.to_owned(), doing, source: errno.into() }
        };
        let open = match directory::Directory::open(path) {
            Err(Errno::NOENT) => return Ok(()),
            opened => opened.map_err(failed("open this directory"))?,
        };
        let stat = open.stat().map_err(failed("look at this directory"))?;
        judge(path, &stat, rustix::process::geteuid().as_raw())
    }

    /// Opens and locks a directory. Creates a missing directory, accessible to this user only.
    ///
    /// # Errors
    /// [`NovramError::InUse`] if another emulator has it, [`NovramError::Foreign`] and [`NovramError::Writable`] if
    /// other users could put files into it, [`NovramError::Io`] if it cannot be created or used.
    pub fn open(path: &Path) -> Result<Self, NovramError> {
        let since = Instant::now();
        loop {
            let missing = |path: &&Path| !path.as_os_str().is_empty() && path.symlink_metadata().is_err();
            let directories: Vec<_> = path.ancestors().take_while(missing).map(Path::to_owned).collect();
            let opened = Self::open_or_make(path, &directories).inspect_err(|_| remove_empty(&directories));
            // Another emulator may have just removed the directory at its end, because it was new and unused.
            let is_removed = match &opened {
                Ok(directory) => !directory.has_lock(),
                Err(NovramError::Io { source, .. }) => source.kind() == io::ErrorKind::NotFound,
                Err(_) => false,
            };
            if !is_removed || since.elapsed() >= PATIENCE {
                return opened;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Opens and locks a directory. `directories` are the missing ones of the path, the innermost first.
    fn open_or_make(path: &Path, directories: &[PathBuf]) -> Result<Self, NovramError> {
        let failed = |doing| move |source| NovramError::Io { path: path.to_owned(), doing, source };
        DirBuilder::new().recursive(true).mode(0o700).create(path).map_err(failed("make this directory"))?;
        let open =
            directory::Directory::open(path).map_err(|errno| failed("open this directory")(errno.into()))?;
        let stat = open.stat().map_err(|errno| failed("look at this directory")(errno.into()))?;
        let user = rustix::process::geteuid().as_raw();
        judge(path, &stat, user)?;
        let (lock, has_new_lock) = lock_file(path, &open, user)?;
        let (lock, open) = (Arc::new(lock), Arc::new(open));
        let since = Instant::now();
        loop {
            match directory::writing::try_lock(&lock) {
                locked @ (Ok(true) | Err(_)) => {
                    let (path, has_made) = (path.to_owned(), has_new_lock || !directories.is_empty());
                    let made = has_made.then(|| {
                        let directories = directories.to_vec();
                        Made { open: Arc::clone(&open), lock: Arc::clone(&lock), directories }.begin()
                    });
                    locked.map_err(failed("lock this directory"))?;
                    return Ok(Directory { path, open, lock, _made: made });
                }
                Ok(false) if since.elapsed() < PATIENCE => std::thread::sleep(Duration::from_millis(1)),
                Ok(false) => return Err(NovramError::InUse { path: path.to_owned() }),
            }
        }
    }

    /// Returns the path of a file in the directory.
    pub(super) fn path_of(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Reads a file; returns one byte more than `longest` if the file is longer. `None` if there is no such file.
    pub(super) fn read(&self, name: &str, longest: usize) -> Result<Option<Vec<u8>>, NovramError> {
        let file = match self.open.read(name) {
            Ok(file) => file,
            Err(Errno::NOENT) => return Ok(None),
            Err(Errno::LOOP) => return Err(self.not_a_file(name, FileType::Symlink)),
            // The system returns these errors for a socket, and for a device without a driver.
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

    /// Replaces the file of this name: writes a new file, syncs it, renames it and syncs the directory. After an error,
    /// the new file is removed. A missing directory is created again. If another program has removed or replaced the lock
    /// file, the directory is locked again, and [`NovramError::InUse`] is the error if another emulator has it.
    pub(super) fn replace(&mut self, name: &str, bytes: &[u8]) -> Result<(), NovramError> {
        if !self.has_lock() {
            *self = Self::open(&self.path)?;
        }
        self.try_replace(name, bytes).map_err(self.failed(name, "write it"))
    }

    /// True if the file system does not distinguish upper and lower case in names.
    pub(crate) fn ignores_case(&self) -> bool {
        is_file_of(&self.lock, &self.open, &LOCK.to_uppercase())
    }

    /// True if the file with this emulator's lock is still the lock file of the directory.
    fn has_lock(&self) -> bool {
        is_lock_of(&self.lock, &self.open)
    }

    /// Checks that a file with this content can be written, without any change.
    pub(super) fn probe(&self, name: &str, bytes: &[u8]) -> Result<(), NovramError> {
        self.with_new(name, bytes, |new| self.open.remove(new)).map_err(self.failed(name, "write it"))
    }

    fn try_replace(&self, name: &str, bytes: &[u8]) -> io::Result<()> {
        self.with_new(name, bytes, |new| self.open.rename(new, name))?;
        Ok(self.open.sync()?)
    }

    /// Writes `<name>.new`, synchronizes it to the disk, and passes it to `then`. Removes the file if one of these
    /// steps fails.
    fn with_new(
        &self,
        name: &str,
        bytes: &[u8],
        then: impl FnOnce(&str) -> Result<(), Errno>,
    ) -> io::Result<()> {
        let new = format!("{name}.new");
        // Such a file may come from a killed emulator. It is removed, not opened, because it may be a link.
        match self.open.remove(&new) {
            Ok(()) | Err(Errno::NOENT) => {}
            Err(errno) => return Err(errno.into()),
        }
        self.open.with_new(&new, bytes, |file| {
            file.sync_all()?;
            Ok(then(&new)?)
        })
    }

    /// Renames an unusable file to `<name>.bad-<n>`, where n is the number after the highest one that exists. Keeps the last
    /// [`KEPT`] of these files, and removes the older ones. Returns the new path, and the paths of the removed files.
    pub(super) fn set_aside(&self, name: &str) -> Result<(PathBuf, Vec<PathBuf>), NovramError> {
        let failed = self.failed(name, "set it aside");
        let start = format!("{name}.bad-");
        let mut numbers: Vec<u64> = Vec::new();
        for entry in std::fs::read_dir(self.open.path_by_descriptor()).map_err(&failed)? {
            let entry = entry.map_err(&failed)?.file_name();
            let number = entry.to_str().and_then(|entry| entry.strip_prefix(&start)?.parse::<u64>().ok());
            // Another name of the same number, such as `.bad-01`, is not from an emulator.
            numbers.extend(number.filter(|number| entry == *format!("{start}{number}")));
        }
        numbers.sort_unstable();
        let next = numbers.last().map_or(1, |last| last.saturating_add(1));
        let aside = format!("{start}{next}");
        self.open.rename_to_free(name, &aside).map_err(|errno| failed(errno.into()))?;
        numbers.truncate((numbers.len() + 1).saturating_sub(KEPT));
        let mut removed = Vec::new();
        for number in numbers {
            let old = format!("{start}{number}");
            // A file that cannot be removed, such as a directory, takes no room for the emulator's own files.
            if self.open.remove(&old).is_ok() {
                removed.push(self.path_of(&old));
            }
        }
        Ok((self.path_of(&aside), removed))
    }

    fn failed(&self, name: &str, doing: &'static str) -> impl Fn(io::Error) -> NovramError + use<> {
        let path = self.path_of(name);
        move |source| NovramError::Io { path: path.clone(), doing, source }
    }

    fn not_a_file(&self, name: &str, found: FileType) -> NovramError {
        not_a_file(self.path_of(name), found)
    }
}

impl Made {
    /// Keeps the value in the list for [`Directory::remove_unfinished`].
    fn begin(self) -> Arc<Self> {
        let made = Arc::new(self);
        let mut all = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|made| made.strong_count() > 0);
        all.push(Arc::downgrade(&made));
        made
    }

    /// Removes the lock file and the new directories, if the directory has no NOVRAM files. The new file of a write that
    /// was cut off is removed, too.
    fn remove_unused(&self) {
        let Ok(entries) = std::fs::read_dir(self.open.path_by_descriptor()) else { return };
        let names: Option<Vec<_>> = entries.map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
        let is_own = |name: &String| name == LOCK || name.ends_with(".novram.new");
        let Some(names) = names.filter(|names| names.iter().all(is_own)) else { return };
        if !is_lock_of(&self.lock, &self.open) {
            return;
        }
        // The lock file is the last one, because another emulator may use the directory from then on. If this emulator has
        // opened the lock file already, it locks the directory again before it writes.
        for name in names.iter().filter(|name| *name != LOCK).map(String::as_str).chain([LOCK]) {
            let _ = self.open.remove(name);
        }
        remove_empty(&self.directories);
    }
}

/// A refused start leaves no files.
impl Drop for Made {
    fn drop(&mut self) {
        self.remove_unused();
    }
}

/// Removes directories, the innermost first. A directory in use is not empty, and so it stays.
fn remove_empty(directories: &[PathBuf]) {
    for directory in directories {
        let _ = std::fs::remove_dir(directory);
    }
}

/// True if `lock` is the lock file of a directory.
fn is_lock_of(lock: &File, directory: &directory::Directory) -> bool {
    is_file_of(lock, directory, LOCK)
}

/// True if `file` has this name in a directory.
fn is_file_of(file: &File, directory: &directory::Directory, name: &str) -> bool {
    match (rustix::fs::fstat(file), directory.stat_of(name)) {
        (Ok(own), Ok(named)) => (own.st_dev, own.st_ino) == (named.st_dev, named.st_ino),
        _ => false,
    }
}

fn not_a_file(path: PathBuf, found: FileType) -> NovramError {
    let found = match found {
        FileType::Symlink => "a symbolic link",
        FileType::Directory => "a directory",
        FileType::Fifo => "a pipe",
        FileType::CharacterDevice | FileType::BlockDevice => "a device",
        _ => "something else",
    };
    NovramError::NotAFile { path, found }
}

/// Opens the lock file, which only `user` can open. Creates a missing one, and then also returns true.
fn lock_file(path: &Path, directory: &directory::Directory, user: u32) -> Result<(File, bool), NovramError> {
    let path = path.join(LOCK);
    let failed_to = |doing, errno: Errno| NovramError::Io { path: path.clone(), doing, source: errno.into() };
    let failed = |errno| failed_to("open it", errno);
    let (file, is_new) = match directory.open_or_create(LOCK) {
        Ok(opened) => opened,
        Err(Errno::LOOP) => return Err(not_a_file(path, FileType::Symlink)),
        Err(Errno::ISDIR) => return Err(not_a_file(path, FileType::Directory)),
        Err(Errno::NXIO | Errno::NODEV) => return Err(not_a_file(path, FileType::Unknown)),
        Err(errno) => return Err(failed(errno)),
    };
    let stat = rustix::fs::fstat(&file).map_err(failed)?;
    match FileType::from_raw_mode(stat.st_mode) {
        FileType::RegularFile if stat.st_uid == user => {}
        FileType::RegularFile => return Err(NovramError::Foreign { path, owner: stat.st_uid, user }),
        other => return Err(not_a_file(path, other)),
    }
    // The file may have other rights, for example because a user has copied the directory. A file system without rights refuses
    // any change.
    if let Err(errno) = rustix::fs::fchmod(&file, Mode::RUSR | Mode::WUSR) {
        if is_new {
            let _ = directory.remove(LOCK);
        }
        return Err(failed_to("change its permissions", errno));
    }
    Ok((file, is_new))
}

/// Refuses a directory in which other users than `user` could exchange files.
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
