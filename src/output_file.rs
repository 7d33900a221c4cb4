//! Output files for users: exports, reports, pictures, snapshots. The new content is first written to a file beside the
//! previous file, which it then replaces. So a reader never finds an incomplete file, and a full disk does not destroy
//! the previous file. If a process is killed before the replacement, the new file remains under its temporary name; the
//! next write of the same output file removes it.
//!
//! A link of another user is not followed at the place of an output file: it could lead to any file of this user. The
//! kernel refuses a link of another user only in sticky directories.

use std::ffi::OsStr;
use std::fs::{self, File, Metadata, TryLockError};
use std::io::{ErrorKind, Result, Write};
use std::os::fd::{IntoRawFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Component, Path, PathBuf};

/// Maximum number of temporary names to try. Files of killed processes may have the same names.
const TRIES: u32 = 16;
/// Maximum number of bytes of an output file's name in the temporary name. A name has at most 255 bytes, and
/// `.PROCESS-TRIED.part` needs up to 27 of them.
const LONGEST_STEM: usize = 228;
/// Maximum number of symbolic links in a chain.
const MOST_LINKS: u32 = 40;

/// The reason why nothing is written: another user has created the entry of this path. It is the reason of an
/// [`std::io::Error`].
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{kind} {} belongs to user {owner}, and may lead to files that others own or change; choose another place, or \
     remove it and create your own", .path.display()
)]
pub(crate) struct ForeignEntry {
    /// "the link" or "the directory".
    kind: &'static str,
    path: PathBuf,
    owner: u32,
}

impl ForeignEntry {
    /// Returns the error if the entry belongs neither to this user nor to root.
    fn check(kind: &'static str, path: &Path, found: &Metadata) -> Result<()> {
        let owner = found.uid();
        if owner == 0 || owner == rustix::process::geteuid().as_raw() {
            return Ok(());
        }
        Err(std::io::Error::other(Self { kind, path: path.to_owned(), owner }))
    }
}

/// Writes like a shell's `>`: follows links of this user and of root, and writes to pipes and devices. A file keeps its
/// permissions.
///
/// # Errors
/// [`ForeignEntry`], or the file cannot be written. After an error, its contents are unchanged, unless the file had to
/// be overwritten because no new file can be created beside it.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    Prepared::new(path, bytes)?.finish()
}

/// Writes several files that belong together, each like [`write()`]. All new files are complete before the first
/// existing file is replaced, so a full disk changes none of the existing files.
///
/// # Errors
/// The error names the file that cannot be written.
pub(crate) fn write_together<'a>(
    files: impl IntoIterator<Item = (&'a Path, &'a str)>,
) -> std::result::Result<(), (PathBuf, std::io::Error)> {
    let named = |path: &Path| {
        let path = path.to_owned();
        move |reason| (path, reason)
    };
    let prepare =
        |(path, text): (&'a Path, &'a str)| Prepared::new(path, text.as_bytes()).map_err(named(path));
    let prepared = files.into_iter().map(prepare).collect::<std::result::Result<Vec<_>, _>>()?;
    prepared.into_iter().try_for_each(|file| {
        let path = file.path;
        file.finish().map_err(named(path))
    })
}

/// Writes a file that does not exist yet, without following links.
///
/// # Errors
/// [`ErrorKind::AlreadyExists`], or another error if the file cannot be written. The file then does not exist.
pub(crate) fn write_new(path: &Path, bytes: &[u8]) -> Result<()> {
    if path.symlink_metadata().is_ok() {
        return Err(ErrorKind::AlreadyExists.into());
    }
    let begun = begin(path, bytes, None)?;
    // `rename` would replace a file that another process has created in the meantime, so a hard link is used first.
    match fs::hard_link(&begun.0, path) {
        // A file system without hard links: `rename` replaces an empty file that no other process has created.
        Err(reason) if reason.kind() != ErrorKind::AlreadyExists => {
            File::create_new(path)?;
            fs::rename(&begun.0, path).inspect_err(|_| {
                let _ = fs::remove_file(path);
            })
        }
        linked => linked,
    }
}

