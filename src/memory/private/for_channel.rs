//! What the channel needs of a private directory: its lock, and files that are replaced as a whole.

use super::PrivateDir;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;

/// Size limit for reading a file of such a directory: the files have one or two lines.
const MAX_TEXT: u64 = 4096;

impl PrivateDir {
    /// Returns the path by which the directory was opened.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Takes the directory's lock if it is free, for the lifetime of the result.
    pub(crate) fn try_lock(self: &Arc<Self>) -> Option<DirectoryLock> {
        let is_ours = self.directory.try_lock().is_ok_and(|is_ours| is_ours);
        is_ours.then(|| DirectoryLock(Arc::clone(self)))
    }

    /// Returns the text of the file `name`; `None` if there is no such file.
    pub(crate) fn read(&self, name: &str) -> Option<String> {
        let mut text = String::new();
        self.find_file(name).ok()??.take(MAX_TEXT).read_to_string(&mut text).ok()?;
        Some(text)
    }

    /// Replaces the file `name` as a whole: a reader sees the old text or the new one. Only one process may call this
    /// at a time.
    pub(crate) fn publish(&self, name: &str, text: &str) -> io::Result<()> {
        let new = format!("{name}.new");
        self.remove(&new);
        self.remove_unless_file(name);
        self.directory.with_new(&new, text.as_bytes(), |_| Ok(self.directory.rename(&new, name)?))
    }
}

/// Lock of a directory; dropping the value releases the lock.
#[derive(Debug)]
pub(crate) struct DirectoryLock(Arc<PrivateDir>);

impl Drop for DirectoryLock {
    fn drop(&mut self) {
        let _ = self.0.directory.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::private::tests::place;
    use rustix::fs::{FileType, Mode};
    use std::os::unix::fs::{MetadataExt, symlink};

    #[test]
    fn publishing_replaces_a_link_and_does_not_follow_it() {
        let (parent, path) = place();
        let victim = parent.path().join("victim");
        std::fs::write(&victim, "precious").unwrap();
        let directory = PrivateDir::create(&path).unwrap();
        for name in ["ready", "ready.new"] {
            symlink(&victim, path.join(name)).unwrap();
            assert_eq!(directory.read(name), None, "{name}");
            directory.publish("ready", "42\n").unwrap();
            assert_eq!(directory.read("ready").unwrap(), "42\n");
            assert_eq!(std::fs::read_to_string(&victim).unwrap(), "precious");
        }
        assert_eq!(std::fs::read_dir(&path).unwrap().count(), 1);
        assert_eq!(std::fs::metadata(path.join("ready")).unwrap().mode() & 0o7777, 0o600);
    }

    #[test]
    fn a_pipe_is_not_waited_for() {
        let (_parent, path) = place();
        let directory = PrivateDir::create(&path).unwrap();
        let mode = Mode::RUSR | Mode::WUSR;
        rustix::fs::mknodat(rustix::fs::CWD, path.join("ready"), FileType::Fifo, mode, 0).unwrap();
        assert!(directory.read("ready").is_none_or(|text| text.is_empty()));
    }

    #[test]
    fn one_at_a_time_holds_it() {
        let (_parent, path) = place();
        let [one, two] = [(); 2].map(|()| Arc::new(PrivateDir::create(&path).unwrap()));
        let held = one.try_lock().unwrap();
        assert!(two.try_lock().is_none());
        drop(held);
        assert!(two.try_lock().is_some());
    }
}
