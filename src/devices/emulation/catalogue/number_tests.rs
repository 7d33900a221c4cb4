//! The table of numbers of kinds of records in `docs/internals/architecture.md`.

use super::*;
use std::collections::BTreeMap;
use std::fmt::Write;

/// If this environment variable is set, the test writes the table of the page again.
const UPDATE: &str = "COMMRAM_UPDATE_EVENTS";
const PAGE: &str = "docs/internals/architecture.md";
const HEAD: &str = "| owner | kinds of records with their numbers |\n|---|---|\n";
/// The last number for devices of commram.
const LAST: u8 = 199;

/// Owner and kind of each number.
fn taken() -> BTreeMap<u8, (&'static str, &'static EventKind)> {
    let mut taken = BTreeMap::new();
    for Generic { owner, records, .. } in registrations() {
        for kind in records {
            let (first, known) = *taken.entry(kind.number()).or_insert((owner, *kind));
            // Devices may share the kinds of records of their family.
            let (number, name) = (kind.number(), kind.name());
            assert!(
                core::ptr::eq(known, *kind),
                "{number} is {} of {first} and {name} of {owner}",
                known.name()
            );
        }
    }
    taken
}

/// `3`, or `4 to 9`.
fn range_text(first: u8, last: u8) -> String {
    if first == last { first.to_string() } else { format!("{first} to {last}") }
}

fn table() -> String {
    let taken = taken();
    let mut owners: Vec<&str> = Vec::new();
    taken.values().for_each(|(owner, _)| {
        if !owners.contains(owner) {
            owners.push(owner);
        }
    });
    let mut text = HEAD.to_owned();
    for owner in owners {
        let of_owner = taken.iter().filter(|(_, (of, _))| *of == owner);
        let kinds: Vec<_> =
            of_owner.map(|(number, (_, kind))| format!("{number} `{}`", kind.name())).collect();
        writeln!(text, "| {owner} | {} |", kinds.join(", ")).unwrap();
    }
    let mut free: Vec<(u8, u8)> = Vec::new();
    for number in (1..=LAST).filter(|number| !taken.contains_key(number)) {
        match free.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => free.push((number, number)),
        }
    }
    let free: Vec<_> = free.into_iter().map(|(first, last)| range_text(first, last)).collect();
    writeln!(text, "| free | {} |", free.join(", ")).unwrap();
    writeln!(text, "| devices of other programs | {} |", range_text(LAST + 1, u8::MAX)).unwrap();
    text
}

#[test]
fn the_page_lists_taken_and_free_numbers_of_records() {
    crate::check_table_of_page(PAGE, HEAD, &table(), UPDATE);
}
