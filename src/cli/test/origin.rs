//! Where a report comes from: host and commit.

use std::process::{Command, Stdio};

/// Environment variables of CI servers that contain the tested commit: GitHub and compatible servers, GitLab, Jenkins.
const COMMITS: [&str; 3] = ["GITHUB_SHA", "CI_COMMIT_SHA", "GIT_COMMIT"];

/// Origin of a report.
pub(super) struct Origin {
    /// Name of the host, with its number of processors and its kernel.
    pub host: String,
    /// Commit of the working directory; `None` outside a repository.
    pub commit: Option<String>,
}

impl Origin {
    /// Returns the origin of a report of this process.
    pub(super) fn of_this_run() -> Self {
        let fact = |name: &str| {
            let text = std::fs::read_to_string(format!("/proc/sys/kernel/{name}")).unwrap_or_default();
            text.trim().to_owned()
        };
        let count = std::thread::available_parallelism().map_or(1, usize::from);
        let processors = crate::plural::plural(count as u64, "processor");
        Self {
            host: format!("{}, {processors}, Linux {}", fact("hostname"), fact("osrelease")),
            commit: commit(),
        }
    }
}

/// Returns the commit that the CI server names, otherwise the commit of the working directory.
fn commit() -> Option<String> {
    let named = COMMITS.iter().find_map(|name| std::env::var(name).ok().filter(|commit| !commit.is_empty()));
    named.or_else(|| {
        let mut git = Command::new("git");
        let output =
            git.args(["rev-parse", "HEAD"]).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
        let commit = String::from_utf8(output.stdout).ok()?.trim().to_owned();
        (output.status.success() && !commit.is_empty()).then_some(commit)
    })
}