/// A file and its new content.
struct Prepared<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    /// The new file and the file that it will replace; `None` if the existing file must be overwritten.
    begun: Option<(Unfinished, PathBuf)>,
}

impl<'a> Prepared<'a> {
    fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let before = fs::metadata(path);
        let is_file = before.as_ref().map_or(true, Metadata::is_file);
        let begun = match end_of_links(path)?.filter(|_| is_file) {
            None if is_file => {
                // No new file can be created here, so the existing file will be overwritten. This checks that it exists
                // and can be written.
                fs::OpenOptions::new().write(true).open(path)?;
                None
            }
            None => None,
            Some(place) => match begin(&place, bytes, before.ok().as_ref()) {
                Ok(begun) => Some((begun, place)),
                Err(reason) if is_only_in_place(&reason) => None,
                Err(reason) => return Err(reason),
            },
        };
        Ok(Self { path, bytes, begun })
    }

    fn finish(self) -> Result<()> {
        let Some((begun, place)) = self.begun else { return overwrite(self.path, self.bytes) };
        match fs::rename(&begun.0, place) {
            Err(reason) if is_only_in_place(&reason) => overwrite(self.path, self.bytes),
            renamed => renamed,
        }
    }
}

fn overwrite(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    close(file.into())
}

/// Closes a file that was written. File systems such as NFS store the content of a file only then, even if it has another
/// descriptor.
///
/// # Errors
/// The content could not be stored, for example because the server's disk is full.
pub(crate) fn close(file: OwnedFd) -> Result<()> {
    // SAFETY: the descriptor is owned, and nothing uses it any more.
    match unsafe { libc::close(file.into_raw_fd()) } {
        0 => Ok(()),
        _ => Err(std::io::Error::last_os_error()),
    }
}

/// True for errors which mean that a file can only be overwritten: no new file can be created beside it or replace it,
/// for example in a directory of another user, or if the file is mounted.
fn is_only_in_place(reason: &std::io::Error) -> bool {
    matches!(
        reason.kind(),
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem | ErrorKind::ResourceBusy
    )
}

/// Replaces the file of this name with a new file, without following links.
///
/// # Errors
/// The file cannot be written. Its contents are then unchanged.
#[cfg(feature = "studio")]
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    fs::rename(&begin(path, bytes, None)?.0, path)
}

/// The temporary name of a new file. If the file was not renamed, it is removed when this value is dropped. The open
/// file holds a lock, which distinguishes it from files of killed processes.
struct Unfinished(PathBuf, #[expect(dead_code, reason = "holds the lock")] File);

impl Drop for Unfinished {
    fn drop(&mut self) {
        // An error is ignored, because nothing else can be done about the incomplete file.
        let _ = fs::remove_file(&self.0);
    }
}

/// Writes a new file beside `path`, with the permissions of an existing file of the same user.
fn begin(path: &Path, bytes: &[u8], like: Option<&Metadata>) -> Result<Unfinished> {
    remove_leftovers(path);
    let (mut file, begun) = create_beside(path)?;
    let unfinished = Unfinished(begun, file.try_clone()?);
    // The permissions of another user's file are not copied, because they may permit access to all users.
    let own = like.filter(|like| like.uid() == rustix::process::geteuid().as_raw());
    own.map_or(Ok(()), |like| file.set_permissions(like.permissions()))?;
    file.write_all(bytes)?;
    close(file.into())?;
    Ok(unfinished)
}

/// Removes temporary files of processes that were killed while they wrote `path`. Errors are ignored, because such
/// files do not prevent writing.
fn remove_leftovers(path: &Path) {
    let Some(directory) = path.parent() else { return };
    let directory = if directory.as_os_str().is_empty() { Path::new(".") } else { directory };
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        if part_of(path, &entry.file_name()).is_some_and(|process| !is_other_living(process)) {
            let _ = remove_if_left(&entry.path());
        }
    }
}

/// True if this is the number of a living process other than this one. The file may belong to that process, even if the
/// process has not locked it.
fn is_other_living(process: u32) -> bool {
    process != std::process::id() && Path::new(&format!("/proc/{process}")).exists()
}

