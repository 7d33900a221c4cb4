//! The README's console session, run as it stands there: what a newcomer types must work.

mod common;

use common::{Emulator, finish};
use std::path::Path;
use std::process::Command;

/// The commands of the session behind the sentence that introduces it, each with the output printed
/// below it (empty where none is shown).
fn session() -> Vec<(String, String)> {
    let readme = include_str!("../README.md");
    let behind = readme.split("from restart to cyclic process data:").nth(1).expect("the session's title");
    let block = behind.split("```console\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let mut steps: Vec<(String, String)> = Vec::new();
    for line in block.replace("\\\n", " ").lines() {
        match line.strip_prefix("$ ") {
            Some(command) => steps.push((command.to_owned(), String::new())),
            None => {
                let (_, output) = steps.last_mut().expect("output stands below a command");
                output.push_str(line);
                output.push('\n');
            }
        }
    }
    steps
}

#[test]
fn the_session_of_the_readme_works_as_printed() {
    let emulator = Emulator::stepped();
    let programs = Path::new(env!("CARGO_BIN_EXE_commram")).parent().unwrap();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap_or_default());
    let steps = session();
    assert!(steps.len() > 10, "{steps:?}");
    for (command, shown) in &steps {
        let mut shell = Command::new("sh");
        shell.args(["-c", command]).env("PATH", &path).env("COMMRAM_INSTANCE", &emulator.name);
        let outcome = finish(&mut shell);
        assert_eq!(outcome.code, Some(0), "{command}\n{}", outcome.err);
        if !shown.is_empty() {
            assert_eq!(&outcome.out, shown, "{command}");
        }
        if command.contains("a_RD_BMARRAY[1][0]'") && command.contains("peek") {
            assert!(outcome.out.contains("16#11223344"), "the reference value came back: {}", outcome.out);
        }
    }
}
