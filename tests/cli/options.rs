//! The table of options in docs/reference/command-line.md.

use crate::common::run;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

const BEGIN: &str = "| option | meaning | commands |\n|---|---|---|\n";

/// Meanings of options with a help that describes only their use in one command.
const MEANINGS: &[(&str, &str)] = &[
    ("--all", "All that the command can act on: emulators of this user, forced registers, faults"),
    ("--allow-empty", "An empty log, or a scenario without expectations, is no error"),
    ("--bus", "Only this bus; with `bus play` the bus that all frames go to"),
    ("--check", "Check only, and change or start nothing"),
    ("--format", "Output format"),
    (
        "--full",
        "Everything: also reserved registers, reset values, registers without a difference, each record of cyclic traffic",
    ),
    ("--layout", "Directory of layout files"),
    ("--list", "List only, and run nothing"),
    ("--jobs", "Number of scenarios or rounds that run at the same time"),
    ("--output", "File to write"),
    (
        "--report",
        "Write a report into this file: html, a self-contained page for people (commram-report.html); with `test` also \
         json (commram-report.json), which `commram test merge` can read; `test` accepts one of each kind",
    ),
    ("--since", "Only from this emulated time on"),
    ("--until", "Only up to this emulated time"),
];

/// An option of a command: `-i, --instance <NAME>` and its help.
type Opt = (String, String);

/// Returns the options and the inner commands that the help of a command lists.
fn of(command: &[&str]) -> (Vec<Opt>, Vec<String>) {
    let help = run(&[command, &["-h"]].concat());
    let (mut options, mut inner) = (Vec::<Opt>::new(), Vec::new());
    let mut is_commands = false;
    for line in help.ok().lines() {
        if !line.starts_with(' ') {
            is_commands = line == "Commands:";
            continue;
        }
        let text = line.trim_start();
        let (front, help) = text.split_once("  ").unwrap_or((text, ""));
        if is_commands && line.starts_with("  ") && !line.starts_with("   ") {
            inner.push(front.to_owned());
        } else if text.starts_with('-') && line.len() - text.len() <= 6 {
            options.push((front.to_owned(), help.trim().to_owned()));
        } else if let Some((_, help)) = options.last_mut().filter(|_| line.len() - text.len() >= 10) {
            *help = format!("{help} {text}").trim().to_owned();
        }
    }
    inner.retain(|name| name != "help");
    (options, inner)
}

/// Returns all commands with the options of each.
fn all() -> Vec<(String, Vec<Opt>)> {
    let help = run(&["help"]);
    let list = help.ok().split("Usage: ").nth(1).unwrap().split("Options:\n").next().unwrap().to_owned();
    let names = list.lines().filter_map(|line| line.strip_prefix("  ")?.split_ascii_whitespace().next());
    let mut waiting: Vec<Vec<String>> =
        names.filter(|name| *name != "help").map(|name| vec![name.to_owned()]).collect();
    waiting.reverse();
    let mut all = Vec::new();
    while let Some(command) = waiting.pop() {
        let words: Vec<&str> = command.iter().map(String::as_str).collect();
        let (options, inner) = of(&words);
        waiting.extend(inner.into_iter().rev().map(|name| [&command[..], &[name]].concat()));
        all.push((command.join(" "), options));
    }
    all
}

/// Returns the meaning without the notes of the parser in brackets.
fn meaning(help: &str) -> String {
    let end = ["[env:", "[default: ", "[possible values:"].iter().filter_map(|note| help.find(note)).min();
    help[..end.unwrap_or(help.len())].trim().replace('|', "\\|")
}

#[test]
fn every_option_has_one_spelling_and_is_in_the_table() {
    let mut options: BTreeMap<String, (BTreeSet<String>, String, Vec<String>)> = BTreeMap::new();
    for (command, own) in all() {
        for (spec, help) in own {
            let long = spec.split_ascii_whitespace().find(|word| word.starts_with("--")).unwrap().to_owned();
            if ["--help", "--color", "--quiet", "--verbose"].contains(&long.as_str()) {
                continue;
            }
            let entry = options.entry(long).or_insert_with(|| (BTreeSet::new(), meaning(&help), Vec::new()));
            entry.0.insert(spec.trim_end_matches("...").to_owned());
            entry.2.push(command.clone());
        }
    }
    let mut table = BEGIN.to_owned();
    for (long, (specs, help, commands)) in &options {
        let meaning =
            MEANINGS.iter().find(|(known, _)| known == long).map_or(help.as_str(), |(_, meaning)| meaning);
        let specs: Vec<_> = specs.iter().collect();
        assert_eq!(specs.len(), 1, "{long} means one thing: {specs:?} in {commands:?}");
        let most = 6;
        let shown = if commands.len() > most { "most commands".to_owned() } else { commands.join(", ") };
        writeln!(table, "| `{}` | {meaning} | {shown} |", specs[0]).unwrap();
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reference/command-line.md");
    let page = std::fs::read_to_string(path).unwrap();
    let begin = page.find(BEGIN).expect("the page has a table of options");
    let end = page[begin..].find("\n\n").map_or(page.len(), |end| begin + end + 1);
    if std::env::var_os("COMMRAM_UPDATE_OPTIONS").is_some() {
        std::fs::write(path, format!("{}{table}{}", &page[..begin], &page[end..])).unwrap();
        return;
    }
    assert_eq!(&page[begin..end], table, "COMMRAM_UPDATE_OPTIONS=1 renews the table");
}
