//! Runs the commands and programs of docs/guide/journals.md, in the order of the page.

use crate::common::{finish, python};
use crate::shell::Shell;

/// Returns the texts of the blocks in one language.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<&'a str> {
    page.split(language).skip(1).filter_map(|rest| rest.split("\n```").next()).collect()
}

#[test]
fn the_programs_of_the_page_about_journals_run() {
    let page = include_str!("../../docs/guide/journals.md");
    let [commands] = blocks(page, "```console\n")[..] else { panic!("one session") };
    let script = commands.replace("\\\n", " ");
    let script: String =
        script.lines().filter_map(|line| line.strip_prefix("$ ")).map(|line| format!("{line}\n")).collect();
    let shell = Shell::new(&[]);
    shell.run(&script).ok();
    let Some(mut python) = python(&["pandas"]) else { return };
    let programs = blocks(page, "```python\n");
    assert_eq!(programs.len(), 6);
    let outcome =
        finish(python.args(["-W", "error", "-c", &programs.join("\n")]).current_dir(shell.directory()));
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(0), ""), "{}", outcome.out);
    for part in ["latency_us", "16#0080", " edges\n", "something else"] {
        assert!(outcome.out.contains(part), "{part}\n{}", outcome.out);
    }
}
