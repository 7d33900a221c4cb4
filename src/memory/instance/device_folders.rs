//! The list of the folders of a running instance's devices. Clients read it for the names of the registers.

use super::InstanceLock;
use crate::memory::private::PrivateDir;
use crate::memory::{MemoryError, names};
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// The file in the instance's directory with the folders of the plant's devices, one path in each line.
const FOLDERS: &str = "devices";
/// Begin of a line of the list with the folder of a device that has a script, which the line of the folder does not show.
const SCRIPT: &str = "script\t";
/// Longest list of folders that is read, in bytes.
const LONGEST_FOLDERS: u64 = 1 << 20;

/// The folder of a device, as the instance has read it. A file of the folder may have changed since then.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DeviceFolder {
    pub(crate) path: PathBuf,
    /// True if the device has a script.
    pub(crate) has_script: bool,
}

impl InstanceLock {
    /// Publishes the folders of the plant's devices, and a line for each controller with option cards, so that clients can
    /// read the names of their registers. A folder is a path, and true if the device has a script. Paths are absolute, and
    /// text without line ends. Call it before the images exist:
    /// clients read the list when they attach.
    ///
    /// # Errors
    /// The operating system refuses the operation.
    pub(crate) fn publish_device_folders<'p>(
        &self,
        folders: impl IntoIterator<Item = (&'p Path, bool)>,
        controllers: impl IntoIterator<Item = String>,
    ) -> Result<(), MemoryError> {
        let folder = |(path, has_script): (&Path, bool)| {
            let path = path.display();
            if has_script { format!("{path}\n{SCRIPT}{path}\n") } else { format!("{path}\n") }
        };
        let folders = folders.into_iter().map(folder);
        let controllers = controllers.into_iter().map(|line| format!("{line}\n"));
        let lines: Vec<_> = folders.chain(controllers).collect();
        // An emulator that was killed may have left its list.
        self.directory.remove(FOLDERS);
        if lines.is_empty() {
            return Ok(());
        }
        let path = names::channel_root(&self.instance)?.join(FOLDERS);
        let written = self.directory.open_file(FOLDERS).and_then(|file| match file {
            Some(file) => file.write_all_at(lines.concat().as_bytes(), 0),
            None => Err(io::ErrorKind::NotFound.into()),
        });
        written.map_err(|reason| MemoryError::System { path, doing: "write", reason })
    }

    /// Returns the folders of a running instance's devices; empty if it has none.
    pub(crate) fn device_folders(instance: &str) -> Vec<DeviceFolder> {
        let lines = Self::published(instance, |line| line.starts_with('/') || line.starts_with(SCRIPT));
        let has_script = |path: &str| lines.iter().any(|line| line.strip_prefix(SCRIPT) == Some(path));
        let paths = lines.iter().filter(|line| line.starts_with('/'));
        paths.map(|path| DeviceFolder { path: path.into(), has_script: has_script(path) }).collect()
    }

    /// Returns the lines of a running instance's controllers with option cards.
    pub(crate) fn controllers(instance: &str) -> Vec<String> {
        Self::published(instance, |line| !line.starts_with('/') && !line.starts_with(SCRIPT))
    }

    fn published(instance: &str, is_wanted: impl Fn(&&str) -> bool) -> Vec<String> {
        let read = || {
            let directory = PrivateDir::open(&names::channel_root(instance).ok()?).ok()??;
            let mut text = String::new();
            let mut file = directory.find_file(FOLDERS).ok()??.take(LONGEST_FOLDERS);
            file.read_to_string(&mut text).ok().map(|_| text)
        };
        let text = read().unwrap_or_default();
        text.lines().filter(is_wanted).map(str::to_owned).collect()
    }

    /// Removes the list.
    pub(super) fn remove_device_folders(&self) {
        self.directory.remove(FOLDERS);
    }
}
