//! The process of an emulator, pinned by a descriptor and its start time, so that it is never confused with a later
//! process of the same number.

use super::file::{self, ImageFile};
use super::process::{ProcessId, read_kernel_file};
use super::{MemoryError, locks};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, Signal};
use std::fs::File;
use std::os::fd::{AsRawFd, OwnedFd};
use std::time::Duration;

/// Number of times that the kernel's table of locks is read. While other locks change, a single read may miss a line.
const READS: usize = 3;
/// Marks the SIGTERM of [`EmulatorProcess::terminate`]. The mark is in the field `si_errno`, which Linux passes on and does
/// not use.
const STOP_MARK: i32 = i32::from_be_bytes(*b"stop");

/// True if [`EmulatorProcess::terminate`] has sent this signal. Such a signal ends only the emulator in this process,
/// and not the command that `commram with` runs.
#[cfg(feature = "cli")]
pub(crate) fn is_from_stop(signal: &libc::siginfo_t) -> bool {
    (signal.si_signo, signal.si_code, signal.si_errno) == (libc::SIGTERM, libc::SI_QUEUE, STOP_MARK)
}

/// Returns the process that has sent the signal; `None` for a signal of the kernel.
#[cfg(feature = "cli")]
pub(crate) fn sender_of(signal: &libc::siginfo_t) -> Option<u32> {
    matches!(signal.si_code, libc::SI_USER | libc::SI_QUEUE | libc::SI_TKILL)
        // SAFETY: the kernel sets this field for signals with these codes.
        .then(|| unsafe { signal.si_pid() })
        .and_then(|pid| u32::try_from(pid).ok())
        .filter(|pid| *pid != 0)
}

/// A living emulator of this user, as a process.
#[derive(Debug)]
pub struct EmulatorProcess {
    id: ProcessId,
    descriptor: OwnedFd,
}

impl EmulatorProcess {
    /// Returns the emulator that has locked `file` according to the kernel's table of locks. The file names it, or it has
    /// mapped images; another program of this user may have locked the file of a killed emulator. If the table shows no such
    /// process, returns the process `signed`, which a file names, if the kernel shows the lock at its open files. `None`
    /// if the process has ended, belongs to another user, or is not visible in this pid namespace.
    pub(super) fn holding(file: &File, signed: Option<ProcessId>) -> Result<Option<Self>, MemoryError> {
        if let Some(process) = Self::in_table(file)? {
            return Ok(process.filter(|process| signed == Some(process.id) || process.serves_images()));
        }
        let Some(process) = signed.map_or(Ok(None), Self::pin)? else { return Ok(None) };
        // Any program of this user can write the name of another process to the file. The process is pinned, so the
        // lock is that of this process and not that of a later process with the same number.
        Ok((locks::is_held_by(file, process.pid()) && process.is_running()).then_some(process))
    }

    /// Returns the process that has locked `file` according to the kernel's table of locks. `None` if the table shows no such
    /// process, `Some(None)` if the process cannot be pinned.
    fn in_table(file: &File) -> Result<Option<Option<Self>>, MemoryError> {
        for _ in 0..READS {
            let Some(pid) = locks::holder_of(file) else { continue };
            let process = ProcessId::of(pid).map_or(Ok(None), Self::pin)?;
            // The process may have ended before it was pinned, and another process may have its number. So the lock is
            // checked again.
            if locks::holder_of(file) == Some(pid) {
                return Ok(Some(process));
            }
        }
        Ok(None)
    }

    /// Returns the process that serves the image of a PLC. `None` if the image is not locked, or the process has ended,
    /// belongs to another user, or is not visible in this pid namespace.
    ///
    /// # Errors
    /// The names are invalid, the image does not belong to this user, or the operating system refuses the operation.
    pub fn serving(instance: &str, plc: &str) -> Result<Option<Self>, MemoryError> {
        let Some(image) = ImageFile::open(instance, plc, false)? else { return Ok(None) };
        if !image.is_locked() {
            return Ok(None);
        }
        let signed = image.own_header().ok().map(|header| file::emulator(&header));
        Self::holding(&image.file, signed)
    }

    /// Returns the process that has locked `file` according to the kernel. It need not be an emulator.
    ///
    /// # Errors
    /// The operating system refuses the operation.
    #[cfg(feature = "cli")]
    pub(crate) fn holding_lock(file: &File) -> Result<Option<Self>, MemoryError> {
        Ok(Self::in_table(file)?.flatten())
    }

    /// True if this process was started before the other one.
    #[cfg(feature = "cli")]
    pub(crate) fn is_older_than(&self, other: &Self) -> bool {
        self.id.start < other.id.start
    }

    /// True if the process is stopped (SIGSTOP).
    #[cfg(feature = "cli")]
    pub(crate) fn is_stopped(&self) -> bool {
        self.id.is_stopped()
    }

    /// True if the process has mapped files in the directory of the images.
    fn serves_images(&self) -> bool {
        let maps = read_kernel_file(&format!("/proc/{}/maps", self.id.pid)).unwrap_or_default();
        maps.lines().any(|line| line.contains(" /dev/shm/"))
    }

