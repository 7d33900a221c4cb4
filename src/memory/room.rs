//! Checks that there is memory for all images before the first image is created.
//!
//! Images are in memory. Without this check, a too large plant would first take all memory from the other
//! programs of the machine, and then fail.

#[cfg(feature = "emulator")]
use super::MemoryError;
#[cfg(feature = "emulator")]
use super::names;
use super::names::IMAGE_DIRECTORY;
use rustix::io::Errno;
use std::io;
use std::path::Path;

/// Free bytes in the memory file system; `None` if unknown. A file system without a limit reports 0 of 0 blocks.
pub(crate) fn free() -> Option<u64> {
    let stat = rustix::fs::statvfs(IMAGE_DIRECTORY).ok().filter(|stat| stat.f_blocks > 0)?;
    Some(stat.f_bavail.saturating_mul(stat.f_frsize))
}

/// Number of inodes that a channel and some clients need. If fewer inodes are free, this can be the reason for an
/// error.
const FEW_INODES: u64 = 32;

/// Returns the text about free inodes, to append to the error of a system call at `path`; empty if enough inodes are
/// free.
pub(crate) fn named(path: &Path, reason: &io::Error) -> String {
    if Errno::from_io_error(reason) != Some(Errno::NOSPC) {
        return String::new();
    }
    // After a failed start the directory no longer exists, so the check uses the nearest directory that exists.
    let is_there = |directory: &&Path| directory.is_dir();
    describe_inodes(path.ancestors().skip(1).find(is_there).unwrap_or(Path::new(".")))
}

/// Returns a text like [`named`], for an error in the memory file system that a lack of inodes may have caused.
#[cfg(feature = "channel")]
pub(crate) fn describe_lack() -> String {
    describe_inodes(Path::new(IMAGE_DIRECTORY))
}

fn describe_inodes(directory: &Path) -> String {
    match rustix::fs::statvfs(directory) {
        // Some file systems have no fixed number of inodes, and report 0 of 0.
        Ok(stat) if stat.f_files > 0 && stat.f_favail < FEW_INODES => format!(
            "; {} has {} free inodes: remove files from it, or mount it with more (`nr_inodes` of tmpfs)",
            directory.display(),
            stat.f_favail
        ),
        _ => String::new(),
    }
}

/// Checks that the images of `instance`, each given as PLC and length in bytes, fit into the free memory together.
/// Images of a killed emulator already have their memory. A single image is not checked, because its
/// creation reports the error.
///
/// # Errors
/// The names are invalid, or [`MemoryError::NoRoomForAll`].
#[cfg(feature = "emulator")]
pub(crate) fn check<'a>(
    instance: &str,
    images: impl ExactSizeIterator<Item = (&'a str, usize)>,
) -> Result<(), MemoryError> {
    let count = images.len();
    if count <= 1 {
        return Ok(());
    }
    let mut needed = 0u64;
    for (plc, length) in images {
        let there = names::image_path(instance, plc)?.symlink_metadata().map_or(0, |file| file.len());
        needed = needed.saturating_add((length as u64).saturating_sub(there));
    }
    let memory = std::fs::read_to_string("/proc/meminfo").ok().and_then(|text| available(&text));
    match [free(), memory].into_iter().flatten().min() {
        Some(free) if free < needed => Err(MemoryError::NoRoomForAll {
            instance: instance.to_owned(),
            count,
            needed_kib: needed.div_ceil(1024),
            free_kib: free / 1024,
        }),
        _ => Ok(()),
    }
}

/// Returns the number of bytes that the images may use, according to a text like `/proc/meminfo`. A tenth of the
/// available memory stays free for other programs.
#[cfg(feature = "emulator")]
fn available(meminfo: &str) -> Option<u64> {
    let kibibytes = |name: &str| -> Option<u64> {
        let line = meminfo.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim().strip_suffix("kB")?.trim().parse().ok()
    };
    let free = kibibytes("MemAvailable:")?.saturating_add(kibibytes("SwapFree:").unwrap_or(0));
    Some((free - free / 10).saturating_mul(1024))
}

#[cfg(all(test, feature = "emulator"))]
mod tests {
    use super::*;

    #[test]
    fn available_memory_is_read() {
        let text = "MemTotal:  9000 kB\nMemFree:  10 kB\nMemAvailable:   1000 kB\nSwapTotal: 7 kB\nSwapFree:  500 kB\n";
        assert_eq!(available(text), Some(1350 * 1024));
        assert_eq!(available("MemAvailable: 1000 kB"), Some(900 * 1024));
        assert_eq!(available("MemAvailable: many"), None);
        assert_eq!(available(""), None);
        assert!(available(&std::fs::read_to_string("/proc/meminfo").unwrap()).is_some());
    }

    #[test]
    fn more_than_the_available_memory_is_refused_with_the_numbers() {
        let plcs = ["a", "b", "c"];
        let lengths = |length: usize| plcs.iter().map(move |plc| (*plc, length));
        assert!(check("room", lengths(1)).is_ok());
        let error = check("room", lengths(usize::MAX / 4)).unwrap_err();
        assert!(matches!(error, MemoryError::NoRoomForAll { count: 3, .. }), "{error}");
        // A single image is not checked here, because its creation reports the error.
        assert!(check("room", [("a", usize::MAX)].into_iter()).is_ok());
    }
}
