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
        let start = read_stat(pid).and_then(|stat| parse_stat(&stat)).map_or(0, |(_, start)| start);
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
        self.is_running() && state(self.pid).is_some_and(|(state, _)| matches!(state, 'T' | 't'))
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
    let (state, start) = state(pid)?;
    (!matches!(state, 'Z' | 'X' | 'x')).then_some(start)
}

fn state(pid: u32) -> Option<(char, u64)> {
    parse_stat(&read_stat(pid)?)
}

fn read_stat(pid: u32) -> Option<String> {
    // The command name may contain any bytes.
    let bytes = read_kernel_file(&format!("/proc/{pid}/stat")).ok()?;
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

/// Reads a file of the kernel. Such a file has no length, so `std::fs::read` would read it in many small parts.
pub(in crate::memory) fn read_kernel_file(path: &str) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(PAGE);
    File::open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// State (field 3) and start time (field 22). The command name before them may itself contain blanks and
/// parentheses, so the fields are counted from the last closing parenthesis.
fn parse_stat(stat: &str) -> Option<(char, u64)> {
    let mut fields = stat.get(stat.rfind(')')? + 1..)?.split_ascii_whitespace();
    let state = fields.next()?.chars().next()?;
    Some((state, fields.nth(18)?.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found_after_a_command_name_with_parentheses() {
        let stat = "42 (a) Z (b) S 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 4711 20 21";
        assert_eq!(parse_stat(stat), Some(('S', 4711)));
        assert_eq!(parse_stat("42 (a) S 1 2"), None);
        assert_eq!(parse_stat(""), None);
        assert_eq!(parse_stat("42 (a)"), None);
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
        let stat = read_stat(child.id()).and_then(|stat| parse_stat(&stat)).unwrap();
        let process = ProcessId { pid: child.id(), start: stat.1 };
        assert!(process.is_running());
        child.kill().unwrap();
        while process.is_running() {
            std::thread::yield_now();
        }
        child.wait().unwrap();
    }
}
