//! A directory that belongs to one user, inside a directory to which all users can write.
//!
//! Another user can guess the name of the directory, and create a directory or a link of this name first. The directory
//! is therefore opened without following links and checked through its descriptor. Its contents are accessed only
//! through that descriptor, so other users cannot reach them.

#[cfg(feature = "channel")]
pub(crate) mod for_channel;

use super::MemoryError;
use super::directory::Directory;
use rustix::fs::{FileType, Mode, Stat};
use rustix::io::Errno;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// Rights of other users in a mode.
const OTHERS: u32 = 0o077;
/// Write rights of other users in a mode.
const OTHERS_WRITE: u32 = 0o022;

/// An open directory of this user.
#[derive(Debug)]
pub(crate) struct PrivateDir {
    path: PathBuf,
    directory: Directory,
}

impl PrivateDir {
    /// Opens the directory; creates a missing one, accessible to this user only.
    ///
    /// # Errors
    /// An entry of another kind has the name, other users own the directory or can write to it, or the operating system
    /// refuses the operation.
    pub(crate) fn create(path: &Path) -> Result<Self, MemoryError> {
        loop {
            match rustix::fs::mkdir(path, Mode::RWXU) {
                Ok(()) | Err(Errno::EXIST) => {}
                Err(errno) => return Err(failed(path, "create", errno)),
            }
            // Between the two calls, a process that ends may have removed the directory.
            if let Some(directory) = Self::open(path)? {
                return Ok(directory);
            }
        }
    }

    /// Opens the directory; `None` if there is none.
    ///
    /// # Errors
    /// Returns the errors of [`PrivateDir::create`].
    pub(crate) fn open(path: &Path) -> Result<Option<Self>, MemoryError> {
        let directory = match Directory::open_itself(path) {
            Ok(directory) => directory,
            Err(Errno::NOENT) => return Ok(None),
            Err(errno) => return Err(why_not_opened(path, errno)),
        };
        let stat = directory.stat().map_err(|errno| failed(path, "look at", errno))?;
        judge(path, &stat)?;
        if stat.st_mode & OTHERS != 0 {
            directory.close_to_others().map_err(|errno| failed(path, "close", errno))?;
        }
        Ok(Some(Self { path: path.to_owned(), directory }))
    }

    /// Opens the file `name` in this user's directory at `path`, to which other users may write. `None` if the file is
    /// not a regular file of this user with exactly one name. A file with several names may be a hard link that another
    /// user has put into the directory.
    ///
    /// # Errors
    /// Returns the errors of [`PrivateDir::find_file`].
    pub(crate) fn find_own_file(path: &Path, name: &str) -> Result<Option<File>, MemoryError> {
        let Ok(directory) = Directory::open_itself(path) else { return Ok(None) };
        let user = rustix::process::geteuid().as_raw();
        if !directory.stat().is_ok_and(|stat| stat.st_uid == user) {
            return Ok(None);
        }
        let file = Self { path: path.to_owned(), directory }.find_file(name)?;
        Ok(file.filter(|file| {
            rustix::fs::fstat(file).is_ok_and(|stat| {
                let kind = FileType::from_raw_mode(stat.st_mode);
                kind == FileType::RegularFile && stat.st_uid == user && stat.st_nlink == 1
            })
        }))
    }

    /// True if the path still names this directory.
    pub(crate) fn is_named(&self) -> bool {
        is_same(rustix::fs::lstat(&self.path), self.directory.stat())
    }

    /// Opens or creates the file `name` in the directory, for reading and writing. `None` if the directory itself has
    /// been removed.
    pub(crate) fn open_file(&self, name: &str) -> io::Result<Option<File>> {
        match self.directory.open_or_create(name) {
            Ok((file, _)) => Ok(Some(file)),
            Err(Errno::NOENT) => Ok(None),
            Err(errno) => Err(errno.into()),
        }
    }

    /// Removes the entry `name`, unless it is a regular file.
    pub(crate) fn remove_unless_file(&self, name: &str) {
        let kind = self.directory.stat_of(name).map(|stat| FileType::from_raw_mode(stat.st_mode));
        if kind.is_ok_and(|kind| kind != FileType::RegularFile) {
            self.remove(name);
        }
    }

    /// Opens the file `name` in the directory for reading; `None` if there is no such file.
    ///
    /// # Errors
    /// This process cannot open another file.
    pub(crate) fn find_file(&self, name: &str) -> Result<Option<File>, MemoryError> {
        match self.directory.read(name) {
            Ok(file) => Ok(Some(file)),
            Err(errno) => {
                let error = failed(&self.path.join(name), "open", errno);
                if error.is_shortage() { Err(error) } else { Ok(None) }
            }
        }
    }

    /// True if `name` still names `file`.
    pub(crate) fn names(&self, name: &str, file: &File) -> bool {
        is_same(self.directory.stat_of(name), rustix::fs::fstat(file))
    }

    /// Removes the entry `name`, if it exists. A directory is removed with all its contents. Follows no link.
    pub(crate) fn remove(&self, name: &str) {
        if self.directory.remove(name) == Err(Errno::ISDIR) {
            let _ = std::fs::remove_dir_all(self.directory.path_by_descriptor().join(name));
        }
    }