/// Returns the beginning of the names of temporary files beside `path`: its name, cut so that the names are valid.
fn stem(path: &Path) -> &OsStr {
    let name = path.file_name().unwrap_or_default().as_bytes();
    OsStr::from_bytes(name.get(..LONGEST_STEM).unwrap_or(name))
}

/// Returns the number of the process that gives this name to a new file beside `path` ([`create_beside`]).
fn part_of(path: &Path, name: &OsStr) -> Option<u32> {
    let rest = name.as_encoded_bytes().strip_prefix(stem(path).as_encoded_bytes())?.strip_prefix(b".")?;
    let (process, tried) = core::str::from_utf8(rest.strip_suffix(b".part")?).ok()?.split_once('-')?;
    tried.parse::<u32>().ok()?;
    process.parse().ok()
}

/// Removes a temporary file if no process is writing it. A process that writes it holds a lock.
fn remove_if_left(path: &Path) -> Result<()> {
    use rustix::fs::OFlags;
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let flags = i32::try_from(flags.bits()).unwrap_or_default();
    let file = File::options().read(true).custom_flags(flags).open(path)?;
    if !file.metadata()?.is_file() {
        return Ok(());
    }
    file.try_lock()?;
    fs::remove_file(path)
}

/// Creates a new file beside `path`, and returns its name.
fn create_beside(path: &Path) -> Result<(File, PathBuf)> {
    let mut tried = 0;
    loop {
        let mut name = stem(path).to_owned();
        name.push(format!(".{}-{tried}.part", std::process::id()));
        let begun = path.with_file_name(name);
        match File::create_new(&begun) {
            // Processes in different containers can have the same process id, and so the same name for the file.
            Err(reason) if reason.kind() == ErrorKind::AlreadyExists && tried < TRIES => {}
            // Another process may have removed the file as a leftover before it was locked.
            Ok(file) if !is_kept(&file) && tried < TRIES => {}
            made => return Ok((made?, begun)),
        }
        tried += 1;
    }
}

/// Locks a new file, and returns true if the file still has its name. On a file system without locks this is always so,
/// because no process removes leftover files in such a directory.
fn is_kept(file: &File) -> bool {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => false,
        Err(TryLockError::Error(_)) => true,
        Ok(()) => file.metadata().is_ok_and(|data| data.nlink() > 0),
    }
}

/// True if [`write()`] to one of the names would replace the file that the other name means. This is false for pipes
/// and devices, which accept both outputs.
#[cfg(feature = "cli")]
pub(crate) fn is_same(one: &Path, other: &Path) -> bool {
    let is_file = |path| fs::metadata(path).map_or(true, |it| it.is_file());
    is_file(one)
        && is_file(other)
        && match (end_of_links(one), end_of_links(other)) {
            (Ok(Some(one)), Ok(Some(other))) => one == other,
            _ => one == other,
        }
}

/// Returns the path of the file to which the links lead; the file need not exist. `None` if the name means an open file
/// of a process, such as `/dev/stdout`, because other processes may have it open too.
///
/// # Errors
/// [`ForeignEntry`]: one of the links belongs to another user.
fn end_of_links(path: &Path) -> Result<Option<PathBuf>> {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Some(name) = path.file_name().map(OsStr::to_owned) else { return Ok(None) };
        let directory = path.parent().filter(|it| !it.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let Ok(directory) = directory.canonicalize() else { return Ok(None) };
        if directory.starts_with("/proc") {
            return Ok(None);
        }
        let place = directory.join(name);
        let Ok(target) = fs::read_link(&place) else { return Ok(Some(place)) };
        ForeignEntry::check("the link", &place, &place.symlink_metadata()?)?;
        path = directory.join(target);
    }
    Ok(None)
}

/// Opens a file to append to it, with the creation mode `mode`. Follows the same links as [`write()`].
///
/// # Errors
/// [`ForeignEntry`], or the file cannot be opened.
pub(crate) fn open_to_append(path: &Path, mode: u32) -> Result<File> {
    end_of_links(path)?;
    File::options().create(true).append(true).mode(mode).open(path)
}

