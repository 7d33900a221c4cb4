//! Texts of each kind of event, for users and for programs. `tests/journal/events.txt` contains the agreed
//! texts. `COMMRAM_UPDATE_EVENTS=1` renews the file. Every reader of journals sees a change in this file.

use crate::devices::samples::event_at;
use crate::devices::{all, catalogue};
use crate::journal::jsonl::Jsonl;
use crate::journal::text::Text;
use crate::journal::{EventKind, Format, Names, Record};
use crate::layout::DeviceFit;
use proptest::strategy::{Just, Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::LazyLock;

/// Number of lines that are generated for each kind. Of lines that differ only in numbers, only the first is
/// kept.
const DRAWN: usize = 1000;
const KEPT: usize = 24;

/// Returns a PLC of each device. Its name is a number, as the names of the buses are.
pub(super) fn names() -> Names {
    Names {
        plcs: (0..all().len()).map(|plc| format!("{plc}")).collect(),
        buses: (0..all().len()).map(|bus| format!("{bus}")).collect(),
        devices: all().iter().map(|device| DeviceFit::unknown(device.layout)).collect(),
    }
}

pub(super) fn line(mut format: impl Format, record: &Record) -> String {
    let mut line = String::new();
    format.record(record, &mut line);
    line
}

/// Returns the words of a line, without numbers and octets.
fn shape(line: &str) -> Vec<&str> {
    let words = line.split(|it: char| !it.is_alphanumeric() && it != '_');
    words
        .filter(|word| !word.chars().all(|it| it.is_ascii_hexdigit()) && !word.ends_with(char::is_numeric))
        .collect()
}

/// Returns events of the given kind. They are generated once for all tests, so all tests see equal events.
pub(super) fn drawn(kind: &'static EventKind) -> &'static [Record] {
    static ALL: LazyLock<Vec<Vec<Record>>> =
        LazyLock::new(|| catalogue().kinds.iter().map(|kind| draw(kind)).collect());
    let place = catalogue().kinds.iter().position(|known| known.name() == kind.name());
    &ALL[place.unwrap()]
}

fn draw(kind: &'static EventKind) -> Vec<Record> {
    let events = event_at(Just(kind), (0..all().len() as u16, 0..4_u8));
    let mut runner = TestRunner::deterministic();
    let mut event = || events.new_tree(&mut runner).unwrap().current();
    let record = |event| Record { seq: 7, ..Record::single(1_234_567, event) };
    (0..DRAWN).map(|_| record(event())).collect()
}

fn lines_of(kind: &'static EventKind) -> String {
    let (mut shapes, mut out) = (BTreeSet::new(), format!("# {}\n", kind.name()));
    for record in drawn(kind) {
        let text = line(Text::new(names(), catalogue()), record);
        if shapes.len() < KEPT && shapes.insert(shape(&text).join(" ")) {
            out += &text;
            out += &line(Jsonl::new(names(), catalogue()), record);
            if let Some(carried) = record.event.frame() {
                writeln!(out, "{carried:?}").unwrap();
            }
        }
    }
    out
}

#[test]
fn events_have_the_agreed_texts() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/journal/events.txt");
    let lines: String = catalogue().kinds.iter().map(|kind| lines_of(kind)).collect();
    if std::env::var_os("COMMRAM_UPDATE_EVENTS").is_some() {
        std::fs::write(path, &lines).unwrap();
    }
    let agreed = std::fs::read_to_string(path).unwrap_or_default();
    let differs = lines.lines().zip(agreed.lines()).find(|(is, should)| is != should);
    assert!(
        lines == agreed,
        "the texts of events differ from {path}, first here: {differs:#?}; COMMRAM_UPDATE_EVENTS=1 renews it"
    );
}
