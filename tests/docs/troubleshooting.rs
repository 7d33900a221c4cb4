//! The troubleshooting page prints each message exactly as in the source.

use std::path::{Path, PathBuf};

/// Parts that the source inserts into a message. In the source, the text before and after them is in separate strings.
const INSERTED: [&str; 4] = [" (process <PID>)", "/dev/shm", "PLCs", "for the task"];

/// Parts of messages from the operating system and from the parsers of plant files and arguments.
const FOREIGN: [&str; 3] = ["(os error", "unknown field", "expected one of"];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs" || ending == "h") {
            found.push(path);
        }
    }
}

/// Returns the text without the line breaks inside string literals, and without escapes.
fn joined(source: &str) -> String {
    let mut lines = source.split("\\\n");
    let mut text = lines.next().unwrap_or_default().to_owned();
    for line in lines {
        text.push_str(line.trim_start());
    }
    text.replace("\\\"", "\"")
}

/// Returns the fixed parts of a message, without placeholders such as `<NAME>`.
fn fixed_parts(message: &str) -> Vec<String> {
    let mut parts = Vec::new();
    let message = INSERTED.iter().fold(message.to_owned(), |text, inserted| text.replace(inserted, "<>"));
    for piece in message.split('<') {
        let fixed = piece.split_once('>').map_or(piece, |(_, fixed)| fixed);
        parts.push(fixed.trim().to_owned());
    }
    parts.retain(|part| part.len() > 2 && !FOREIGN.iter().any(|foreign| part.contains(foreign)));
    parts
}

/// Returns all sources below `src` that contain messages.
fn source() -> String {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    files.iter().map(|file| joined(&std::fs::read_to_string(file).unwrap())).collect()
}

fn assert_in_source(messages: &[String]) {
    let text = source();
    let parts = messages.iter().flat_map(|message| fixed_parts(message));
    let missing: Vec<_> = parts.filter(|part| !text.contains(part.as_str())).collect();
    assert!(missing.is_empty(), "parts of messages that the source does not have: {missing:#?}");
}

#[test]
fn messages_of_the_troubleshooting_page_are_in_the_source() {
    let page = include_str!("../../docs/guide/troubleshooting.md");
    let blocks = page.split("```text\n").skip(1).filter_map(|rest| rest.split("```").next());
    let messages: Vec<_> = blocks.flat_map(str::lines).map(str::to_owned).collect();
    assert!(messages.len() > 40, "{messages:?}");
    assert_in_source(&messages);
}

/// The tables of errors on that page have examples of messages, with numbers.
#[test]
fn messages_of_the_helics_page_are_in_the_source() {
    let page = include_str!("../../docs/guide/helics.md");
    let sections = page.split("### Errors").skip(1).filter_map(|rest| rest.split("\n### ").next());
    let cells = sections.flat_map(str::lines).filter_map(|line| line.split('|').nth(2));
    let quoted = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2));
    let messages: Vec<_> = quoted
        .filter(|message| !message.starts_with("--"))
        .map(|message| message.replace("5 ms", "<>").replace("30", "<>").replace('1', "<>"))
        .collect();
    assert!(messages.len() >= 9, "{messages:?}");
    assert_in_source(&messages);
}
