//! The kernel's table of file locks, which names the process that holds a lock.
//!
//! A lock file and a header page also name a process, but any program of the same user can write them.

use rustix::fs::{Stat, fstat, major, minor};
use std::fs::{self, File};

/// The kernel's table of locks. Locks of processes in other PID namespaces are missing from it.
const TABLE: &str = "/proc/locks";

/// Process id of the holder of the exclusive `flock` lock of a file. `None` if the kernel shows no such process here.
pub(super) fn holder_of(file: &File) -> Option<u32> {
    let stat = fstat(file).ok()?;
    let table = fs::read_to_string(TABLE).ok()?;
    table.lines().find_map(|line| holder_in(line, &stat))
}

/// True if an open file of process `pid` has the exclusive `flock` lock of `file`. In contrast to [`holder_of`], this does
/// not need the kernel's table of locks, which a sandbox may hide.
pub(super) fn is_held_by(file: &File, pid: u32) -> bool {
    let (Ok(stat), Ok(files)) = (fstat(file), fs::read_dir(format!("/proc/{pid}/fdinfo"))) else {
        return false;
    };
    let infos = files.flatten().filter_map(|entry| fs::read_to_string(entry.path()).ok());
    infos.into_iter().any(|info| {
        let mut locks = info.lines().filter_map(|line| line.strip_prefix("lock:"));
        locks.any(|line| holder_in(line, &stat).is_some())
    })
}

/// Returns the holder in a line of the table, if the line describes an exclusive `flock` lock of this file.
fn holder_in(line: &str, stat: &Stat) -> Option<u32> {
    // A line about a process that waits for a lock has `->` in this field, so it is not accepted.
    let mut fields = line.split_ascii_whitespace().skip(1);
    let is_exclusive = fields.next()? == "FLOCK" && fields.nth(1)? == "WRITE";
    let pid = fields.next()?.parse().ok()?;
    let mut place = fields.next()?.split(':');
    let mut hex = || u32::from_str_radix(place.next()?, 16).ok();
    let device = (hex()?, hex()?);
    let is_it =
        device == (major(stat.st_dev), minor(stat.st_dev)) && place.next()?.parse() == Ok(stat.st_ino);
    (is_exclusive && is_it).then_some(pid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_holder_of_an_exclusive_lock_is_found() {
        let file = tempfile::tempfile().unwrap();
        assert_eq!(holder_of(&file), None);
        file.lock_shared().unwrap();
        assert_eq!(holder_of(&file), None, "a shared lock is not meant");
        file.lock().unwrap();
        // On some file systems, the device number in the table differs from that of `stat`. Then no holder is found.
        assert!(holder_of(&file).is_none_or(|pid| pid == std::process::id()));
        let memory = tempfile::tempfile_in(super::super::names::IMAGE_DIRECTORY).unwrap();
        memory.lock().unwrap();
        assert_eq!(holder_of(&memory), Some(std::process::id()));
        assert!(is_held_by(&memory, std::process::id()));
        memory.lock_shared().unwrap();
        assert!(!is_held_by(&memory, std::process::id()), "a shared lock is not meant");
    }

    #[test]
    fn only_the_line_of_the_file_counts() {
        let file = tempfile::tempfile().unwrap();
        let stat = fstat(&file).unwrap();
        let place = format!("{:02x}:{:02x}:{}", major(stat.st_dev), minor(stat.st_dev), stat.st_ino);
        let of = |line: String| holder_in(&line, &stat);
        assert_eq!(of(format!("1: FLOCK  ADVISORY  WRITE 42 {place} 0 EOF")), Some(42));
        for line in [
            format!("1: -> FLOCK  ADVISORY  WRITE 42 {place} 0 EOF"),
            format!("1: FLOCK  ADVISORY  READ 42 {place} 0 EOF"),
            format!("1: POSIX  ADVISORY  WRITE 42 {place} 0 EOF"),
            format!("1: FLOCK  ADVISORY  WRITE -1 {place} 0 EOF"),
            format!("1: FLOCK  ADVISORY  WRITE 42 {place}1 0 EOF"),
            String::new(),
        ] {
            assert_eq!(of(line.clone()), None, "{line}");
        }
    }
}