/// Creates a directory of an output file, with its missing parents. A directory of another user is accepted: a group may
/// share it.
///
/// # Errors
/// [`ForeignEntry`]: the directory is a link of another user. Or a directory cannot be created.
pub(crate) fn create_directories(directory: &Path) -> Result<()> {
    check_links(directory)?;
    fs::create_dir_all(directory)
}

/// Creates the directory of a set of files that a command names itself, with its missing parents.
///
/// # Errors
/// Returns the errors of [`create_directories()`] and [`check_own_place()`].
pub(crate) fn create_own_place(directory: &Path) -> Result<()> {
    check_own_place(directory)?;
    create_directories(directory)
}

/// Refuses an existing directory that another user has created where a command would create its own one. If the user of
/// the directory also owns its parent, the place belongs to this user, for example a project that is mounted into a
/// container. The same is true for `.` and `..`, which no command creates.
///
/// # Errors
/// [`ForeignEntry`]
pub(crate) fn check_own_place(directory: &Path) -> Result<()> {
    check_links(directory)?;
    if !matches!(directory.components().next_back(), Some(Component::Normal(_))) {
        return Ok(());
    }
    let parent = directory.parent().filter(|it| !it.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (fs::metadata(directory), fs::metadata(parent)) {
        (Ok(found), Ok(parent)) if found.uid() != parent.uid() => {
            ForeignEntry::check("the directory", directory, &found)
        }
        _ => Ok(()),
    }
}

/// Refuses a link of another user in place of the directory, or of its nearest existing parent.
fn check_links(directory: &Path) -> Result<()> {
    let mut entries = directory.ancestors().filter_map(|path| Some((path, path.symlink_metadata().ok()?)));
    if let Some((nearest, found)) = entries.next()
        && found.is_symlink()
    {
        ForeignEntry::check("the link", nearest, &found)?;
        // The link may lead to another link.
        end_of_links(nearest)?;
    }
    Ok(())
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
        // While the file is replaced, a reader of the old file reads all of its old content.
        let mut seen = String::new();
        std::io::Read::read_to_string(&mut reader, &mut seen).unwrap();
        assert_eq!(seen, "old");
        assert_eq!(names(directory.path()), ["a.h"]);
    }

    /// Only root can give a file to another user. So the test does nothing if it is not run by root.
    #[test]
    fn the_permissions_of_another_users_file_are_not_kept() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.snap");
        fs::write(&path, b"trap").unwrap();
        fs::set_permissions(&path, PermissionsExt::from_mode(0o666)).unwrap();
        if !rustix::process::geteuid().is_root() {
            return;
        }
        std::os::unix::fs::chown(&path, Some(65_534), Some(65_534)).unwrap();
        let usual = directory.path().join("usual");
        write(&usual, b"new").unwrap();
        write(&path, b"new").unwrap();
        let mode = |path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&usual));
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

    /// Only root can give a link to another user. So the test does nothing if it is not run by root.
    #[test]
    fn links_and_directories_of_another_user_are_refused() {
        const OTHER: u32 = 65_534;
        if !rustix::process::geteuid().is_root() {
            return;
        }
        let directory = tempfile::tempdir().unwrap();
        let at = |name: &str| directory.path().join(name);
        let give = |name: &str| std::os::unix::fs::lchown(at(name), Some(OTHER), Some(OTHER)).unwrap();
        let owner = |error: std::io::Error| error.downcast::<ForeignEntry>().unwrap().owner;
        fs::create_dir(at("mine")).unwrap();
        fs::write(at("mine/file"), "precious").unwrap();
        for (link, target) in
            [("file", "mine/file"), ("first", "file"), ("new", "mine/new"), ("folder", "mine")]
        {
            symlink(target, at(link)).unwrap();
            if link != "first" {
                give(link);
            }
        }
        for link in ["file", "first", "new"] {
            assert_eq!(owner(write(&at(link), b"").unwrap_err()), OTHER, "{link}");
            let (path, error) = write_together([(at(link).as_path(), "")]).unwrap_err();
            assert_eq!((path, owner(error)), (at(link), OTHER), "{link}");
            assert_eq!(owner(open_to_append(&at(link), 0o600).unwrap_err()), OTHER, "{link}");
        }
        for directory in ["folder", "folder/missing"] {
            assert_eq!(owner(create_directories(&at(directory)).unwrap_err()), OTHER, "{directory}");
        }
        fs::create_dir(at("theirs")).unwrap();
        give("theirs");
        assert_eq!(owner(create_own_place(&at("theirs")).unwrap_err()), OTHER);
        create_directories(&at("theirs")).unwrap();
        // A user that owns the parent too can do everything anyway.
        fs::create_dir(at("theirs/inner")).unwrap();
        give("theirs/inner");
        create_own_place(&at("theirs/inner")).unwrap();
        create_own_place(&at("mine/deep/er")).unwrap();
        assert_eq!(names(&at("mine")), ["deep", "file"]);
        assert_eq!(fs::read(at("mine/file")).unwrap(), b"precious");
        assert_eq!(names(&at("theirs")), ["inner"]);
    }

    #[test]
    fn of_files_that_belong_together_none_is_changed_if_one_cannot_be_written() {
        let directory = tempfile::tempdir().unwrap();
        let (a, b) = (directory.path().join("a"), directory.path().join("b"));
        write_together([(a.as_path(), "old"), (b.as_path(), "old")]).unwrap();
        let missing = directory.path().join("missing/c");
        let (path, _) = write_together([(a.as_path(), "new"), (missing.as_path(), "new")]).unwrap_err();
        assert_eq!((path, fs::read_to_string(&a).unwrap()), (missing, "old".to_owned()));
        assert_eq!(names(directory.path()), ["a", "b"]);
    }

    #[test]
    fn a_new_file_replaces_no_file_and_no_link() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name| directory.path().join(name);
        write_new(&at("a"), b"new").unwrap();
        symlink("missing", at("b")).unwrap();
        for name in ["a", "b"] {
            assert_eq!(write_new(&at(name), b"other").unwrap_err().kind(), ErrorKind::AlreadyExists);
        }
        assert_eq!(fs::read(at("a")).unwrap(), b"new");
        assert_eq!(names(directory.path()), ["a", "b"]);
        assert!(write_new(&at("missing/a"), b"").is_err());
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
    fn a_file_may_have_the_longest_name() {
        let directory = tempfile::tempdir().unwrap();
        let name = "a".repeat(255);
        let left = format!("{}.4194305-3.part", "a".repeat(LONGEST_STEM));
        fs::write(directory.path().join(left), "left").unwrap();
        for text in ["new", "newer"] {
            write(&directory.path().join(&name), text.as_bytes()).unwrap();
        }
        assert_eq!(names(directory.path()), [name]);
    }

    #[test]
    fn files_of_killed_processes_are_removed_and_no_others() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.h");
        let own = format!("a.h.{}-0.part", std::process::id());
        // No process has this number: it is higher than the kernel's maximum.
        let (left, link) = ("a.h.4194305-3.part", "a.h.4194306-0.part");
        // Names of files: the first file is being written, a killed process has left the second one, and the third one
        // may belong to a living process. The other names are similar, but not those of temporary files.
        let all = [&own, left, "a.h.1-0.part", "a.h.4711.part", "a.h.x-0.part", "b.h.4711-0.part"];
        for name in all {
            fs::write(directory.path().join(name), "left").unwrap();
        }
        symlink("b.h.4711-0.part", directory.path().join(link)).unwrap();
        let written = File::open(directory.path().join(&own)).unwrap();
        written.lock().unwrap();
        write(&path, b"new").unwrap();
        let mut kept =
            vec!["a.h", "a.h.1-0.part", "a.h.4711.part", link, "a.h.x-0.part", "b.h.4711-0.part", &own];
        kept.sort_unstable();
        assert_eq!(names(directory.path()), kept);
        drop(written);
        write(&path, b"newer").unwrap();
        assert!(!names(directory.path()).contains(&own));
        assert_eq!(fs::read(&path).unwrap(), b"newer");
        assert!(write(&directory.path().join("missing/a.h"), b"").is_err());
        assert!(write(directory.path(), b"").is_err());
    }
}
