//! A shell for the commands in the documentation.

use crate::common::{Outcome, finish, remove_remains, unique_name};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// Replaces cargo, which would check the whole project each time.
const CARGO: &str = "#!/bin/sh\n[ \"$1 $2\" = 'run --example' ] || exit 2\nexample=$3\nshift 3\n[ $# = 0 ] || shift\n\
    exec \"$EXAMPLES/$example\" \"$@\"\n";

/// A shell in a separate directory with the needed files of the project, with the built programs in its path and a
/// private instance. The instance ends when this value is dropped.
pub(crate) struct Shell {
    name: String,
    directory: TempDir,
}

impl Shell {
    /// Creates a shell with these directories of the project in its directory.
    pub(crate) fn new(of_project: &[&str]) -> Self {
        let directory = tempfile::tempdir().unwrap();
        for name in of_project {
            let target = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
            std::os::unix::fs::symlink(target, directory.path().join(name)).unwrap();
        }
        let cargo = directory.path().join("bin/cargo");
        std::fs::create_dir(cargo.parent().unwrap()).unwrap();
        std::fs::write(&cargo, CARGO).unwrap();
        std::fs::set_permissions(&cargo, PermissionsExt::from_mode(0o755)).unwrap();
        Self { name: unique_name(), directory }
    }

    /// Returns the directory of the commands.
    pub(crate) fn directory(&self) -> &Path {
        self.directory.path()
    }

    /// Returns the output of a command as a page prints it, with the default name of the instance.
    pub(crate) fn as_printed(&self, output: &str) -> String {
        output.replace(&self.name, "default")
    }

    /// Returns a text of a page with the private instance in place of the default one.
    pub(crate) fn as_typed(&self, text: &str) -> String {
        text.replace("commram.default.", &format!("commram.{}.", self.name))
    }

    /// Runs a command or a script, which ends at its first failure.
    pub(crate) fn run(&self, script: &str) -> Outcome {
        let programs = Path::new(env!("CARGO_BIN_EXE_commram")).parent().unwrap();
        let own = self.directory.path().join("bin");
        let path = std::env::var("PATH").unwrap_or_default();
        let mut shell = Command::new("sh");
        shell.args(["-e", "-c", script]).current_dir(self.directory.path());
        shell.env("PATH", format!("{}:{}:{path}", own.display(), programs.display()));
        shell.env("EXAMPLES", programs.join("examples")).env("COMMRAM_INSTANCE", &self.name);
        // The timeout is long, because a machine that runs many tests is slow.
        finish(shell.env("COMMRAM_CONNECT_TIMEOUT", "1min").env_remove("COMMRAM_EXAMPLE"))
    }
}

impl Drop for Shell {
    fn drop(&mut self) {
        let mut stop = crate::common::commram();
        // The instance has stopped already, unless the test fails.
        let _ = stop.args(["stop", "-i", &self.name]).output();
        remove_remains(&self.name);
    }
}
