//! The files of a running device in a folder. This module finds out whether the files have changed since they
//! were read.

use super::config::FolderConfig;
use super::{Folder, SCRIPT, files, load};
use crate::devices::settings_number;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// State of a file as the operating system reports it: times of changes, length and inode number.
type FileState = Option<(i64, i64, i64, i64, u64, u64)>;

/// The folder that a device was read from.
pub(super) struct Source {
    config: FolderConfig,
    stamp: Vec<FileState>,
    /// True if the device could not take over the files with this stamp.
    has_refused: bool,
}

impl Source {
    pub(super) fn new(config: FolderConfig) -> Self {
        let stamp = stamp(&config);
        Source { config, stamp, has_refused: false }
    }

    /// Reads the folder again if a file has changed. Returns `None` if the files of the device are unchanged.
    ///
    /// # Errors
    /// The device cannot take over the files; the error is a line of text.
    pub(super) fn read_again(&mut self) -> Result<Option<&'static Folder>, String> {
        let stamp = stamp(&self.config);
        if stamp == self.stamp {
            return Ok(None);
        }
        self.stamp = stamp;
        let read = self.read();
        self.has_refused = read.is_err();
        let new = read?;
        if core::ptr::eq(new, self.config.folder) {
            return Ok(None);
        }
        self.config.folder = new;
        Ok(Some(new))
    }

    /// Returns the folder.
    pub(super) fn folder(&self) -> &Path {
        &self.config.dir
    }

    /// True if the device could not take over the files when they were last read.
    pub(super) fn has_refused(&self) -> bool {
        self.has_refused
    }

    /// Reads the folder.
    ///
    /// # Errors
    /// The device cannot take over the files; the error is a line of text.
    fn read(&self) -> Result<&'static Folder, String> {
        let FolderConfig { dir, folder, .. } = &self.config;
        // A folder that is read is registered, and a client would then find this device without its front.
        let has_script = dir.join(SCRIPT).symlink_metadata().is_ok();
        if dir.is_dir() && has_script != folder.has_script() {
            let what = if has_script { "new; start the instance again" } else { "missing" };
            return Err(format!("{SCRIPT} is {what}"));
        }
        let new = load(dir).map_err(|error| error.to_string().replace(&format!("{}/", dir.display()), ""))?;
        if !core::ptr::eq(new.registered.layout, folder.registered.layout) || new.tables != folder.tables {
            return Err(
                "a file with registers or handshakes has changed; start the instance again".to_owned()
            );
        }
        Ok(new)
    }

    /// Returns the number for the settings of the device with its present files.
    pub(super) fn settings(&self) -> u64 {
        settings_number(&self.config)
    }
}

/// Returns the state of the folder and of each file that the device has read. The state of the folder changes
/// when a file is added or removed.
fn stamp(config: &FolderConfig) -> Vec<FileState> {
    let FolderConfig { dir, folder, .. } = config;
    let state = |path: PathBuf| {
        let file = std::fs::symlink_metadata(path).ok()?;
        Some((file.mtime(), file.mtime_nsec(), file.ctime(), file.ctime_nsec(), file.len(), file.ino()))
    };
    let named = folder.inputs.iter().map(String::as_str).chain(files::FIXED);
    [state(dir.clone())].into_iter().chain(named.map(|name| state(dir.join(name)))).collect()
}
