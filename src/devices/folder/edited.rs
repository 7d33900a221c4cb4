//! Checks of a folder while its files are edited. These checks register no device.
//!
//! The tables of a layout are never freed. So handshakes and scripts are checked with the layout as it was
//! last saved, not with each state while the layout is typed (D-843).

use super::script::Script;
use super::{
    FolderError, MOST_FOLDERS, SCRIPT, check_limits, check_names, fingerprint, handshakes, loaded,
    state_word, texts,
};
use crate::layout::DeviceLayout;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Maximum number of folder states that a process with a long run time reads: a process beside an editor, or
/// a server of all instances. A table of registers has some 10 KB.
const MOST_FOR_LONG: usize = 4096;

/// Allows this process to read more folders than other processes. Such a process reads a folder again after
/// each change, and each state counts.
pub(crate) fn allow_many_folders() {
    loaded().most = MOST_FOR_LONG;
}

/// Allows this process to read [`MOST_FOLDERS`] folders in addition to those that it has read. A process of several scenarios
/// calls this function before each scenario, so that the folders of one do not count for the next.
pub(crate) fn allow_further_folders() {
    let mut loaded = loaded();
    let longest = loaded.lengths().into_iter().fold(loaded.in_slots.len(), usize::max);
    loaded.most = longest + MOST_FOLDERS;
}

/// Checks the layout in `dir`. `edits` has texts that replace the contents of files; the keys are the paths
/// of the files.
///
/// # Errors
/// [`FolderError`] with the place.
pub(crate) fn check_layout(dir: &Path, edits: BTreeMap<PathBuf, String>) -> Result<(), FolderError> {
    let read = commram_layoutc::read_edited_folder(dir, edits)?;
    read.inputs.iter().try_for_each(|(path, text)| texts::check(path, text))?;
    check_limits(dir, &read)
}

/// Checks a text of `handshakes.toml` in `dir`.
///
/// # Errors
/// [`FolderError`] with the line.
pub(crate) fn check_handshakes(dir: &Path, text: &str) -> Result<(), FolderError> {
    let path = dir.join(handshakes::FILE);
    texts::check(&path, text)?;
    handshakes::read(&path, text, layout(dir)?).map(drop)
}

/// Checks a text of the script `name` in `dir`, which is a part of the firmware.
///
/// # Errors
/// [`FolderError`] with the line.
pub(crate) fn check_script(dir: &Path, name: &str, text: &str) -> Result<(), FolderError> {
    match Script::read(dir)? {
        Some(script) => {
            let layout = layout(dir)?;
            let path = dir.join(handshakes::FILE);
            let tables = commram_layoutc::read_file_of_folder(dir, handshakes::FILE)?;
            // Mistakes in the tables are reported when the file of the tables is checked, not here.
            let tables = tables.and_then(|text| handshakes::read(&path, &text, layout).ok());
            let records = tables.unwrap_or_default().records;
            script.with(name, text).check(dir, layout, &records).map(drop)
        }
        None => Ok(()),
    }
}

/// Returns the saved layout in `dir`.
///
/// # Errors
/// A file of the layout is wrong, or this process has read too many folders.
pub(crate) fn layout(dir: &Path) -> Result<&'static DeviceLayout, FolderError> {
    let mut read = commram_layoutc::read_folder(dir)?;
    let script = commram_layoutc::read_file_of_folder(dir, SCRIPT)?;
    if script.is_some() {
        state_word::add(dir, &mut read.device)?;
    }
    check_limits(dir, &read)?;
    check_names(dir, &read)?;
    let fingerprint = fingerprint(dir, &read, script.iter().map(|_| (SCRIPT, "")));
    let mut loaded = loaded();
    loaded.has_room(dir)?;
    Ok(loaded.table(fingerprint, &read))
}

/// Returns the keys of a table of `handshakes.toml`.
pub(crate) fn handshake_keys(table: &str) -> Vec<String> {
    handshakes::keys(table)
}
