//! The lock of an instance: one emulator per name, whatever its PLCs are called.
//!
//! It is a file in the instance's directory, which belongs to one user alone. The images have locks of their own,
//! by which clients tell whether their emulator lives; they cannot keep emulators with other PLCs apart.

use super::file::{self, ImageFile};
use super::private::PrivateDir;
use super::process::ProcessId;
use super::{Image, MemoryError, list, names};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, Signal};
use std::fs::{File, TryLockError};
use std::io;
use std::os::unix::fs::FileExt;
use std::time::{Duration, Instant};

/// The file in the instance's directory; holds process id and start time of the emulator.
const LOCK: &str = "lock";
/// How long to wait for a lock: its holder may be just ending, or looked at.
const PATIENCE: Duration = Duration::from_millis(500);

/// The right to be the emulator of an instance, or to remove what one has left. Others who want it are refused as
/// long as it lives.
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
    /// Bad name; another emulator has the instance ([`MemoryError::InstanceTaken`]); its directory is not ours
    /// alone, or the system refuses.
    pub fn take(instance: &str) -> Result<Self, MemoryError> {
        let path = names::channel_root(instance)?;
        let failed = |doing, reason| MemoryError::System { path: path.join(LOCK), doing, reason };
        let start = Instant::now();
        loop {
            let directory = PrivateDir::create(&path)?;
            // Whoever had it may be removing directory and lock.
            let Some(file) = directory.open_file(LOCK).map_err(|reason| failed("open", reason))? else {
                continue;
            };
            match file.try_lock() {
                Ok(()) if directory.is_named() && directory.names(LOCK, &file) => {
                    let lock = Self { instance: instance.to_owned(), directory, file };
                    // Without room for that nothing of it stays.
                    sign(&lock.file).map_err(|reason| failed("write", reason))?;
                    return Ok(lock);
                }
                Ok(()) => continue,
                Err(TryLockError::Error(reason)) => return Err(failed("lock", reason)),
                Err(TryLockError::WouldBlock) => {}
            }
            if start.elapsed() >= PATIENCE {
                let pid = EmulatorProcess::signed(&file).map(|process| process.pid());
                return Err(MemoryError::InstanceTaken { instance: instance.to_owned(), pid });
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Who has the lock of `instance`: `None` if nobody has, `Some(None)` if it is a process that cannot be seen from
    /// here, in another pid namespace.
    ///
    /// # Errors
    /// Bad name, or the instance's directory is not ours alone.
    pub fn holder(instance: &str) -> Result<Option<Option<EmulatorProcess>>, MemoryError> {
        let path = names::channel_root(instance)?;
        let Some(file) = PrivateDir::open(&path)?.and_then(|directory| directory.find_file(LOCK)) else {
            return Ok(None);
        };
        match file.try_lock_shared() {
            Ok(()) => Ok(None),
            Err(TryLockError::WouldBlock) => Ok(Some(EmulatorProcess::signed(&file))),
            Err(TryLockError::Error(reason)) => {
                Err(MemoryError::System { path: path.join(LOCK), doing: "lock", reason })
            }
        }
    }

    /// Removes the images that a killed emulator has left, but for those of the PLCs that `keep` names. Returns
    /// whether there were any.
    ///
    /// # Errors
    /// An image is none of ours, its emulator lives, or the system refuses; the others are removed.
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
        // The lock is let go of behind this, when the file is closed.
        self.directory.remove(LOCK);
        self.directory.remove_if_empty();
    }
}

/// Tells who holds the lock, for messages.
fn sign(file: &File) -> io::Result<()> {
    file.set_len(0)?;
    file.write_all_at(format!("{}\n", ProcessId::own()).as_bytes(), 0)
}

/// A living emulator of ours, as a process.
#[derive(Clone, Copy, Debug)]
pub struct EmulatorProcess(ProcessId);

impl EmulatorProcess {
    /// The process that has signed a lock file, if it lives and can be seen.
    fn signed(file: &File) -> Option<Self> {
        let mut text = [0; 64];
        let length = file.read_at(&mut text, 0).ok()?;
        let process = ProcessId::parse(core::str::from_utf8(text.get(..length)?).ok()?)?;
        process.is_running().then_some(Self(process))
    }

    /// The process that serves the image of a PLC, as its header page tells: when the instance's directory has been
    /// removed, nothing else does. `None` if it does not hold the image's lock, is not of this user, has not the
    /// start time that stands there, or cannot be seen from here.
    ///
    /// # Errors
    /// Bad names, or the image is not one of ours.
    pub fn serving(instance: &str, plc: &str) -> Result<Option<Self>, MemoryError> {
        let Some(image) = ImageFile::open(instance, plc, false)? else { return Ok(None) };
        let process = file::emulator(&*image.own_header()?);
        let is_it = image.is_locked() && process.is_own() && process.is_running();
        Ok(is_it.then_some(Self(process)))
    }

    /// Its process id.
    pub fn pid(&self) -> u32 {
        self.0.pid
    }

    /// Whether it has not ended yet.
    pub fn is_running(&self) -> bool {
        self.0.is_running()
    }

    /// Lets it go on, if it was stopped (SIGSTOP, or Ctrl-Z in its terminal). Returns whether it was.
    ///
    /// # Errors
    /// The system refuses.
    pub fn resume(&self) -> Result<bool, MemoryError> {
        let stopped = self.0.is_stopped();
        if stopped {
            self.signal(Signal::CONT)?;
        }
        Ok(stopped)
    }

    /// Asks it to end in good order, by SIGTERM.
    ///
    /// # Errors
    /// The system refuses.
    pub fn terminate(&self) -> Result<(), MemoryError> {
        self.signal(Signal::TERM)
    }

    fn signal(&self, signal: Signal) -> Result<(), MemoryError> {
        let failed = |errno: Errno| MemoryError::System {
            path: format!("/proc/{}", self.pid()).into(),
            doing: "send a signal",
            reason: errno.into(),
        };
        let Some(pid) = i32::try_from(self.pid()).ok().and_then(Pid::from_raw) else { return Ok(()) };
        let process = match rustix::process::pidfd_open(pid, PidfdFlags::empty()) {
            Ok(process) => process,
            Err(Errno::SRCH) => return Ok(()),
            Err(errno) => return Err(failed(errno)),
        };
        // The descriptor stands for one process for ever; now it is certain that it is the right one.
        if !self.0.is_running() {
            return Ok(());
        }
        match rustix::process::pidfd_send_signal(process, signal) {
            Ok(()) | Err(Errno::SRCH) => Ok(()),
            Err(errno) => Err(failed(errno)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::testing::Instance;

    #[test]
    fn one_at_a_time_has_an_instance() {
        let instance = Instance::new();
        let lock = InstanceLock::take(&instance).unwrap();
        let refused = InstanceLock::take(&instance).unwrap_err().to_string();
        let pid = std::process::id();
        assert!(
            refused.starts_with(&format!("instance {} is already running (process {pid})", &*instance)),
            "{refused}"
        );
        assert_eq!(InstanceLock::holder(&instance).unwrap().unwrap().unwrap().pid(), pid);
        drop(lock);
        assert!(InstanceLock::holder(&instance).unwrap().is_none());
        drop(InstanceLock::take(&instance).unwrap());
        assert!(!names::channel_root(&instance).unwrap().exists());
    }

    #[test]
    fn many_at_once_never_have_it_together() {
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
