//! Search path of devices in folders. It is used if a plant or a command names a device without a path
//! (D-808).

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Maximum number of entries that are examined in each directory, to find the names for a message.
const MOST_EXAMINED: usize = 4096;
/// Maximum number of names in a message.
const MOST_LISTED: usize = 64;

/// Directories of the configuration.
static CONFIGURED: OnceLock<Vec<PathBuf>> = OnceLock::new();

/// Sets the directories that are searched first. Only the first call has an effect.
pub fn search_first(directories: Vec<PathBuf>) {
    let _ = CONFIGURED.set(directories);
}

/// Returns the directories in the order of the search: those of [`search_first`], `commram/devices` in the
/// user's data directory, and `share/commram/devices` of the installation.
#[must_use]
pub fn search_path() -> Vec<PathBuf> {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/share"));
    let data = std::env::var_os("XDG_DATA_HOME").map(PathBuf::from).filter(|dir| dir.is_absolute());
    let user = data.or_else(home).map(|dir| dir.join("commram/devices"));
    let program = std::env::current_exe().ok();
    let prefix = program.as_deref().and_then(Path::parent).and_then(Path::parent);
    let installed = prefix.map(|prefix| prefix.join("share/commram/devices"));
    CONFIGURED.get().cloned().unwrap_or_default().into_iter().chain(user).chain(installed).collect()
}

/// Returns the folder of this name in the search path. The folder must contain `device.toml`.
#[must_use]
pub fn search(name: &str) -> Option<PathBuf> {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '-' | '_');
    let is_name = !name.is_empty() && name.len() <= 63 && name.chars().all(is_plain);
    let mut directories = search_path().into_iter().filter(|_| is_name).map(|dir| dir.join(name));
    directories.find(|dir| is_device(dir))
}

/// Returns names of the devices in the search path, for messages.
#[must_use]
pub fn names_in_search_path() -> Vec<String> {
    let entries = search_path().into_iter().filter_map(|dir| std::fs::read_dir(dir).ok());
    let folders = entries.flat_map(|entries| entries.flatten().take(MOST_EXAMINED)).map(|entry| entry.path());
    let names =
        folders.filter(|dir| is_device(dir)).filter_map(|dir| Some(dir.file_name()?.to_str()?.to_owned()));
    names
        .filter(|name| search(name).is_some())
        .collect::<BTreeSet<_>>()
        .into_iter()
        .take(MOST_LISTED)
        .collect()
}

fn is_device(dir: &Path) -> bool {
    dir.join("device.toml").is_file()
}
