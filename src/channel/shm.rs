//! POSIX shared memory of iceoryx2. It is outside the instance's directory, and its names are visible to all users.

use crate::memory::directory::Directory;
#[cfg(feature = "web")]
use crate::memory::process::read_kernel_file;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Directory of POSIX shared memory on Linux.
pub(super) const SHM: &str = "/dev/shm";
/// Longest time that a shared memory object may be without content. A living process needs far less, even on a busy
/// processor.
const HALF_MADE: Duration = Duration::from_millis(500);
/// Maximum length of an object with access for all users: iceoryx2's counter of nodes has 16 bytes.
const MAX_PUBLIC: u64 = 4096;

/// Returns the shared memory objects of this user with names that begin with `prefix`. Another user can see
/// the prefix and create objects with it. No process of this user opens such objects, so they are left out.
pub(super) fn objects(prefix: &str) -> impl Iterator<Item = PathBuf> {
    let own = rustix::process::geteuid().as_raw();
    let entries = std::fs::read_dir(SHM).into_iter().flatten().flatten();
    entries
        .filter(move |entry| entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()))
        // `metadata` reads the owner of the directory entry. If the entry is a link, this is not the owner of
        // its target.
        .filter(move |entry| entry.metadata().is_ok_and(|data| data.uid() == own))
        .map(|entry| entry.path())
}

/// Returns the objects with their lengths in bytes.
pub(super) fn lengths(prefix: &str) -> Vec<(PathBuf, u64)> {
    objects(prefix).filter_map(|path| length(&path).map(|length| (path, length))).collect()
}

/// Returns the length of an object in bytes; `None` if there is none.
pub(super) fn length(path: &Path) -> Option<u64> {
    Some(path.symlink_metadata().ok()?.len())
}

/// True if this process has mapped more of an object with this prefix than the object still has: another program has
/// shortened it.
#[cfg(feature = "web")]
pub(super) fn is_shortened(prefix: &str) -> bool {
    let maps = read_kernel_file("/proc/self/maps").unwrap_or_default();
    maps.lines().any(|line| is_longer_than_file(line, prefix).unwrap_or(false))
}

/// True if the map of a line in `/proc/self/maps` is longer than its object; `None` if the line is not about
/// an object with the prefix, or if the object was removed.
#[cfg(feature = "web")]
fn is_longer_than_file(line: &str, prefix: &str) -> Option<bool> {
    let path = Path::new(line.get(line.find('/')?..)?);
    let name = path.strip_prefix(SHM).ok()?.to_str()?;
    if !name.starts_with(prefix) {
        return None;
    }
    let mut fields = line.split_ascii_whitespace();
    let (first, end) = fields.next()?.split_once('-')?;
    let hexadecimal = |digits| u64::from_str_radix(digits, 16).ok();
    let mapped = hexadecimal(fields.nth(1)?)? + (hexadecimal(end)? - hexadecimal(first)?);
    // The last page of a map may extend beyond the end of the object.
    let length = length(path)?.next_multiple_of(crate::memory::page_size().max(1) as u64);
    Some(mapped > length)
}

/// Removes all these objects.
pub(super) fn remove(prefix: &str) {
    for path in objects(prefix) {
        let _ = std::fs::remove_file(path);
    }
}

/// Objects that stay without content. Such an object remains if a process is killed after it has created the object and
/// before it has set the size. iceoryx2 0.10.0 waits for the size without a limit, even if it is called with a timeout
/// (`dynamic_storage/posix_shared_memory.rs`, `MappingSizeIsZero`). A living process sets the size within microseconds.
pub(super) fn half_made(prefix: &str) -> Vec<PathBuf> {
    let empty = || {
        let empty = objects(prefix).filter(|path| path.symlink_metadata().is_ok_and(|data| data.len() == 0));
        empty.collect::<Vec<_>>()
    };
    let mut stale = empty();
    settles(HALF_MADE, || {
        if !stale.is_empty() {
            let now = empty();
            stale.retain(|path| now.contains(path));
        }
        stale.is_empty()
    });
    stale
}

/// True if a visible process has the file open or mapped, or if the processes cannot be listed.
pub(super) fn is_in_use(path: &Path) -> bool {
    let Ok(processes) = std::fs::read_dir("/proc") else { return true };
    let is_process = |name: &std::ffi::OsStr| name.as_encoded_bytes().iter().all(u8::is_ascii_digit);
    processes.flatten().filter(|entry| is_process(&entry.file_name())).any(|entry| {
        let opened = std::fs::read_dir(entry.path().join("fd")).into_iter().flatten().flatten();
        let mut opened = opened.filter_map(|file| std::fs::read_link(file.path()).ok());
        let mapped = || std::fs::read_to_string(entry.path().join("maps")).unwrap_or_default();
        let is_mapped =
            |line: &str| line.split_once('/').is_some_and(|(_, rest)| path == Path::new("/").join(rest));
        opened.any(|file| file == path) || mapped().lines().any(is_mapped)
    })
}