    /// Removes all entries except `kept`. Directories are removed with all their contents. Follows no link. Returns the
    /// entries that cannot be removed.
    #[cfg(feature = "cli")]
    pub(crate) fn remove_all_except(&self, kept: &str) -> io::Result<Vec<String>> {
        let mut left = Vec::new();
        for entry in std::fs::read_dir(self.directory.path_by_descriptor())? {
            let entry = entry?;
            if entry.file_name() == kept {
                continue;
            }
            let removed = match entry.file_type()?.is_dir() {
                true => std::fs::remove_dir_all(entry.path()),
                false => std::fs::remove_file(entry.path()),
            };
            if removed.is_err_and(|reason| reason.kind() != io::ErrorKind::NotFound) {
                left.push(entry.file_name().to_string_lossy().into_owned());
            }
        }
        left.sort();
        Ok(left)
    }

    /// Removes the directory if it is empty and the path still names it.
    pub(crate) fn remove_if_empty(&self) {
        if self.is_named() {
            let _ = rustix::fs::rmdir(&self.path);
        }
    }
}

/// True if both results describe existing files, and these are the same file.
fn is_same(one: Result<Stat, Errno>, other: Result<Stat, Errno>) -> bool {
    matches!((one, other), (Ok(a), Ok(b)) if (a.st_dev, a.st_ino) == (b.st_dev, b.st_ino))
}

fn failed(path: &Path, doing: &'static str, errno: Errno) -> MemoryError {
    MemoryError::System { path: path.to_owned(), doing, reason: errno.into() }
}

fn judge(path: &Path, stat: &Stat) -> Result<(), MemoryError> {
    let path = || path.to_owned();
    let user = rustix::process::geteuid().as_raw();
    match FileType::from_raw_mode(stat.st_mode) {
        _ if stat.st_uid != user => {
            Err(MemoryError::ForeignDirectory { path: path(), owner: stat.st_uid, user })
        }
        FileType::Directory if stat.st_mode & OTHERS_WRITE != 0 => {
            Err(MemoryError::OpenDirectory { path: path(), mode: stat.st_mode & 0o7777 })
        }
        FileType::Directory => Ok(()),
        FileType::Symlink => Err(MemoryError::Symlink { path: path() }),
        _ => Err(MemoryError::NotADirectory { path: path() }),
    }
}

/// Returns the error for `errno`, with a reason that the user can act on.
fn why_not_opened(path: &Path, errno: Errno) -> MemoryError {
    rustix::fs::lstat(path)
        .ok()
        .and_then(|stat| judge(path, &stat).err())
        .unwrap_or_else(|| failed(path, "open", errno))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};

    pub(super) fn place() -> (tempfile::TempDir, PathBuf) {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("own.d");
        (parent, path)
    }

    #[test]
    fn it_is_made_for_its_owner_alone_and_an_old_one_is_closed() {
        let (_parent, path) = place();
        assert!(PrivateDir::open(&path).unwrap().is_none());
        for _ in 0..2 {
            PrivateDir::create(&path).unwrap();
            assert_eq!(std::fs::metadata(&path).unwrap().mode() & 0o7777, 0o700);
            std::fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).unwrap();
        }
    }

    #[test]
    fn links_files_and_directories_open_to_others_are_refused_and_left_alone() {
        let (parent, path) = place();
        let target = parent.path().join("target");
        std::fs::create_dir(&target).unwrap();
        symlink(&target, &path).unwrap();
        assert!(matches!(PrivateDir::create(&path), Err(MemoryError::Symlink { .. })));
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "mine").unwrap();
        assert!(matches!(PrivateDir::create(&path), Err(MemoryError::NotADirectory { .. })));
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o1777)).unwrap();
        let refused = PrivateDir::create(&path).unwrap_err().to_string();
        assert!(refused.contains("mode 1777") && refused.contains("remove it yourself"), "{refused}");
    }

    #[test]
    fn any_entry_is_removed_and_no_link_is_followed() {
        let (parent, path) = place();
        let victim = parent.path().join("victim");
        std::fs::write(&victim, "precious").unwrap();
        let directory = PrivateDir::create(&path).unwrap();
        let name = path.join("name");
        for make in [
            |name: &Path, _: &Path| std::fs::write(name, "").unwrap(),
            |name: &Path, _: &Path| std::fs::create_dir_all(name.join("deep/er")).unwrap(),
            |name: &Path, victim: &Path| symlink(victim, name).unwrap(),
            |name: &Path, victim: &Path| {
                std::fs::create_dir(name).unwrap();
                symlink(victim, name.join("link")).unwrap();
            },
        ] {
            make(&name, &victim);
            let is_file = name.symlink_metadata().unwrap().is_file();
            directory.remove_unless_file("name");
            assert_eq!(name.symlink_metadata().is_ok(), is_file);
            directory.remove("name");
            assert!(name.symlink_metadata().is_err());
        }
        assert_eq!(std::fs::read_to_string(&victim).unwrap(), "precious");
    }

    #[test]
    fn it_knows_when_it_was_replaced() {
        let (_parent, path) = place();
        let directory = PrivateDir::create(&path).unwrap();
        assert!(directory.is_named());
        std::fs::remove_dir(&path).unwrap();
        assert!(!directory.is_named());
        std::fs::create_dir(&path).unwrap();
        directory.remove_if_empty();
        assert!(path.exists() && !directory.is_named());
        assert!(directory.open_file("lock").unwrap().is_none());
    }
}
