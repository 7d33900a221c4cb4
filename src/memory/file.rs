//! Opens and checks image files, and never changes a file of another owner.

use super::image::LockableFile;
use super::{HEADER_SIZE, Header, MemoryError, State, header, list, names, process::ProcessId};
use rustix::{
    fs::{FileType, Mode, OFlags, Stat},
    io::Errno,
};
use std::{
    fs::{File, TryLockError},
    io,
    os::unix::fs::{FileExt, MetadataExt},
    path::{Path, PathBuf},
};
use zerocopy::{FromZeros, IntoBytes};

/// An open image file, regular and owned by this user; its content is not checked yet.
#[derive(Debug)]
pub(super) struct ImageFile {
    pub instance: String,
    pub plc: String,
    pub path: PathBuf,
    pub file: File,
}

impl ImageFile {
    /// Opens an existing file; `None` if there is none.
    pub(crate) fn open(instance: &str, plc: &str, write: bool) -> Result<Option<Self>, MemoryError> {
        let path = names::image_path(instance, plc)?;
        let access = if write { OFlags::RDWR } else { OFlags::RDONLY };
        // NONBLOCK: if a pipe has this name, the open must not wait for its writer. The pipe is refused later.
        let flags = access | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
        let opened = loop {
            match rustix::fs::open(&path, flags, Mode::empty()) {
                // A process holds a lease of the file. It is the emulator, which checks whether another process has the
                // file open (`Onlookers`), or a process of another user, if the file belongs to that user.
                Err(Errno::AGAIN) => {
                    if let Ok(stat) = rustix::fs::lstat(&path) {
                        judge(&path, &stat)?;
                    }
                    std::thread::yield_now();
                }
                opened => break opened,
            }
        };
        match opened {
            Ok(file) => {
                let this = Self::new(instance, plc, path, File::from(file));
                judge(&this.path, &this.stat()?)?;
                Ok(Some(this))
            }
            Err(Errno::NOENT) => Ok(None),
            Err(errno) => Err(why_not_opened(&path, errno)),
        }
    }

    pub(crate) fn new(instance: &str, plc: &str, path: PathBuf, file: File) -> Self {
        Self { instance: instance.to_owned(), plc: plc.to_owned(), path, file }
    }

    /// Reads the header from the file; bytes after the end of a short file read as zero.
    pub(crate) fn header(&self) -> Result<Box<Header>, MemoryError> {
        let mut header = Header::new_box_zeroed()
            .map_err(|_| self.failed("read", io::Error::from(io::ErrorKind::OutOfMemory)))?;
        let bytes = header.as_mut_bytes();
        let mut filled = 0;
        while let Some(rest) = bytes.get_mut(filled..).filter(|rest| !rest.is_empty()) {
            match self.file.read_at(rest, filled as u64) {
                Ok(0) => break,
                Ok(n) => filled += n,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(self.failed("read", error)),
            }
        }
        Ok(header)
    }

    /// Returns the header, if the file begins with the magic.
    pub(crate) fn own_header(&self) -> Result<Box<Header>, MemoryError> {
        let header = self.header()?;
        match header.magic.load() {
            header::MAGIC => Ok(header),
            found => Err(MemoryError::WrongMagic { path: self.path.clone(), found }),
        }
    }

    /// Returns the length of the file in bytes.
    pub(crate) fn size(&self) -> Result<u64, MemoryError> {
        Ok(u64::try_from(self.stat()?.st_size).unwrap_or(0))
    }

    /// Refuses another ABI version, and a file shorter than the length in its header page: areas would be outside the
    /// file.
    pub(crate) fn check_shape(&self, header: &Header) -> Result<(), MemoryError> {
        let found = header.abi_version.load();
        if found != header::ABI_VERSION {
            let path = self.path.clone();
            return Err(MemoryError::OtherAbi { path, found, expected: header::ABI_VERSION });
        }
        let (size, expected) = (self.size()?, header.segment_size.load().max(HEADER_SIZE as u32));
        if size < expected.into() {
            return Err(MemoryError::TooShort { path: self.path.clone(), size, expected });
        }
        Ok(())
    }

    /// True if the emulator that wrote `header` still runs. Its process exists; or, if its pid namespace is not visible
    /// here, the file is locked.
    pub(crate) fn is_alive(&self, header: &Header) -> bool {
        !State::from_code(header.state.load()).is_some_and(State::is_over)
            && (emulator(header).is_running() || self.is_locked())
    }

