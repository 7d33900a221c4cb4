//! Finds a running instance, even if its directory or files were changed.
//!
//! An emulator holds the lock in the instance's directory, and the locks of its images, until it has removed its files.
//! Open files and a pinned process always refer to the emulator that was found, even when another emulator of the same
//! name starts.

use super::file::ImageFile;
use super::instance::{self, LOCK};
use super::private::PrivateDir;
use super::{EmulatorProcess, Header, MemoryError, State, file, limits, list, names};
use rustix::fs::{fstat, lstat};
use rustix::io::Errno;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Number of files that are open at the same time in addition to the images: the lock, its directory, the process, and
/// some temporary files.
const FILES: u64 = 8;
/// Longest wait for a process that removes the files of a killed emulator.
const CLEANING: Duration = Duration::from_millis(500);
/// Real time between two polls.
const LOOK: Duration = Duration::from_millis(1);

/// An instance with a running emulator: the files that it has locked, and its process.
#[derive(Debug)]
pub struct RunningInstance {
    files: Vec<LockedFile>,
    process: Option<EmulatorProcess>,
}

#[derive(Debug)]
struct LockedFile {
    path: PathBuf,
    file: File,
}

impl RunningInstance {
    /// Returns the emulator that runs under this name; `None` if there is none. An emulator is recognized by its file
    /// locks: one locked file is enough, even if the others were emptied, replaced or removed.
    ///
    /// # Errors
    /// The name is invalid, the operating system refuses the operation, or no emulator is found and the instance's
    /// directory is accessible to other users or its files are those of another running instance.
    pub fn find(instance: &str) -> Result<Option<Self>, MemoryError> {
        // An emulator is not found if its files cannot be opened. So a limit of open files that is too low is an error.
        let refused = |_| MemoryError::System {
            path: names::IMAGE_DIRECTORY.into(),
            doing: "open the files of an instance",
            reason: Errno::MFILE.into(),
        };
        let files = FILES + list::named(instance)?.len() as u64;
        limits::allow_files(files, files).map_err(refused)?;
        let start = Instant::now();
        loop {
            let (found, is_cleaned) = Self::look(instance)?;
            if !is_cleaned || start.elapsed() > CLEANING {
                return Ok(found);
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Searches once. Also returns true if a process is removing the files of a killed emulator at this moment. Such a
    /// process holds the same locks as an emulator.
    fn look(instance: &str) -> Result<(Option<Self>, bool), MemoryError> {
        let (lock, refused) = match lock_file(instance) {
            Ok(lock) => (lock, None),
            // Other users can write to the directory, but they cannot hold a lock on a file of this user.
            Err(refused @ MemoryError::OpenDirectory { .. }) => (own_lock_file(instance)?, Some(refused)),
            Err(refused) if refused.is_shortage() => return Err(refused),
            // An entry of another kind has the directory's name; the images may still be served.
            Err(refused) => (None, Some(refused)),
        };
        let is_cleaned = |lock: &Option<LockedFile>| {
            lock.as_ref().is_some_and(|lock| lock.is_locked() && instance::is_cleaner(&lock.file))
        };
        if is_cleaned(&lock) {
            return Ok((None, true));
        }
        let mut process = None;
        let mut files = Vec::new();
        let mut refused = refused;
        let owned = |refused: &mut Option<MemoryError>, checked: Result<(), MemoryError>| {
            checked.map_err(|other| *refused = Some(other)).is_ok()
        };
        let lock = lock
            .filter(LockedFile::is_locked)
            .filter(|lock| owned(&mut refused, instance::check_owner(instance, &lock.path, &lock.file)));
        if let Some(lock) = lock {
            process = EmulatorProcess::holding(&lock.file, instance::signer(&lock.file))?;
            files.push(lock);
        }
        for plc in list::named(instance)? {
            let image = match ImageFile::open(instance, &plc, false) {
                Ok(Some(image)) => image,
                Err(refused) if refused.is_shortage() => return Err(refused),
                // An entry that is not a regular file of this user cannot be the image of a running emulator, so it is
                // skipped.
                Ok(None) | Err(_) => continue,
            };
            if !image.is_locked() {
                continue;
            }
            let header = image.own_header().ok();
            let checked = header.as_ref().map_or(Ok(()), |header| image.check_instance(header));
            if !owned(&mut refused, checked) {
                continue;
            }
            if process.is_none() {
                let signed = header.map(|header| file::emulator(&header));
                process = EmulatorProcess::holding(&image.file, signed)?;
            }
            files.push(LockedFile { path: image.path, file: image.file });
        }
        // A process that removes files may start or end between these checks, so the search is repeated.
        let (begun, all_free) =
            (is_cleaned(&lock_file(instance).ok().flatten()), !files.iter().any(LockedFile::is_locked));
        if begun || files.is_empty() || all_free {
            return match refused {
                Some(refused) if files.is_empty() => Err(refused),
                _ => Ok((None, begun)),
            };
        }
        Ok((Some(Self { files, process }), false))
    }

    /// Process of the emulator; `None` if it is in another pid namespace.
    pub fn process(&self) -> Option<&EmulatorProcess> {
        self.process.as_ref()
    }

    /// Process id of a process that holds the locks and is not an emulator.
    pub fn other_holder(&self) -> Option<u32> {
        let holders = || self.files.iter().filter_map(|locked| super::locks::holder_of(&locked.file));
        if self.process.is_some() { None } else { holders().next() }
    }

    /// True if the emulator has stopped serving: its process has ended, or has released all its locks. The process of
    /// `commram with` continues until its command has ended.
    pub fn has_ended(&self) -> bool {
        self.process.as_ref().is_some_and(|process| !process.is_running())
            || !self.files.iter().any(LockedFile::is_locked)
    }

    /// Waits for the end of the emulator's process, for at most `limit`.
    pub fn wait(&self, limit: Duration) {
        match &self.process {
            Some(process) => drop(process.wait(limit)),
            None => std::thread::sleep(limit),
        }
    }

    /// Called after the end of the emulator. True if it could not save the changes in NOVRAM. The open files tell this
    /// although they have been removed.
    pub fn is_unsaved(&self) -> bool {
        self.files.iter().any(LockedFile::is_unsaved)
    }

    /// Called after the emulator was killed. True if it had begun to end in good order.
    pub fn was_ending(&self) -> bool {
        self.files.iter().any(|file| file.state() == Some(State::Stopping))
    }

    /// Called after the end of the emulator. True if its files still have their names, because it was killed before it
    /// removed them. Files that another emulator has taken over do not count, and neither do [`RunningInstance::renamed`].
    pub fn has_left_files(&self) -> bool {
        self.renamed().count() < self.left().count()
    }

    /// Called after the end of the emulator. Returns images that another program has renamed, so that the emulator could not
    /// remove them at its orderly end.
    pub fn renamed(&self) -> impl Iterator<Item = &Path> {
        let is_orderly = !self.left().any(|file| file.path.ends_with(LOCK));
        let ended = |file: &&LockedFile| file.state().is_some_and(|state| state.is_over());
        self.left().filter(ended).filter(move |_| is_orderly).map(|file| &*file.path)
    }

    fn left(&self) -> impl Iterator<Item = &LockedFile> {
        self.files.iter().filter(|file| file.is_named() && !file.is_locked())
    }
}

impl LockedFile {
    /// True if the file is the lock or an image of an emulator that could not save the changes in NOVRAM.
    fn is_unsaved(&self) -> bool {
        match self.path.ends_with(LOCK) {
            true => instance::is_unsaved(&self.file),
            false => self.state() == Some(State::Unsaved),
        }
    }

    /// State in the header page, if the file is an image.
    fn state(&self) -> Option<State> {
        let mut state = [0; 4];
        self.file.read_exact_at(&mut state, core::mem::offset_of!(Header, state) as u64).ok()?;
        State::from_code(u32::from_le_bytes(state))
    }

    /// [`file::is_locked`]
    fn is_locked(&self) -> bool {
        file::is_locked(&self.file)
    }

    fn is_named(&self) -> bool {
        let both = (lstat(&self.path), fstat(&self.file));
        matches!(both, (Ok(named), Ok(own)) if (named.st_dev, named.st_ino) == (own.st_dev, own.st_ino))
    }
}

/// Returns the lock file in the instance's directory.
fn lock_file(instance: &str) -> Result<Option<LockedFile>, MemoryError> {
    let path = names::channel_root(instance)?;
    let Some(directory) = PrivateDir::open(&path)? else { return Ok(None) };
    let file = directory.find_file(LOCK)?;
    Ok(file.map(|file| LockedFile { path: path.join(LOCK), file }))
}

/// The lock file in the instance's directory if it belongs to this user, although other users can write to the
/// directory.
fn own_lock_file(instance: &str) -> Result<Option<LockedFile>, MemoryError> {
    let path = names::channel_root(instance)?;
    let file = PrivateDir::find_own_file(&path, LOCK)?;
    Ok(file.map(|file| LockedFile { path: path.join(LOCK), file }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::InstanceLock;
    use crate::memory::testing::{Emulator, Instance};

    fn find(instance: &str) -> Option<RunningInstance> {
        RunningInstance::find(instance).unwrap()
    }

    #[test]
    fn the_next_emulator_of_that_name_is_another_one() {
        let instance = Instance::new();
        let lock = InstanceLock::take(&instance).unwrap();
        let first = find(&instance).unwrap();
        assert_eq!(first.process().unwrap().pid(), std::process::id());
        assert!(!first.has_ended());
        drop(lock);
        let lock = InstanceLock::take(&instance).unwrap();
        assert!(first.has_ended() && !first.has_left_files());
        let next = find(&instance).unwrap();
        assert!(!next.has_ended());
        drop(lock);
        assert!(next.has_ended() && find(&instance).is_none());
    }

    #[test]
    fn an_emulator_is_found_by_its_image_and_a_killed_one_has_left_that() {
        let instance = Instance::new();
        let emulator = Emulator::start(&instance);
        let running = find(&instance).unwrap();
        assert_eq!(running.process().unwrap().pid(), emulator.pid());
        assert!(!running.has_ended());
        emulator.kill();
        assert!(running.has_ended() && running.has_left_files() && find(&instance).is_none());
    }

    #[cfg(feature = "emulator")]
    #[test]
    fn the_lock_of_an_ended_emulator_tells_that_novram_is_lost() {
        let instance = Instance::new();
        let lock = InstanceLock::take(&instance).unwrap();
        let (early, pid) = (find(&instance).unwrap(), std::process::id());
        assert!(!early.is_unsaved());
        lock.set_unsaved();
        let late = find(&instance).unwrap();
        assert_eq!(late.process().unwrap().pid(), pid);
        drop(lock);
        for running in [early, late] {
            assert!(running.has_ended() && !running.has_left_files() && running.is_unsaved());
        }
        let next = InstanceLock::take(&instance).unwrap();
        assert!(!find(&instance).unwrap().is_unsaved());
        drop(next);
    }

    #[test]
    fn a_process_that_cleans_up_is_no_emulator() {
        let instance = Instance::new();
        let lock = InstanceLock::take_to_clean(&instance).unwrap();
        assert!(InstanceLock::holder(&instance).unwrap().is_some());
        assert!(find(&instance).is_none());
        drop(lock);
    }
}
