//! The lock of an instance: one emulator per name, independent of the names of its PLCs.
//!
//! The lock is a file in the instance's directory, which belongs to one user. The images have separate locks, by which
//! clients detect a running emulator. These locks are not enough, because an emulator with other PLCs has images of
//! other names.

#[cfg(feature = "emulator")]
mod device_folders;
#[cfg(feature = "emulator")]
pub(crate) use device_folders::DeviceFolder;

use super::file::is_of_other;
#[cfg(feature = "cli")]
use super::file::{self, ImageFile};
#[cfg(feature = "cli")]
use super::image::LockableFile;
use super::private::PrivateDir;
use super::process::ProcessId;
use super::{EmulatorProcess, Image, MemoryError, list, names};
use std::fs::{File, TryLockError};
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::time::{Duration, Instant};

/// The file in the instance's directory. Its lines are process id and start time of the process that has the lock, the name
/// of the instance, and [`UNSAVED`] or nothing.
pub(super) const LOCK: &str = "lock";
/// Third line of a lock file: the emulator is ending, and could not save the changes in NOVRAM.
const UNSAVED: &str = "unsaved";
/// Word in a lock file, after the process: this process only removes the files of a killed emulator.
const CLEANER: &str = "cleaner";
/// Longest wait for a lock. Its holder may be an emulator that ends, or a client that checks the lock.
const PATIENCE: Duration = Duration::from_millis(500);

/// The right to be the emulator of an instance, or to remove the files of a killed one. Other processes are refused
/// while it exists.
#[derive(Debug)]
pub struct InstanceLock {
    instance: String,
    directory: PrivateDir,
    file: File,
}

impl InstanceLock {
    /// Takes the lock of `instance`.
    ///
    /// # Errors
    /// The name is invalid; another emulator has the instance ([`MemoryError::InstanceTaken`]); the directory of the
    /// instance is accessible to other users; or the operating system refuses the operation.
    pub fn take(instance: &str) -> Result<Self, MemoryError> {
        Self::take_as(instance, &signature_of(instance))
    }

    /// Takes the lock like [`InstanceLock::take`], to remove the files of a killed emulator. While a process has this
    /// lock, no emulator can start under this name. Users need not end that process, because it ends soon.
    ///
    /// # Errors
    /// Returns the errors of [`InstanceLock::take`].
    pub fn take_to_clean(instance: &str) -> Result<Self, MemoryError> {
        Self::take_as(instance, &format!("{} {CLEANER}\n", ProcessId::own()))
    }

    fn take_as(instance: &str, signature: &str) -> Result<Self, MemoryError> {
        let path = names::channel_root(instance)?;
        Self::try_to_take(instance, &path, signature).inspect_err(|error| {
            // The directory may be empty now. An emulator that starts creates it again, so an empty directory is
            // removed.
            if matches!(error, MemoryError::System { .. }) {
                let _ = std::fs::remove_dir(&path);
            }
        })
    }

