//! The tables of operations and replies: `docs/reference/channel.md`, and a sample of each.

use super::WIRE_VERSION;
use super::format_tests::ops as samples;
use crate::request::ops::ops;
use crate::request::replies::replies;
use crate::request::{MAX_ADVANCE_US, MAX_RANGE, MAX_SPEED, Op};
use std::fmt::Write;

/// If this variable has any value, the test writes the table of the page again.
const UPDATE: &str = "COMMRAM_UPDATE_OPERATIONS";
const PAGE: &str = "docs/reference/channel.md";
const HEAD: &str = "| `kind` | Name | What it does | Columns | Answer |\n|---:|---|---|---|---|\n";

struct Row {
    number: u16,
    name: &'static str,
    class: &'static str,
    reply: &'static str,
    text: String,
    fields: Vec<Field>,
}

struct Field {
    name: &'static str,
    columns: &'static [&'static str],
    most: Option<u64>,
}

macro_rules! rows {
    ($(
        $(#[doc = $doc:literal])*
        $op:ident = $number:literal, $name:ident, $class:ident -> $reply:ident
        $({$(
            $(#[$field_doc:meta])*
            $field:ident: $type:ty $([..=$most:ident, $code:ident])? => $($column:ident)+
        ),+ $(,)?})?
    ),+ $(,)?) => {
        fn rows() -> Vec<Row> {
            vec![$(Row {
                number: $number,
                name: stringify!($name),
                class: stringify!($class),
                reply: stringify!($reply),
                text: [$($doc.trim()),*].join(" "),
                fields: vec![$($(Field {
                    name: stringify!($field),
                    columns: &[$(stringify!($column)),+],
                    most: [$($most as u64)?].first().copied(),
                }),+)?],
            }),+]
        }
    };
}

ops!(rows);

/// Number and name of each reply.
macro_rules! numbers {
    ($(
        $(#[$doc:meta])*
        $reply:ident = $number:literal, $name:ident $(($($one:tt)*))? $({$($fields:tt)*})?
    ),+ $(,)?) => {
        fn reply_numbers() -> Vec<(u16, &'static str)> {
            vec![$(($number, stringify!($reply))),+]
        }
    };
}

replies!(numbers);

fn field_text(field: &Field) -> String {
    let mut text = format!("`{}`", field.name);
    match field.columns {
        [column] if *column == field.name => {}
        [_, _, _, _, _, ..] => text += " in all others",
        columns => {
            let columns: Vec<_> = columns.iter().map(|column| format!("`{column}`")).collect();
            write!(text, " in {}", columns.join(", ")).unwrap();
        }
    }
    if let Some(most) = field.most {
        write!(text, ", at most {most}").unwrap();
    }
    text
}

fn table() -> String {
    let mut rows = rows();
    rows.sort_by_key(|row| row.number);
    let mut text = HEAD.to_owned();
    for Row { number, name, reply, text: does, fields, .. } in &rows {
        let fields: Vec<_> = fields.iter().map(field_text).collect();
        let (reply, _) = reply_numbers().into_iter().find(|(_, known)| known == reply).unwrap();
        let fields = if fields.is_empty() { String::new() } else { format!(" {}", fields.join("; ")) };
        writeln!(text, "| {number} | `{name}` | {does} |{fields} | {reply} |").unwrap();
    }
    text
}

#[test]
fn the_channels_page_has_the_table_of_operations() {
    crate::check_table_of_page(PAGE, HEAD, &table(), UPDATE);
}

/// An operation without fields is its name, any other one an object with that name.
#[test]
fn json_uses_the_names_of_the_table() {
    for Row { name, fields, .. } in rows() {
        let text = if fields.is_empty() { format!("\"{name}\"") } else { format!("{{\"{name}\":{{}}}}") };
        match serde_json::from_str::<Op>(&text) {
            // `fault_clear` is also valid without its field: it then clears all faults.
            Ok(_) => assert!(fields.is_empty() || name == "fault_clear", "{name}"),
            Err(error) => assert!(error.to_string().starts_with("missing field"), "{name}: {error}"),
        }
    }
    let error = serde_json::from_str::<Op>(r#"{"advance":{"us":5,"ms":5}}"#).unwrap_err();
    assert!(error.to_string().starts_with("unknown field `ms`"), "{error}");
}

#[test]
fn numbers_and_names_are_unique() {
    let mut numbers: Vec<_> = rows().iter().map(|row| row.number).collect();
    let mut names: Vec<_> = rows().iter().map(|row| row.name).collect();
    numbers.sort_unstable();
    names.sort_unstable();
    assert!(numbers.is_sorted_by(|a, b| a < b), "{numbers:?}");
    assert!(names.is_sorted_by(|a, b| a < b), "{names:?}");
}

#[test]
fn a_field_above_its_range_is_refused_by_its_name() {
    let limited = |row: Row| row.fields.into_iter().filter_map(move |it| Some((row.name, it.name, it.most?)));
    for (name, field, most) in rows().into_iter().flat_map(limited) {
        let mut samples = samples().into_iter().map(|(_, op)| serde_json::json!(op));
        let sample = samples.find(|sample| sample.get(name).is_some()).unwrap();
        let with = |value: u64| {
            let mut sent = sample.clone();
            sent[name][field] = value.into();
            serde_json::from_value::<Op>(sent).unwrap().check_ranges()
        };
        assert_eq!(with(most), Ok(()));
        let expected = format!("`{field}` of `{name}` is {}; it may be 0 to {most}", most + 1);
        assert_eq!(with(most + 1).unwrap_err().to_string(), expected);
    }
}

/// Returns numbers in a text: `5, 6 or 7`.
fn numbers_in(text: &str) -> Vec<u16> {
    let words = text.split(|c: char| !c.is_ascii_digit());
    words.filter(|word| !word.is_empty()).map(|word| word.parse().unwrap()).collect()
}

/// The table of replies names each reply, and the operations that it answers.
#[test]
fn the_channels_page_has_the_replies() {
    let page = include_str!("../../../docs/reference/channel.md");
    let (_, table) = page.split_once("| `kind` | Answer to | Content |\n").unwrap();
    let (table, _) = table.split_once("\n\n").unwrap();
    let mut documented: Vec<(u16, u16)> = Vec::new();
    let mut listed = Vec::new();
    for row in table.lines().skip(1) {
        let cells: Vec<_> = row.split('|').map(str::trim).collect();
        let reply = cells[1].parse().unwrap();
        documented.extend(numbers_in(cells[2]).into_iter().map(|operation| (reply, operation)));
        listed.push(reply);
    }
    let reply_of = |row: &Row| reply_numbers().into_iter().find(|(_, name)| *name == row.reply).unwrap().0;
    let mut expected: Vec<_> = rows().iter().map(|row| (reply_of(row), row.number)).collect();
    documented.sort_unstable();
    expected.sort_unstable();
    assert_eq!(documented, expected);
    listed.dedup();
    listed.sort_unstable();
    let mut known: Vec<_> = reply_numbers().into_iter().map(|(number, _)| number).collect();
    known.sort_unstable();
    assert_eq!(listed, known);
}

/// The class of an operation decides whether it may be answered before an earlier request.
#[test]
fn the_channels_page_lists_the_operations_that_only_look() {
    let page = include_str!("../../../docs/reference/channel.md");
    let (_, text) = page.split_once("A request that only reads (kinds ").unwrap();
    let (kinds, _) = text.split_once(')').unwrap();
    let looks = |row: &&Row| row.class == "Looks" && row.name != "stop";
    let mut expected: Vec<_> = rows().iter().filter(looks).map(|row| row.number).collect();
    expected.sort_unstable();
    assert_eq!(numbers_in(kinds), expected);
}

/// `format_tests.rs` compares the bytes of each sample and decodes them. In the file of samples, faults have the names
/// of their kinds.
#[test]
fn each_operation_has_a_sample() {
    let path = format!("{}/tests/formats/channel-{WIRE_VERSION}", env!("CARGO_MANIFEST_DIR"));
    let samples = std::fs::read_to_string(path).unwrap();
    for Row { number, name, .. } in rows() {
        let begin = if name == "fault_add" { "fault ".to_owned() } else { format!("operation {number}.1: ") };
        assert!(samples.lines().any(|line| line.starts_with(&begin)), "{name}");
    }
}
