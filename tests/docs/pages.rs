//! The documentation: all links have a target, the book has every page, and all printed sessions work.

use crate::shell::Shell;
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns README, CHANGELOG, CONTRIBUTING, SECURITY and all pages in `docs`.
fn pages() -> Vec<PathBuf> {
    let mut pages = crate::pages();
    pages.extend(
        ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"].map(|name| root().join(name)),
    );
    pages
}

fn parse(text: &str) -> impl Iterator<Item = Event<'_>> {
    Parser::new_ext(text, Options::ENABLE_TABLES)
}

/// Returns the anchors of a page's headings, as GitHub and mdBook make them.
fn anchors(text: &str) -> BTreeSet<String> {
    let (mut anchors, mut heading) = (BTreeSet::new(), None::<String>);
    for event in parse(text) {
        match event {
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::End(TagEnd::Heading(_)) => {
                let text = heading.take().unwrap_or_default().to_lowercase();
                let kept = text.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
                anchors.insert(kept.map(|c| if c == ' ' { '-' } else { c }).collect());
            }
            Event::Text(text) | Event::Code(text) => {
                if let Some(heading) = &mut heading {
                    heading.push_str(&text);
                }
            }
            _ => {}
        }
    }
    anchors
}

fn links(text: &str) -> Vec<String> {
    let link = |event| match event {
        Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
            Some(dest_url.into_string())
        }
        _ => None,
    };
    parse(text).filter_map(link).collect()
}