    fn try_to_take(instance: &str, path: &Path, signature: &str) -> Result<Self, MemoryError> {
        let failed = |doing, reason| MemoryError::System { path: path.join(LOCK), doing, reason };
        let start = Instant::now();
        loop {
            let directory = PrivateDir::create(path)?;
            // The previous holder of the lock may be removing directory and lock now.
            let Some(file) = open(&directory).map_err(|reason| failed("open", reason))? else {
                continue;
            };
            match file.try_lock() {
                Ok(()) if directory.is_named() && directory.names(LOCK, &file) => {
                    let lock = Self { instance: instance.to_owned(), directory, file };
                    // If the file system has no memory, this write fails, and dropping `lock` removes the file.
                    sign(&lock.file, signature).map_err(|reason| failed("write", reason))?;
                    return Ok(lock);
                }
                Ok(()) => continue,
                Err(TryLockError::Error(reason)) => return Err(failed("lock", reason)),
                Err(TryLockError::WouldBlock) => {}
            }
            if start.elapsed() >= PATIENCE {
                check_owner(instance, &path.join(LOCK), &file)?;
                let pid = EmulatorProcess::holding(&file, signer(&file))?.map(|process| process.pid());
                return Err(MemoryError::InstanceTaken { instance: instance.to_owned(), pid });
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Records that changes in NOVRAM could not be saved. A process that waits for the end of the emulator reads this from
    /// the open lock file, also if the images have been removed before it looked for them.
    #[cfg(feature = "emulator")]
    pub(crate) fn set_unsaved(&self) {
        // If another program has damaged the file, the header pages of the images have the same information.
        let text = format!("{}{UNSAVED}\n", signature_of(&self.instance));
        let _ = self.file.write_all_at(text.as_bytes(), 0);
    }

    /// Returns the holder of the lock of `instance`: `None` if it is free, `Some(None)` if the process is in another
    /// pid namespace.
    ///
    /// # Errors
    /// The name is invalid, or the instance's directory is accessible to other users.
    pub fn holder(instance: &str) -> Result<Option<Option<EmulatorProcess>>, MemoryError> {
        let path = names::channel_root(instance)?;
        let Some(directory) = PrivateDir::open(&path)? else { return Ok(None) };
        let Some(file) = directory.find_file(LOCK)? else { return Ok(None) };
        match file.try_lock_shared() {
            Ok(()) => Ok(None),
            Err(TryLockError::WouldBlock) => {
                check_owner(instance, &path.join(LOCK), &file)?;
                EmulatorProcess::holding(&file, signer(&file)).map(Some)
            }
            Err(TryLockError::Error(reason)) => {
                Err(MemoryError::System { path: path.join(LOCK), doing: "lock", reason })
            }
        }
    }

    /// Removes everything in the instance's directory except the lock, also entries that no emulator has created.
    /// Returns the entries that cannot be removed.
    ///
    /// # Errors
    /// The directory cannot be read.
    #[cfg(feature = "cli")]
    pub(crate) fn empty_directory(&self) -> Result<Vec<String>, MemoryError> {
        let path = names::channel_root(&self.instance)?;
        let emptied = self.directory.remove_all_except(LOCK);
        emptied.map_err(|reason| MemoryError::System { path, doing: "empty this directory", reason })
    }

    /// Removes the files of the emulator that starts in this process, except those of its channel. Only for a process that
    /// ends at once, because its start takes too long.
    #[cfg(feature = "cli")]
    pub(crate) fn remove_unfinished(instance: &str) {
        let own = Some(ProcessId::own());
        for plc in list::named(instance).unwrap_or_default() {
            if let Ok(Some(image)) = ImageFile::open(instance, &plc, false)
                && image.own_header().ok().map(|header| file::emulator(&header)) == own
            {
                let _ = image.remove_name();
            }
        }
        let directory = names::channel_root(instance).and_then(|path| PrivateDir::open(&path));
        if let Ok(Some(directory)) = directory
            && let Ok(Some(lock)) = directory.find_file(LOCK)
            && signer(&lock) == own
        {
            let _ = directory.remove_all_except(LOCK);
            directory.remove(LOCK);
            directory.remove_if_empty();
        }
    }

    /// True if an image of the instance exists, or if this is unknown.
    #[cfg(feature = "channel")]
    pub(crate) fn has_images(&self) -> bool {
        list::named(&self.instance).map_or(true, |plcs| !plcs.is_empty())
    }

    /// Removes the images of a killed emulator, except those of the PLCs for which `keep` is true. Returns whether
    /// there were any.
    ///
    /// # Errors
    /// An image belongs to another user, its emulator runs, or the operating system refuses. All other images are
    /// removed.
    pub fn remove_dead(&self, keep: impl Fn(&str) -> bool) -> Result<bool, MemoryError> {
        let (mut any, mut refused) = (false, None);
        for plc in list::named(&self.instance)?.into_iter().filter(|plc| !keep(plc)) {
            match Image::remove_dead(&self.instance, &plc) {
                Ok(removed) => any |= removed,
                Err(error) => drop(refused.get_or_insert(error)),
            }
        }
        refused.map_or(Ok(any), Err)
    }
}

impl Drop for InstanceLock {
    fn drop(&mut self) {
        #[cfg(feature = "emulator")]
        self.remove_device_folders();
        // The process releases the lock later, when it closes the file.
        self.directory.remove(LOCK);
        self.directory.remove_if_empty();
    }
}

/// Opens or creates the lock file. Removes anything else of that name: only this user can write to the directory, and
/// no emulator creates such an entry. `None` if the directory has been removed.
fn open(directory: &PrivateDir) -> io::Result<Option<File>> {
    directory.remove_unless_file(LOCK);
    directory.open_file(LOCK)
}

/// Returns the first lines of the lock file of an emulator, which is this process.
fn signature_of(instance: &str) -> String {
    format!("{}\n{instance}\n", ProcessId::own())
}

/// Writes the process that holds the lock.
fn sign(file: &File, signature: &str) -> io::Result<()> {
    file.set_len(0)?;
    file.write_all_at(signature.as_bytes(), 0)
}

fn signature(file: &File) -> Option<String> {
    let mut text = [0; 128];
    let length = file.read_at(&mut text, 0).ok()?;
    core::str::from_utf8(text.get(..length)?).ok().map(str::to_owned)
}

/// Returns the emulator named in a lock file. Any program of this user can write this name.
pub(super) fn signer(file: &File) -> Option<ProcessId> {
    ProcessId::parse(signature(file)?.lines().next()?)
}

/// True if the emulator that holds a lock file, or has held it, could not save the changes in NOVRAM.
pub(super) fn is_unsaved(file: &File) -> bool {
    signature(file).is_some_and(|text| text.lines().nth(2) == Some(UNSAVED))
}

/// Refuses the locked file of an emulator that runs as another instance.
pub(super) fn check_owner(instance: &str, path: &Path, file: &File) -> Result<(), MemoryError> {
    // Lock files of earlier versions, and of processes that remove files, name no instance.
    let owner = signature(file).and_then(|text| text.lines().nth(1).map(str::to_owned));
    match owner.filter(|owner| is_of_other(file, instance, owner)) {
        Some(owner) => Err(MemoryError::OtherInstance { path: path.to_owned(), owner }),
        None => Ok(()),
    }
}

/// True if the process that holds a lock file only removes the files of a killed emulator.
pub(super) fn is_cleaner(file: &File) -> bool {
    signature(file).is_some_and(|text| text.lines().next().is_some_and(|line| line.ends_with(CLEANER)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::testing::Instance;

    #[cfg(feature = "emulator")]
    #[test]
    fn a_name_is_no_cleaner() {
        for name in ["cleaner", UNSAVED] {
            let name = format!("{}-{name}", std::process::id());
            let lock = InstanceLock::take(&name).unwrap();
            assert!(!is_cleaner(&lock.file) && !is_unsaved(&lock.file) && signer(&lock.file).is_some());
            lock.set_unsaved();
            assert!(!is_cleaner(&lock.file) && is_unsaved(&lock.file) && signer(&lock.file).is_some());
        }
    }

    #[test]
    fn only_one_process_has_an_instance() {
        let instance = Instance::new();
        let lock = InstanceLock::take(&instance).unwrap();
        let refused = InstanceLock::take(&instance).unwrap_err().to_string();
        let pid = std::process::id();
        assert!(
            refused.starts_with(&format!("instance '{}' is already running (process {pid})", &*instance)),
            "{refused}"
        );
        assert_eq!(InstanceLock::holder(&instance).unwrap().unwrap().unwrap().pid(), pid);
        drop(lock);
        assert!(InstanceLock::holder(&instance).unwrap().is_none());
        drop(InstanceLock::take(&instance).unwrap());
        assert!(!names::channel_root(&instance).unwrap().exists());
    }

    #[test]
    fn concurrent_processes_never_share_an_instance() {
        use std::sync::atomic::{AtomicU32, Ordering};
        let instance = Instance::new();
        let (inside, taken) = (AtomicU32::new(0), AtomicU32::new(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        let Ok(lock) = InstanceLock::take(&instance) else { continue };
                        assert_eq!(inside.fetch_add(1, Ordering::SeqCst), 0);
                        taken.fetch_add(1, Ordering::SeqCst);
                        inside.fetch_sub(1, Ordering::SeqCst);
                        drop(lock);
                    }
                });
            }
        });
        assert!(taken.load(Ordering::SeqCst) >= 50);
        assert!(!names::channel_root(&instance).unwrap().exists());
    }
}