/// Replaces each object that other users can open by a private copy. Returns true if there was such an
/// object. When this function is called, no process of this user may use the objects yet. A process of
/// another user that has opened one still has the old file, which is no longer used.
pub(super) fn make_private(prefix: &str) -> io::Result<bool> {
    let shm = Directory::open(Path::new(SHM))?;
    let mut any = false;
    for path in objects(prefix) {
        let name = path.file_name().and_then(|name| name.to_str());
        if let Some(name) = name.filter(|name| shm.stat_of(name).is_ok_and(|it| it.st_mode & 0o077 != 0)) {
            replace(&shm, name, prefix)?;
            any = true;
        }
    }
    Ok(any)
}

fn replace(shm: &Directory, name: &str, prefix: &str) -> io::Result<()> {
    let mut content = Vec::new();
    shm.read(name)?.take(MAX_PUBLIC).read_to_end(&mut content)?;
    // The name has the prefix, so that a sweep removes the copy if this process dies here. The rest of the name is
    // random, so that no other user can create an object with this name first.
    let new = format!("{prefix}{}", random()?);
    shm.with_new(&new, &content, |_| Ok(shm.rename(&new, name)?))
}

/// Returns eight random hexadecimal digits.
pub(super) fn random() -> io::Result<String> {
    let mut random = [0; 4];
    File::open("/dev/urandom")?.read_exact(&mut random)?;
    Ok(format!("{:08x}", u32::from_ne_bytes(random)))
}

/// Waits until `is_so` is true, for at most `patience`. Returns false if the time is over.
pub(super) fn settles(patience: Duration, mut is_so: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    loop {
        if is_so() {
            return true;
        }
        if start.elapsed() >= patience {
            return false;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    /// A prefix of this test; its objects are removed at the end.
    struct Prefix(String);

    impl Prefix {
        fn new(test: &str) -> Self {
            Self(format!("commram_test_{}_{test}_", std::process::id()))
        }

        fn object(&self, name: &str, content: &str) -> PathBuf {
            let path = Path::new(SHM).join(format!("{}{name}", self.0));
            std::fs::write(&path, content).unwrap();
            path
        }
    }

    impl Drop for Prefix {
        fn drop(&mut self) {
            remove(&self.0);
        }
    }

    #[test]
    fn incomplete_objects_are_distinguished_from_complete_ones() {
        let prefix = Prefix::new("half");
        let half = prefix.object("half", "");
        prefix.object("done", "x");
        assert_eq!(half_made(&prefix.0), [half]);
        remove(&prefix.0);
        assert_eq!(objects(&prefix.0).count(), 0);
        assert!(half_made(&prefix.0).is_empty());
    }

    #[test]
    fn an_open_or_mapped_object_is_in_use() {
        let prefix = Prefix::new("used");
        let path = prefix.object("one", "x");
        assert!(!is_in_use(&path));
        let file = File::open(&path).unwrap();
        assert!(is_in_use(&path));
        // SAFETY: no other code knows the file, and the contents of the map are not read.
        let map = unsafe { memmap2::Mmap::map(&file) }.unwrap();
        drop(file);
        assert!(is_in_use(&path));
        drop(map);
        assert!(!is_in_use(&path));
    }

    /// Only root can create objects of another user; other users cannot run this test.
    #[test]
    fn objects_of_other_users_are_ignored() {
        let prefix = Prefix::new("foreign");
        let (empty, link) = (prefix.object("empty", ""), Path::new(SHM).join(format!("{}link", prefix.0)));
        std::os::unix::fs::symlink(&empty, &link).unwrap();
        if !rustix::process::geteuid().is_root() {
            eprintln!("SKIPPED: only root can be another user");
            return;
        }
        std::fs::set_permissions(&empty, PermissionsExt::from_mode(0o666)).unwrap();
        for path in [&empty, &link] {
            std::os::unix::fs::lchown(path, Some(65_534), None).unwrap();
        }
        let found = (objects(&prefix.0).count(), half_made(&prefix.0), make_private(&prefix.0).unwrap());
        for path in [&empty, &link] {
            std::fs::remove_file(path).unwrap();
        }
        assert_eq!(found, (0, vec![], false));
    }

    /// A process that has opened the public file before cannot affect the new one.
    #[test]
    fn a_public_object_is_replaced_by_a_private_copy() {
        let prefix = Prefix::new("public");
        let path = prefix.object("counter", "0123456789abcdef");
        std::fs::set_permissions(&path, PermissionsExt::from_mode(0o666)).unwrap();
        let attacker = File::options().write(true).open(&path).unwrap();
        assert!(make_private(&prefix.0).unwrap());
        attacker.set_len(0).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "0123456789abcdef");
        assert_eq!(std::fs::metadata(&path).unwrap().mode() & 0o7777, 0o600);
        assert_eq!(objects(&prefix.0).count(), 1);
        assert!(!make_private(&prefix.0).unwrap());
    }
}
