//! Output files for users: exports, reports, pictures, snapshots. The previous file of the same name stays until all of
//! the new content is written, so no reader finds half a file, and a full disk does not destroy the old one.

use std::fs::{self, File, Metadata};
use std::io::{ErrorKind, Result, Write};
use std::path::{Path, PathBuf};

/// Number of names that are tried: killed processes may have left files with the names that this process would use.
const TRIES: u32 = 16;
/// Links that lead on to links.
const MOST_LINKS: u32 = 40;

/// Writes where a shell's `>` would, with the name `-` to the standard output: links are followed, pipes and devices are written to. A file keeps its permissions.
///
/// # Errors
/// The file cannot be written; then its contents are unchanged, except where only the file itself may be changed and no
/// new file be made beside it.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    if path.as_os_str() == "-" {
        let mut out = std::io::stdout().lock();
        return out.write_all(bytes).and_then(|()| out.flush());
    }
    let before = fs::metadata(path);
    let is_file = before.as_ref().map_or(true, Metadata::is_file);
    let Some(place) = end_of_links(path).filter(|_| is_file) else {
        return fs::write(path, bytes);
    };
    replace_as(&place, bytes, before.ok().as_ref()).or_else(|reason| match reason.kind() {
        // A directory of another user; a mounted file.
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem | ErrorKind::ResourceBusy => {
            fs::write(path, bytes)
        }
        _ => Err(reason),
    })
}

/// Replaces the file of this name with a new file, without following links.
///
/// # Errors
/// The file cannot be written; then its contents are unchanged.
#[cfg(feature = "studio")]
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    replace_as(path, bytes, None)
}

/// Replaces the file, with the permissions of an existing file.
fn replace_as(path: &Path, bytes: &[u8], like: Option<&Metadata>) -> Result<()> {
    let (mut file, begun) = begin(path)?;
    let permitted = like.map_or(Ok(()), |like| file.set_permissions(like.permissions()));
    let written = permitted.and_then(|()| file.write_all(bytes)).and_then(|()| fs::rename(&begun, path));
    written.inspect_err(|_| {
        // An incomplete file is of no use.
        let _ = fs::remove_file(&begun);
    })
}

/// Creates a new file beside this one.
fn begin(path: &Path) -> Result<(File, PathBuf)> {
    let mut tried = 0;
    loop {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}-{tried}.part", std::process::id()));
        let begun = path.with_file_name(name);
        match File::create_new(&begun) {
            // In a container every process may have the same process id.
            Err(reason) if reason.kind() == ErrorKind::AlreadyExists && tried < TRIES => tried += 1,
            made => return Ok((made?, begun)),
        }
    }
}

/// Returns the real path of a file of this name, existing or not; none if the name is an open file of a process, such
/// as `/dev/stdout`, which other processes have open as well.
fn end_of_links(path: &Path) -> Option<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        let name = path.file_name()?.to_owned();
        let directory = path.parent().filter(|it| !it.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let directory = directory.canonicalize().ok()?;
        if directory.starts_with("/proc") {
            return None;
        }
        let place = directory.join(name);
        match fs::read_link(&place) {
            Ok(target) => path = directory.join(target),
            Err(_) => return Some(place),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, symlink};

    fn names(directory: &Path) -> Vec<String> {
        let mut names: Vec<_> = directory
            .read_dir()
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_with_its_permissions_and_nothing_stays_beside_it() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.h");
        write(&path, b"old").unwrap();
        fs::set_permissions(&path, PermissionsExt::from_mode(0o640)).unwrap();
        let mut reader = File::open(&path).unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
        // A reader of the old file meanwhile reads all of it.
        let mut seen = String::new();
        std::io::Read::read_to_string(&mut reader, &mut seen).unwrap();
        assert_eq!(seen, "old");
        assert_eq!(names(directory.path()), ["a.h"]);
    }

    #[test]
    fn links_are_followed_to_their_end() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name| directory.path().join(name);
        symlink("b", at("a")).unwrap();
        symlink(at("c"), at("b")).unwrap();
        for text in ["made", "changed"] {
            write(&at("a"), text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(at("c")).unwrap(), text);
            assert!(at("a").is_symlink() && at("b").is_symlink());
        }
        symlink("loop", at("loop")).unwrap();
        assert!(write(&at("loop"), b"").is_err());
        assert_eq!(names(directory.path()), ["a", "b", "c", "loop"]);
    }

    #[test]
    fn an_open_file_is_written_and_not_replaced() {
        use std::os::fd::AsRawFd;
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out");
        let mut reader = File::create_new(&path).and_then(|_| File::open(&path)).unwrap();
        let writer = File::options().write(true).open(&path).unwrap();
        write(Path::new(&format!("/proc/self/fd/{}", writer.as_raw_fd())), b"said").unwrap();
        let mut seen = String::new();
        std::io::Read::read_to_string(&mut reader, &mut seen).unwrap();
        assert_eq!(seen, "said");
    }

    #[test]
    fn leftover_files_of_the_same_name_do_not_block_the_write() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.h");
        let left = directory.path().join(format!("a.h.{}-0.part", std::process::id()));
        fs::write(&left, "left").unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(fs::read(&left).unwrap(), b"left");
        assert_eq!(names(directory.path()).len(), 2);
        assert!(write(&directory.path().join("missing/a.h"), b"").is_err());
        assert!(write(directory.path(), b"").is_err());
    }
}