#[test]
fn every_link_leads_somewhere() {
    let mut checked = 0;
    for page in pages() {
        let text = std::fs::read_to_string(&page).unwrap();
        for link in links(&text).iter().filter(|link| !link.contains("://")) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: {link} does not exist", page.display());
            if !anchor.is_empty() {
                let known = anchors(&std::fs::read_to_string(&target).unwrap());
                assert!(known.contains(anchor), "{}: {link}: known are {known:?}", page.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 20, "{checked}");
}

/// The book contains only the pages. Pages name other files of the repository, but do not link to them.
#[test]
fn no_link_leaves_the_book() {
    let docs = root().join("docs");
    for page in crate::pages() {
        let folder = page.parent().unwrap();
        for link in links(&std::fs::read_to_string(&page).unwrap()) {
            let (file, _) = link.split_once('#').unwrap_or((&link, ""));
            if file.contains("://") || file.is_empty() {
                continue;
            }
            let target = folder.join(file).canonicalize();
            let is_inside = target.is_ok_and(|target| target.starts_with(&docs));
            assert!(is_inside, "{}: {link}", page.display());
        }
    }
}

/// Each decision has a heading as a link target, and a text that is short enough to read at once.
#[test]
fn every_decision_has_one_heading_and_a_short_text() {
    let mut numbers = BTreeSet::new();
    for page in crate::pages().into_iter().filter(|page| page.ends_with("decisions.md")) {
        let text = std::fs::read_to_string(&page).unwrap();
        let page = page.display();
        assert!(!text.contains("\n| D-"), "{page}: a decision is a heading, not a row of a table");
        for entry in text.split("\n### ").skip(1) {
            let (heading, rest) = entry.split_once('\n').unwrap();
            let (number, _title) = heading.split_once(": ").unwrap_or_else(|| panic!("{page}: {heading}"));
            let is_number = number.strip_prefix("D-").is_some_and(|digits| digits.parse::<u16>().is_ok());
            assert!(is_number, "{page}: {heading}: a heading of this level begins with `D-nn: `");
            assert!(numbers.insert(number.to_owned()), "{page}: {number} has another heading");
            let body = rest.split("\n## ").next().unwrap_or_default();
            let words = |block: &str| block.split_whitespace().count();
            let prose: usize = body.split("\n\n").filter(|block| !block.starts_with("- ")).map(words).sum();
            assert!((1..=160).contains(&prose), "{page}: {number}: {prose} words outside of lists");
        }
    }
    assert!(numbers.len() > 400, "{} decisions", numbers.len());
}

#[test]
fn the_book_has_every_page_once() {
    let summary = std::fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let mut in_book = links(&summary);
    in_book.sort();
    let docs = root().join("docs");
    let name = |page: PathBuf| page.strip_prefix(&docs).unwrap().to_str().unwrap().to_owned();
    let pages: Vec<_> = crate::pages().into_iter().map(name).filter(|name| name != "SUMMARY.md").collect();
    assert_eq!(in_book, pages);
}

/// Returns the commands of the console sessions in `text`, each with the output printed below it (empty if none is
/// shown).
fn session(text: &str) -> Vec<(String, String)> {
    let blocks = text.split("```console\n").skip(1).filter_map(|rest| rest.split("```").next());
    let mut steps: Vec<(String, String)> = Vec::new();
    for line in blocks.collect::<String>().replace("\\\n", " ").lines() {
        match line.strip_prefix("$ ") {
            Some(command) => steps.push((command.to_owned(), String::new())),
            None => {
                let (_, output) = steps.last_mut().expect("output follows a command");
                output.push_str(line);
                output.push('\n');
            }
        }
    }
    steps
}

/// Types the steps into a new shell. The steps start the emulator and end it.
fn type_in(steps: &[(String, String)]) {
    type_into(&Shell::new(&[]), steps);
}

/// Types the steps into this shell. The steps start the emulator and end it.
fn type_into(shell: &Shell, steps: &[(String, String)]) {
    assert!(steps.iter().any(|(step, _)| step.starts_with("commram run ")), "the session starts an emulator");
    assert!(steps.last().is_some_and(|(last, _)| last == "commram stop"), "the session ends with stop");
    for (command, shown) in steps {
        if command == "commram stop" {
            let findings = shell.run("commram check --format json");
            assert_eq!(findings.ok(), "[]\n", "findings, warnings included");
        }
        let outcome = shell.run(command);
        assert_eq!(outcome.code, Some(0), "{command}\n{}", outcome.err);
        if !shown.is_empty() {
            assert_eq!(&shell.as_printed(&outcome.out), shown, "{command}");
        }
    }
}

/// The commands for new users work and print the documented output.
#[test]
fn the_session_of_the_readme_works_as_printed() {
    let readme = include_str!("../../README.md");
    let session_and_rest = readme.split("## Dump the registers\n").nth(1).expect("the session's title");
    type_in(&session(session_and_rest.split("## ").next().unwrap()));
}

#[test]
fn the_session_of_the_command_line_works_as_printed() {
    type_in(&session(include_str!("../../docs/reference/command-line.md")));
}

#[test]
fn the_session_of_getting_started_works_as_printed() {
    let mut steps = session(include_str!("../../docs/guide/getting-started.md"));
    let last_peek = "peek 'node2.a_RD_BMARRAY[1][0]'";
    let (_, shown) =
        steps.iter().find(|(command, _)| command.contains(last_peek)).expect("a value comes back");
    assert!(shown.contains("16#11223344"), "the reference value came back: {shown}");
    // Other tests run commands with these words.
    let elsewhere = ["sudo apt install", "commram demo"];
    steps.retain(|(command, _)| !elsewhere.iter().any(|other| command.starts_with(other)));
    type_in(&steps);
}

#[test]
fn the_session_of_snapshots_works_as_printed() {
    type_in(&session(include_str!("../../docs/guide/snapshots.md")));
}

/// Returns the blocks of code of a page: language and text.
fn blocks(page: &str) -> Vec<(&str, &str)> {
    let mut blocks = page.split("\n```").skip(1).step_by(2);
    std::iter::from_fn(|| blocks.next()).filter_map(|block| block.split_once('\n')).collect()
}

/// Returns the file that a block names in a comment in its first line.
fn file_of(block: &str) -> Option<&str> {
    let line = block.lines().next()?;
    let comment = ["# ", "// ", "/* "].iter().find_map(|sign| line.strip_prefix(sign))?;
    let name = comment.trim_end_matches(" */");
    (name.contains('.') && !name.contains(' ')).then_some(name)
}

/// The page shows a plant and a log that plays in this plant.
#[test]
fn the_session_of_can_works_as_printed() {
    let page = include_str!("../../docs/reference/can.md");
    let shell = Shell::new(&[]);
    let files = blocks(page).into_iter().filter_map(|(_, text)| Some((file_of(text)?, text)));
    let written = files.map(|(name, text)| std::fs::write(shell.directory().join(name), format!("{text}\n")));
    assert_eq!(written.map(Result::unwrap).count(), 2);
    type_into(&shell, &session(page));
}

/// Writes the files that the page shows, and runs its commands, in the order of the page.
#[test]
fn the_session_of_own_device_works_as_printed() {
    let shell = Shell::new(&[]);
    let (mut files, mut commands) = (0, 0);
    for (language, text) in blocks(include_str!("../../docs/guide/own-device.md")) {
        if let Some(name) = file_of(text) {
            let path = shell.directory().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            // The program names the instance that the commands start.
            std::fs::write(&path, shell.as_typed(&format!("{text}\n"))).unwrap();
            files += 1;
        }
        let lines = text.lines().filter(|_| language == "console");
        for command in lines.filter_map(|line| line.strip_prefix("$ ")) {
            let outcome = shell.run(command);
            assert_eq!(outcome.code, Some(0), "{command}\n{}{}", outcome.out, outcome.err);
            if command == "./client" {
                assert_eq!(outcome.out, "status 0003\n");
            }
            commands += 1;
        }
    }
    assert_eq!((files, commands), (8, 11));
}