    /// Refuses the file of an emulator that runs as another instance.
    pub(crate) fn check_instance(&self, header: &Header) -> Result<(), MemoryError> {
        let owner = header::name(&header.instance);
        // An emulator that ends releases the lock after it has set the state.
        let is_served = || self.is_alive(header) || self.is_locked();
        match is_of_other(&self.file, &self.instance, &owner) && is_served() {
            true => Err(MemoryError::OtherInstance { path: self.path.clone(), owner }),
            false => Ok(()),
        }
    }

    /// [`is_locked`]
    pub(crate) fn is_locked(&self) -> bool {
        is_locked(&self.file)
    }

    pub(crate) fn failed(&self, doing: &'static str, reason: io::Error) -> MemoryError {
        MemoryError::System { path: self.path.clone(), doing, reason }
    }

    fn stat(&self) -> Result<Stat, MemoryError> {
        rustix::fs::fstat(&self.file).map_err(|errno| self.failed("look at", errno.into()))
    }
}

impl LockableFile for ImageFile {
    type Error = MemoryError;

    fn lock(&self) -> Result<bool, MemoryError> {
        match self.file.try_lock() {
            Ok(()) => Ok(true),
            Err(TryLockError::WouldBlock) => Ok(false),
            Err(TryLockError::Error(error)) => Err(self.failed("lock", error)),
        }
    }

    fn is_named(&self) -> Result<bool, MemoryError> {
        let own = self.stat()?;
        match rustix::fs::lstat(&self.path) {
            Ok(named) => Ok((named.st_dev, named.st_ino) == (own.st_dev, own.st_ino)),
            Err(Errno::NOENT) => Ok(false),
            Err(errno) => Err(self.failed("look at", errno.into())),
        }
    }

    fn remove_name(&self) -> Result<(), MemoryError> {
        rustix::fs::unlink(&self.path).map_err(|errno| self.failed("remove", errno.into()))
    }
}

/// True if a process has locked the file. The check takes a shared lock for a moment. An emulator that starts meanwhile
/// waits for the lock.
pub(super) fn is_locked(file: &File) -> bool {
    match file.try_lock_shared() {
        // If the unlock fails, closing the file releases the lock.
        Ok(()) => file.unlock().is_err(),
        Err(TryLockError::WouldBlock) => true,
        Err(TryLockError::Error(_)) => false,
    }
}

/// True if a file that has the name of `instance`, and names `owner` as its instance, belongs to `owner`: the file has
/// another name too, or files of `owner` exist. Any program of this user can write the name of an instance that does not
/// exist.
pub(super) fn is_of_other(file: &File, instance: &str, owner: &str) -> bool {
    let has_files = || {
        names::channel_root(owner).is_ok_and(|root| root.symlink_metadata().is_ok())
            || list::named(owner).is_ok_and(|plcs| !plcs.is_empty())
    };
    owner != instance
        && names::check_instance(owner).is_ok()
        && (file.metadata().is_ok_and(|file| file.nlink() > 1) || has_files())
}

/// Returns the process named in a header.
pub(super) fn emulator(header: &Header) -> ProcessId {
    ProcessId { pid: header.firmware_pid.load(), start: header.firmware_start.load() }
}

fn judge(path: &Path, stat: &Stat) -> Result<(), MemoryError> {
    let path = || path.to_owned();
    let user = rustix::process::geteuid().as_raw();
    match FileType::from_raw_mode(stat.st_mode) {
        _ if stat.st_uid != user => Err(MemoryError::ForeignOwner { path: path(), owner: stat.st_uid, user }),
        FileType::RegularFile => Ok(()),
        FileType::Symlink => Err(MemoryError::Symlink { path: path() }),
        _ => Err(MemoryError::NotAFile { path: path() }),
    }
}

/// Returns the error for `errno`, with a reason that the user can act on.
fn why_not_opened(path: &Path, errno: Errno) -> MemoryError {
    let failed = MemoryError::System { path: path.to_owned(), doing: "open", reason: errno.into() };
    rustix::fs::lstat(path).ok().and_then(|stat| judge(path, &stat).err()).unwrap_or(failed)
}
