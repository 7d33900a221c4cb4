//! Each operation has a verb, a command and a method in Python. If one of them is missing, `docs/reference/channel.md`
//! has the reason.

mod arguments;

use super::Cli;
use crate::request::ops::ops;
use crate::script::verbs;
use clap::CommandFactory;
use std::fs;
use std::path::{Path, PathBuf};

const HEAD: &str = "| Operation | Verb | Command | Method in Python |\n|---|---|---|---|\n";

macro_rules! names {
    ($(
        $(#[$doc:meta])*
        $op:ident = $number:literal, $name:ident, $class:ident -> $reply:ident
        $({$($fields:tt)*})?
    ),+ $(,)?) => {
        /// Variant and name of each operation.
        const OPERATIONS: &[(&str, &str)] = &[$((stringify!($op), stringify!($name))),+];
    };
}

ops!(names);

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the source texts of all files in a folder.
fn sources(folder: &Path) -> String {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let text = |path: PathBuf| match path.is_dir() {
        true => sources(&path),
        false => fs::read_to_string(path).unwrap(),
    };
    entries.map(text).collect()
}

/// Returns the name in a cell of the table; `None` if the cell contains a reason.
fn only_name(cell: &str) -> Option<&str> {
    let name = cell.strip_prefix('`')?.strip_suffix('`')?;
    (!name.contains(['`', ' '])).then_some(name)
}

/// Checks that a cell contains a known name, or a reason.
fn check(operation: &str, cell: &str, is_known: impl Fn(&str) -> bool) {
    match only_name(cell) {
        Some(name) => assert!(is_known(name), "{operation}: there is no `{name}`"),
        None => assert!(cell.split(' ').count() >= 3, "{operation}: `{cell}` is neither a name nor a reason"),
    }
}

/// Returns the rows of the table: operation, verb, command, method.
fn rows(page: &str) -> Vec<Vec<&str>> {
    let (_, table) = page.split_once(HEAD).expect("the head of the table");
    let (table, _) = table.split_once("\n\n").unwrap();
    table.lines().map(|row| row.trim_matches(['|', ' ']).split(" | ").collect()).collect()
}

fn page() -> String {
    fs::read_to_string(root().join("docs/reference/channel.md")).unwrap()
}

#[test]
fn each_operation_has_a_verb_a_command_and_a_method_or_a_reason() {
    let page = page();
    let [script, cli] = ["src/script", "src/cli"].map(|folder| sources(&root().join(folder)));
    let package = root().join("tools/python/python/commram");
    let python =
        ["_native.pyi", "_plant.py"].map(|file| fs::read_to_string(package.join(file)).unwrap()).concat();
    let (verbs, command) = (verbs(), Cli::command());
    let mut rows = rows(&page);
    for (variant, name) in OPERATIONS {
        let at = rows.iter().position(|row| only_name(row[0]) == Some(*name));
        let row = rows.swap_remove(at.unwrap_or_else(|| panic!("the table has no row of `{name}`")));
        let sent = |text: &str| {
            let ends = |rest: &str| !rest.starts_with(char::is_alphanumeric);
            let built = format!("Op::{variant}");
            text.split(&built).skip(1).any(ends) || *name == "bring_saved" && text.contains("Op::bring(")
        };
        check(name, row[1], |verb| sent(&script) && verbs.iter().any(|known| known.name == verb));
        check(name, row[2], |known| sent(&cli) && command.find_subcommand(known).is_some());
        check(name, row[3], |method| python.contains(&format!("def {method}(")));
    }
    assert!(rows.is_empty(), "these are no operations: {rows:?}");
}
