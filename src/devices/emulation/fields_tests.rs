//! Tests that each kind has the same fields and the same place in JSON Lines as in the table of
//! `docs/reference/journal.md`.

use super::event_text_tests::{drawn, line, names};
use crate::devices::catalogue;
use crate::journal::EventKind;
use crate::journal::jsonl::{Jsonl, VERSION};
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};

const PAGE: &str = include_str!("../../../docs/reference/journal.md");

/// Fields of every line.
const ALWAYS: [&str; 4] = ["v", "seq", "time_us", "kind"];
/// Words that do not depend on the kind of the event: the latency, and words that say more than numbers do.
const NOT_OF_THE_KIND: [&str; 2] = ["latency_us", "text"];
/// Words that need octets or a text, with the prefix of their kind. The numbers of an event contain neither
/// octets nor texts.
const OF_OCTETS: [(&str, &str); 3] = [("dp_", "service"), ("dp_", "data"), ("finding", "note")];

/// Row of the table for one kind.
struct Row {
    source: &'static str,
    fields: &'static str,
}

fn rows() -> BTreeMap<&'static str, Row> {
    let table = PAGE.split("| Kind | Source |").nth(1).unwrap().split("\n\n").next().unwrap();
    let mut rows = BTreeMap::new();
    for line in table.lines().skip(2) {
        let cells: Vec<_> = line.split('|').map(str::trim).collect();
        let [_, kind, source, _, fields, _] = cells[..] else { panic!("{line}") };
        let before = rows.insert(kind.trim_matches('`'), Row { source, fields });
        assert!(before.is_none(), "{kind} is there twice");
    }
    rows
}

/// Returns the words in backticks in a cell: names of fields and values. Leaves out a word after `as`,
/// because it belongs to another table. Adds the words of the kind that the cell names with `as of`.
fn words(cell: &'static str, rows: &BTreeMap<&str, Row>) -> BTreeSet<&'static str> {
    let mut words = BTreeSet::new();
    for clause in cell.split(';') {
        let (own_words, _) = clause.split_once("as `").unwrap_or((clause, ""));
        let (own_words, other) = own_words.split_once("as of `").unwrap_or((own_words, ""));
        words.extend(own_words.split('`').skip(1).step_by(2));
        if let Some(kind) = other.split('`').next().filter(|kind| !kind.is_empty()) {
            words.extend(self::words(rows[kind].fields, rows));
        }
    }
    words
}

/// Returns the lines of the given kind.
fn lines(kind: &'static EventKind) -> impl Iterator<Item = Map<String, Value>> {
    let records = drawn(kind).iter();
    records.map(|record| serde_json::from_str(&line(Jsonl::new(names(), catalogue()), record)).unwrap())
}

/// Names end with the unit. Values with a unit are whole numbers, and octets are pairs of digits.
fn check_value(kind: &str, name: &str, value: &Value) {
    let is_whole = value.is_u64() || value.is_i64();
    assert!(!value.is_f64() && !value.is_array() && !value.is_object(), "{kind}: {name} is {value}");
    match name.rsplit_once('_') {
        Some((_, "us" | "s" | "errors")) => assert!(is_whole, "{kind}: {name} is {value}"),
        Some((_, "ms" | "ns")) => panic!("{kind}: {name}, but times are in microseconds"),
        _ => {}
    }
    if name == "data" {
        let octets = value.as_str().unwrap();
        assert!(
            octets.len().is_multiple_of(2) && octets.chars().all(|it| it.is_ascii_hexdigit()),
            "{kind}: {octets}"
        );
    }
    if matches!(name, "id" | "width" | "slave" | "fault" | "guest" | "length" | "octets") {
        assert!(is_whole, "{kind}: {name} is {value}");
    }
}

#[test]
fn the_page_lists_every_kind_once() {
    let (rows, kinds) = (rows(), catalogue().kinds.iter().map(|kind| kind.name()).collect::<BTreeSet<_>>());
    assert_eq!(rows.keys().copied().collect::<BTreeSet<_>>(), kinds);
}

#[test]
fn each_kind_has_the_fields_of_its_row_and_no_others() {
    let (rows, mut wrong) = (rows(), Vec::new());
    for kind in &catalogue().kinds {
        let (name, row) = (kind.name(), &rows[kind.name()]);
        let words = words(row.fields, &rows);
        let (mut fields, mut values) = (BTreeSet::new(), BTreeSet::new());
        for line in lines(kind) {
            for (field, value) in line.iter().filter(|(field, _)| !ALWAYS.contains(&field.as_str())) {
                check_value(name, field, value);
                values.extend(value.as_str().map(|it| it.trim_end_matches(char::is_numeric).to_owned()));
                fields.insert(field.clone());
            }
        }
        let place: &[&str] = match row.source {
            "bus" => &["bus"],
            "plc" | "PLC" => &["plc"],
            "node" => &["plc", "node"],
            "bus or node" => &["bus", "plc", "node"],
            other => panic!("{name} has the source {other}"),
        };
        for field in place.iter().filter(|field| !fields.contains(**field)) {
            wrong.push(format!("{name} has no {field}, but its source is {}", row.source));
        }
        for field in fields.iter().filter(|field| !place.contains(&field.as_str())) {
            if !words.contains(field.as_str()) {
                wrong.push(format!("{name} has {field}, which the page does not have"));
            }
        }
        let needs_octets = |word| OF_OCTETS.iter().any(|it| name.starts_with(it.0) && it.1 == word);
        let words = words.into_iter().filter(|word| !NOT_OF_THE_KIND.contains(word));
        for word in words.filter(|word| !needs_octets(*word)) {
            if !fields.contains(word) && !values.contains(word.trim_end_matches(char::is_numeric)) {
                wrong.push(format!("the page has {word} at {name}, which never has it"));
            }
        }
    }
    assert!(wrong.is_empty(), "docs/reference/journal.md and the lines differ:\n{}", wrong.join("\n"));
}

/// The format needs a new version if a field is removed or gets another type. If kinds and fields are only
/// added, it needs no new version.
#[test]
fn fields_of_lines_are_only_added() {
    let mut fields = BTreeSet::new();
    for kind in &catalogue().kinds {
        for (field, value) in lines(kind).flatten() {
            let ty = match value {
                Value::Null => continue,
                Value::Bool(_) => "boolean",
                Value::Number(_) => "number",
                Value::String(_) => "text",
                Value::Array(_) | Value::Object(_) => "structure",
            };
            fields.insert(format!("{}.{field}: {ty}\n", kind.name()));
        }
    }
    let text: String = fields.into_iter().collect();
    crate::format_samples::assert_only_added(&format!("journal-{VERSION}.fields"), "VERSION", &text);
}
