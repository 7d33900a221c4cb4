//! External programs that some tests need: `.ci/tools` lists them.

use std::io::Write;
use std::process::Command;

const TOOLS: &str = include_str!("../../.ci/tools");

/// Reports that the test is skipped because `tool` is missing. Fails if CI should have installed it.
pub(crate) fn skipped(tool: &str, reason: &str) {
    let mut listed = TOOLS.lines().map(|line| line.split_whitespace().take(2).collect::<Vec<_>>());
    let entry = listed.find(|entry| entry.first() == Some(&tool));
    let is_installed = entry.unwrap_or_else(|| panic!("{tool} is not listed in .ci/tools"))[1] == "yes";
    let required = is_installed && std::env::var_os("COMMRAM_REQUIRE_TOOLS").is_some();
    assert!(!required, "{tool} was to be installed: {reason}");
    let thread = std::thread::current();
    // Does not use a print macro, because the test harness captures its output if a test passes.
    let _ = writeln!(std::io::stderr(), "skipped: {}: {tool}: {reason}", thread.name().unwrap_or("a test"));
}

/// Returns Python with the packages. Without them the test is skipped.
pub(crate) fn python(packages: &[&str]) -> Option<Command> {
    python_for("python", packages)
}

/// Does the same as [`python`], with packages that are listed as a separate tool.
pub(crate) fn python_for(tool: &str, packages: &[&str]) -> Option<Command> {
    let imports = packages.iter().map(|package| format!("import {package}\n")).collect::<String>();
    let program = std::env::var("COMMRAM_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let reason = match Command::new(&program).args(["-c", &imports]).output() {
        Ok(output) if output.status.success() => return Some(Command::new(program)),
        Ok(output) => String::from_utf8_lossy(&output.stderr).lines().last().unwrap_or_default().to_owned(),
        Err(error) => format!("{program}: {error}"),
    };
    skipped(tool, &reason);
    None
}

/// Returns whether a program is installed. If not, the test is skipped.
pub(crate) fn is_there(tool: &str) -> bool {
    let there = Command::new("sh").args(["-c", &format!("command -v {tool}")]).output();
    let there = there.is_ok_and(|output| output.status.success());
    if !there {
        skipped(tool, "it is not there");
    }
    there
}
