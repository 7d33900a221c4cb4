//! Identifies the process of an emulator, and checks whether it still runs.

use std::fs::{self, File};
use std::io::{self, Read};
use std::os::unix::fs::MetadataExt;
use std::sync::OnceLock;

/// Bytes that one read of a file of the kernel returns at most.
const PAGE: usize = 4096;

/// A process, distinguished from later processes with the same number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ProcessId {
    /// Number of the process (pid).
    pub pid: u32,
    /// Start time in clock ticks since boot: field 22 of `/proc/<pid>/stat`.
    pub start: u64,
}

impl ProcessId {
    /// Returns this process. Without `/proc` the start time is 0. This value never makes a running process look ended.
    pub(crate) fn own() -> Self {
        static OWN: OnceLock<ProcessId> = OnceLock::new();
        let pid = std::process::id();
        // After a fork, the value is that of the other process.
        match OWN.get_or_init(|| Self::read_own(pid)) {
            own if own.pid == pid => *own,
            _ => Self::read_own(pid),
        }
    }

    fn read_own(pid: u32) -> Self {
        let start = Stat::of(pid).map_or(0, |stat| stat.start);
        Self { pid, start }
    }

    /// Returns the process that has this number now; `None` if it has ended or is in another pid namespace.
    pub(crate) fn of(pid: u32) -> Option<Self> {
        running_since(pid).map(|start| Self { pid, start })
    }

    /// Parses a process from the text that [`core::fmt::Display`] writes.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let (pid, start) = text.trim_end().split_once(' ')?;
        Some(Self { pid: pid.parse().ok()?, start: start.parse().ok()? })
    }

    /// True if the process exists in this pid namespace and has not ended. A zombie has ended.
    pub(crate) fn is_running(self) -> bool {
        running_since(self.pid) == Some(self.start)
    }

    /// True if the process belongs to the same user as this process.
    pub(crate) fn is_own(self) -> bool {
        let user = rustix::process::geteuid().as_raw();
        fs::metadata(format!("/proc/{}", self.pid)).is_ok_and(|process| process.uid() == user)
    }

    /// True if the process is stopped (SIGSTOP) and waits for SIGCONT.
    pub(crate) fn is_stopped(self) -> bool {
        self.is_running() && Stat::of(self.pid).is_some_and(|stat| matches!(stat.state, 'T' | 't'))
    }
}

/// Process id and start time, with a blank in between.
impl core::fmt::Display for ProcessId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} {}", self.pid, self.start)
    }
}

/// Returns the start time of the process with this number; `None` if it has ended. A zombie has ended.
fn running_since(pid: u32) -> Option<u64> {
    let stat = Stat::of(pid)?;
    (!matches!(stat.state, 'Z' | 'X' | 'x')).then_some(stat.start)
}

/// Returns the parent of a process; `None` if the process has ended and its parent has noticed it.
#[cfg(feature = "emulator")]
pub(in crate::memory) fn parent_of(pid: u32) -> Option<u32> {
    Stat::of(pid).map(|stat| stat.parent)
}

/// What `/proc/<pid>/stat` contains about a process.
#[derive(Debug, PartialEq, Eq)]
struct Stat {
    /// Field 3.
    state: char,
    /// Number of the parent: field 4.
    parent: u32,
    /// Start time: field 22.
    start: u64,
}

impl Stat {
    fn of(pid: u32) -> Option<Self> {
        Self::parse(&read_kernel_file(&format!("/proc/{pid}/stat")).ok()?)
    }

    /// The command name before the state may itself contain blanks and parentheses, so the fields are counted from the
    /// last closing parenthesis.
    fn parse(stat: &str) -> Option<Self> {
        let mut fields = stat.get(stat.rfind(')')? + 1..)?.split_ascii_whitespace();
        let state = fields.next()?.chars().next()?;
        let parent = fields.next()?.parse().ok()?;
        Some(Self { state, parent, start: fields.nth(17)?.parse().ok()? })
    }
}

/// Reads a file of the kernel. Such a file has no length, so `std::fs::read` would read it in many small parts. It may
/// contain names of programs and files, and their bytes may be any: those that are not UTF-8 are replaced.
///
/// # Errors
/// The file cannot be opened or read.
pub(crate) fn read_kernel_file(path: &str) -> io::Result<String> {
    let mut bytes = Vec::with_capacity(PAGE);
    File::open(path)?.read_to_end(&mut bytes)?;
    Ok(String::from_utf8(bytes)
        .unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found_after_a_command_name_with_parentheses() {
        let stat = "42 (a) Z (b) S 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 4711 20 21";
        assert_eq!(Stat::parse(stat), Some(Stat { state: 'S', parent: 1, start: 4711 }));
        assert_eq!(Stat::parse("42 (a) S 1 2"), None);
        assert_eq!(Stat::parse(""), None);
        assert_eq!(Stat::parse("42 (a)"), None);
    }

    #[test]
    fn this_process_runs_and_an_older_one_of_its_number_does_not() {
        let own = ProcessId::own();
        assert!(own.start > 0);
        assert!(own.is_running() && own.is_own());
        assert!(!ProcessId { start: own.start - 1, ..own }.is_running());
        assert!(!ProcessId { pid: u32::MAX, start: 0 }.is_running());
    }

    #[test]
    fn a_zombie_has_ended() {
        let mut child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let process = ProcessId::of(child.id()).unwrap();
        assert!(process.is_running());
        child.kill().unwrap();
        while process.is_running() {
            std::thread::yield_now();
        }
        child.wait().unwrap();
    }
}
