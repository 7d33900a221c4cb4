//! Finds files in a folder that the device does not read. Their names are probably wrong.

use super::{FolderError, SCRIPT, handshakes};
use crate::layout::did_you_mean;
use std::collections::BTreeSet;
use std::path::Path;
#[cfg(feature = "script")]
use std::path::PathBuf;

/// File in a folder with the exercise of the device. It is not a part of the firmware.
pub(super) const EXERCISE: &str = "exercise.rhai";
/// Files with fixed names.
pub(super) const FIXED: [&str; 4] = ["device.toml", handshakes::FILE, SCRIPT, EXERCISE];
/// Files that commands of commram read in a directory: a plant with the device, and a configuration.
const OF_COMMANDS: [&str; 2] = ["plant.toml", "commram.toml"];
/// Maximum number of entries of a folder that are compared.
const MOST_ENTRIES: usize = 4096;

/// Returns the names of the TOML files and scripts directly in the folder. Hidden files are left out, because
/// editors and tools may create such files.
///
/// # Errors
/// The folder cannot be read.
fn names(dir: &Path) -> Result<BTreeSet<String>, FolderError> {
    let missing = |reason| FolderError::Missing { dir: dir.to_owned(), reason };
    let entries = std::fs::read_dir(dir).map_err(missing)?.take(MOST_ENTRIES);
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let is_named = |name: &String| {
        !name.starts_with('.')
            && [".toml", ".rhai"].iter().any(|end| name.to_ascii_lowercase().ends_with(end))
    };
    Ok(names.filter(is_named).collect())
}

/// Refuses a folder if a file with a fixed name is missing and another file has a similar name.
///
/// # Errors
/// [`FolderError::Misnamed`]
pub(super) fn check(dir: &Path, inputs: &BTreeSet<String>) -> Result<(), FolderError> {
    let names = names(dir)?;
    // `device.toml` is not checked here, because without it there is no device. Other scripts are read only
    // if `firmware.rhai` exists.
    let missing: Vec<_> =
        [handshakes::FILE, SCRIPT].into_iter().filter(|name| !names.contains(*name)).collect();
    let is_read = |name: &str| inputs.contains(name) || FIXED.contains(&name);
    for name in names.iter().filter(|name| !is_read(name)) {
        let hint = did_you_mean(name, missing.iter().copied());
        if !hint.is_empty() {
            return Err(FolderError::Misnamed { path: dir.join(name), hint });
        }
    }
    Ok(())
}

/// Returns the paths of all files that a device in the folder reads or may read: its scripts, its TOML files, and the
/// files with fixed names, which may be missing. Only these names are returned if the folder cannot be read.
#[cfg(feature = "script")]
pub(crate) fn files_of(dir: &Path) -> Vec<PathBuf> {
    let mut names = names(dir).unwrap_or_default();
    names.extend(FIXED.map(str::to_owned));
    names.into_iter().map(|name| dir.join(name)).collect()
}

/// Returns files that the device does not read. It reads the files with fixed names, and `inputs`.
///
/// # Errors
/// The folder cannot be read.
pub(super) fn unread(dir: &Path, inputs: &BTreeSet<String>) -> Result<Vec<String>, FolderError> {
    let is_read = |name: &String| {
        inputs.contains(name) || FIXED.iter().chain(&OF_COMMANDS).any(|known| name.as_str() == *known)
    };
    Ok(names(dir)?.into_iter().filter(|name| !is_read(name)).collect())
}
