//! The file with the history of input lines.

use crate::output_file;
use std::fs::DirBuilder;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

/// Returns the path of the history file, which only its owner can read and write. `None` if no directory for the file
/// exists, or if another user has created it.
pub(super) fn file() -> Option<PathBuf> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")))?;
    let file = state.join("commram/history");
    make(&file).ok()?;
    Some(file)
}

fn make(file: &Path) -> std::io::Result<()> {
    if let Some(directory) = file.parent() {
        output_file::check_own_place(directory)?;
        DirBuilder::new().recursive(true).mode(0o700).create(directory)?;
    }
    output_file::open_to_append(file, 0o600).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    #[test]
    fn only_the_owner_can_read_the_history() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("state/commram/history");
        make(&file).unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!((mode(&file), mode(file.parent().unwrap())), (0o600, 0o700));
    }
}