    fn pin(id: ProcessId) -> Result<Option<Self>, MemoryError> {
        let Some(pid) = i32::try_from(id.pid).ok().and_then(Pid::from_raw) else { return Ok(None) };
        let descriptor = match rustix::process::pidfd_open(pid, PidfdFlags::empty()) {
            Ok(descriptor) => descriptor,
            // The process does not exist, or the number is that of a thread.
            Err(Errno::SRCH | Errno::INVAL | Errno::NOENT) => return Ok(None),
            Err(errno) => return Err(failed(id.pid, "open a descriptor of the process", errno)),
        };
        // The descriptor always refers to the same process. This check proves that this process is the wanted one.
        Ok((id.is_running() && id.is_own()).then_some(Self { id, descriptor }))
    }

    /// Process id of the emulator.
    pub fn pid(&self) -> u32 {
        self.id.pid
    }

    /// True if the process has not ended yet.
    pub fn is_running(&self) -> bool {
        !self.wait(Duration::ZERO)
    }

    /// Waits for the end of the process, for at most `limit`. Returns true if it has ended.
    pub fn wait(&self, limit: Duration) -> bool {
        let mut ended = [PollFd::new(&self.descriptor, PollFlags::IN)];
        // A signal may interrupt the wait, so the error is ignored: the caller then calls this function again.
        let _ = poll(&mut ended, Timespec::try_from(limit).ok().as_ref());
        let [ended] = ended;
        !ended.revents().is_empty()
    }

    /// Continues the process if it was stopped (SIGSTOP, or Ctrl-Z in its terminal). Returns true if it was.
    ///
    /// # Errors
    /// The operating system refuses the operation.
    pub fn resume(&self) -> Result<bool, MemoryError> {
        let stopped = self.id.is_stopped();
        if stopped {
            self.signal(Signal::CONT)?;
        }
        Ok(stopped)
    }

    /// Asks the emulator to end normally, by a marked SIGTERM. On this signal `commram with` ends its emulator. It
    /// passes a SIGTERM without the mark on to its command.
    ///
    /// # Errors
    /// The operating system refuses the operation.
    pub fn terminate(&self) -> Result<(), MemoryError> {
        // SAFETY: zero is a valid value of every field of this structure.
        let mut info: libc::siginfo_t = unsafe { core::mem::zeroed() };
        (info.si_signo, info.si_code, info.si_errno) = (libc::SIGTERM, libc::SI_QUEUE, STOP_MARK);
        let process = self.descriptor.as_raw_fd();
        // SAFETY: the descriptor is open during the call, and the kernel only reads the structure.
        let sent =
            unsafe { libc::syscall(libc::SYS_pidfd_send_signal, process, libc::SIGTERM, &raw const info, 0) };
        // A sandbox may refuse a signal with the mark. A plain SIGTERM is sent instead.
        if sent == 0 { Ok(()) } else { self.signal(Signal::TERM) }
    }

    fn signal(&self, signal: Signal) -> Result<(), MemoryError> {
        match rustix::process::pidfd_send_signal(&self.descriptor, signal) {
            Ok(()) | Err(Errno::SRCH) => Ok(()),
            Err(errno) => Err(failed(self.pid(), "send a signal", errno)),
        }
    }
}

fn failed(pid: u32, doing: &'static str, errno: Errno) -> MemoryError {
    MemoryError::System { path: format!("/proc/{pid}").into(), doing, reason: errno.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::names::IMAGE_DIRECTORY;

    #[test]
    fn the_kernel_names_the_holder_not_the_lock_file() {
        let mut bystander = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let signed = ProcessId::of(bystander.id());
        let file = tempfile::tempfile_in(IMAGE_DIRECTORY).unwrap();
        file.lock().unwrap();
        let pid_of = |signed| EmulatorProcess::holding(&file, signed).unwrap().map(|found| found.pid());
        assert_eq!(pid_of(Some(ProcessId::own())), Some(std::process::id()));
        // This process is an emulator if another test has mapped an image; the other process is none in any case.
        assert_ne!(pid_of(signed), Some(bystander.id()));
        file.unlock().unwrap();
        assert!(EmulatorProcess::holding(&file, signed).unwrap().is_none(), "only a file names the process");
        let other = EmulatorProcess::pin(signed.unwrap()).unwrap().unwrap();
        assert!(other.is_running());
        bystander.kill().unwrap();
        assert!(other.wait(Duration::from_secs(60)) && !other.is_running(), "a zombie has ended");
        bystander.wait().unwrap();
        other.terminate().unwrap();
    }

    #[test]
    fn another_start_time_or_a_thread_is_another_process() {
        let own = ProcessId::own();
        assert!(EmulatorProcess::pin(own).unwrap().is_some());
        assert!(EmulatorProcess::pin(ProcessId { start: own.start - 1, ..own }).unwrap().is_none());
        assert!(EmulatorProcess::pin(ProcessId { pid: u32::MAX, start: 0 }).unwrap().is_none());
        let thread = std::thread::spawn(|| {
            let pid = rustix::thread::gettid().as_raw_nonzero().get().unsigned_abs();
            EmulatorProcess::pin(ProcessId { pid, start: 0 }).unwrap().is_none()
        });
        assert!(thread.join().unwrap());
    }
}
