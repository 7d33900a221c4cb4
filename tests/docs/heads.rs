//! Runs the commands in the head comments of programs, plants and scenarios.

use crate::common::{example, python};
use crate::shell::Shell;
use std::path::{Path, PathBuf};

const FOLDERS: [&str; 5] = ["tools/examples", "tools/c", "tools/python", "tools/plants", "tests/scenarios"];

/// Returns the files in the order of their names.
fn files() -> Vec<PathBuf> {
    let folder = |name| Path::new(env!("CARGO_MANIFEST_DIR")).join(name).read_dir().unwrap();
    let mut files: Vec<_> = FOLDERS.into_iter().flat_map(folder).map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.is_file());
    files.sort();
    files
}

/// Returns the scripts in a file's first comment: consecutive lines that are indented by four spaces.
fn scripts(text: &str) -> Vec<String> {
    let mut scripts = vec![String::new()];
    for line in text.lines().skip_while(|line| line.starts_with("#!")) {
        let marks = ["//! ", "// ", "# ", " * ", ""];
        let inside = marks.iter().find_map(|mark| line.strip_prefix(mark)).unwrap_or_default();
        if line.starts_with("#!") || line.starts_with("use ") || line.starts_with("set ") {
            break;
        }
        match inside.strip_prefix("    ") {
            Some(command) => *scripts.last_mut().unwrap() += &format!("{command}\n"),
            None => scripts.push(String::new()),
        }
    }
    scripts.retain(|script| script.lines().any(|line| line.starts_with("commram ")));
    scripts
}

#[test]
fn the_commands_in_file_heads_work() {
    example("master");
    let mut ran = Vec::new();
    for file in files() {
        let name = file.file_name().unwrap().to_str().unwrap();
        if name.ends_with(".py") && python(&[]).is_none() {
            continue;
        }
        for script in scripts(&std::fs::read_to_string(&file).unwrap()) {
            let shell = Shell::new(&["tools", "tests"]);
            let outcome = shell.run(&script);
            assert_eq!(outcome.code, Some(0), "{name}:\n{script}{}{}", outcome.out, outcome.err);
            ran.push(name.to_owned());
        }
    }
    let wanted =
        ["master.rs", "slave.rs", "cluster.rs", "timer_task.rs", "baps.rs", "soft_plc.c", "cs0015.toml"];
    for name in wanted.into_iter().chain(["can-dp2.toml", "28-one-answer.rhai"]) {
        assert!(ran.iter().any(|file| file == name), "the head of {name} starts nothing: {ran:?}");
    }
}

/// The commands in a head must not start an emulator by `commram run`: with `&` it may not be ready for the next
/// command, and without `&` it blocks the next command.
#[test]
fn pages_and_file_heads_start_emulators_only_with_detach() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut starts = 0;
    for page in crate::pages().into_iter().chain([root.join("README.md")]).chain(files()) {
        let text = std::fs::read_to_string(&page).unwrap();
        let is_page = page.extension().is_some_and(|ending| ending == "md");
        let scripts = if is_page { blocks(&text) } else { scripts(&text) };
        for line in scripts.iter().flat_map(|script| script.lines()) {
            let command = line.trim_start_matches("$ ");
            if command.starts_with("commram run") && !command.contains(" --check") {
                starts += 1;
                assert!(command.contains(" --detach"), "{}: {line}", page.display());
            }
        }
    }
    assert!(starts > 6, "{starts}");
}

/// Returns the blocks of commands on a page.
fn blocks(text: &str) -> Vec<String> {
    let of = |language: &str| {
        let fence = format!("```{language}\n");
        let blocks = text.split(&fence).skip(1).filter_map(|rest| rest.split("```").next());
        blocks.map(str::to_owned).collect::<Vec<_>>()
    };
    [of("console"), of("sh")].concat()
}
