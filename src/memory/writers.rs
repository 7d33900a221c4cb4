//! Finds other processes that can write to the registers of an image.

use super::HEADER_SIZE;
use super::process::{parent_of, read_kernel_file};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Returns the other processes that have the registers of this file mapped for writing, as `NAME (process NUMBER)`.
/// Processes of other users are not visible, but only the owner of an image can open it. Clients of the channel map
/// only the header page and are not listed.
///
/// A child of such a process is not listed beside its parent. While a program starts another one, the child has the
/// maps of its parent for a moment.
pub(crate) fn writers_of(file: &Path) -> Vec<String> {
    let Ok(file) = fs::metadata(file) else { return Vec::new() };
    let Ok(processes) = fs::read_dir("/proc") else { return Vec::new() };
    let numbers = processes.flatten().filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    let others = numbers.filter(|number| *number != std::process::id());
    let has_mapped = |number: &u32| {
        let maps = read_kernel_file(&format!("/proc/{number}/maps")).unwrap_or_default();
        let device = (rustix::fs::major(file.dev()), rustix::fs::minor(file.dev()));
        maps.lines().any(|line| is_of(line, device, file.ino()).unwrap_or(false))
    };
    let found = without_children(others.filter(has_mapped).collect(), parent_of);
    found.into_iter().map(describe_process).collect()
}

/// Removes the processes with a parent in the list, and those that have ended in the meantime.
fn without_children(mut found: Vec<u32>, parent: impl Fn(u32) -> Option<u32>) -> Vec<u32> {
    let all = found.clone();
    found.retain(|number| parent(*number).is_some_and(|parent| !all.contains(&parent)));
    found
}

/// Returns the name and number of a process, as in messages: `NAME (process NUMBER)`, or `process NUMBER` if the
/// process has ended.
pub(crate) fn describe_process(number: u32) -> String {
    let name = read_kernel_file(&format!("/proc/{number}/comm")).unwrap_or_default();
    match name.trim_end() {
        "" => format!("process {number}"),
        name => format!("{name} (process {number})"),
    }
}

/// True if a line of `/proc/PID/maps` maps more than the header page of this file for writing.
fn is_of(line: &str, (major, minor): (u32, u32), inode: u64) -> Option<bool> {
    let mut fields = line.split_ascii_whitespace();
    let (begin, end) = fields.next()?.split_once('-')?;
    let length = u64::from_str_radix(end, 16).ok()?.checked_sub(u64::from_str_radix(begin, 16).ok()?)?;
    let is_written = fields.next()?.as_bytes().get(1) == Some(&b'w');
    let (found_major, found_minor) = fields.nth(1)?.split_once(':')?;
    let found = (u32::from_str_radix(found_major, 16).ok()?, u32::from_str_radix(found_minor, 16).ok()?);
    let is_file = found == (major, minor) && fields.next()?.parse() == Ok(inode);
    Some(is_file && is_written && length > HEADER_SIZE as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_children_of_writers_are_not_listed() {
        // 9 has started 4, and 4 has started 12. The number of a child may be smaller than that of its parent.
        let parent =
            |number| [(4, 9), (9, 1), (12, 4), (13, 7)].into_iter().find(|of| of.0 == number).map(|of| of.1);
        assert_eq!(without_children(vec![4, 9, 12, 13], parent), [9, 13]);
        assert_eq!(without_children(vec![4, 12], parent), [4], "their parent has ended or unmapped the file");
        assert_eq!(without_children(vec![4, 5], parent), [4], "5 has ended");
        assert_eq!(parent_of(std::process::id()), Some(std::os::unix::process::parent_id()));
    }

    #[test]
    fn lines_contain_length_rights_device_and_file() {
        let line =
            |range, rights, place| format!("{range} {rights} 00000000 {place}    /dev/shm/commram.a.b");
        let of = |line: String| is_of(&line, (0, 0x1a), 4711);
        assert_eq!(of(line("7f0000000000-7f0000002000", "rw-s", "00:1a 4711")), Some(true));
        assert_eq!(of(line("7f0000000000-7f0000001000", "rw-s", "00:1a 4711")), Some(false));
        assert_eq!(of(line("7f0000000000-7f0000002000", "r--s", "00:1a 4711")), Some(false));
        assert_eq!(of(line("7f0000000000-7f0000002000", "rw-s", "00:1b 4711")), Some(false));
        assert_eq!(of(line("7f0000000000-7f0000002000", "rw-s", "00:1a 471")), Some(false));
        assert_eq!(is_of("", (0, 0), 0), None);
    }
}
