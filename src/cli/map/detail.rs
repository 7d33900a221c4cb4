//! Detailed description of one register.

use super::entry::Entry;
use crate::cli::table;
use crate::devices::folder::in_slot;
use crate::layout::DeviceLayout;

/// Returns the address, with the CPU address if it is known.
fn address(entry: &Entry) -> String {
    match entry.cpu_address.as_str() {
        "" => entry.address.clone(),
        cpu => format!("{} (CPU {cpu})", entry.address),
    }
}

/// Formats the description as several lines of text.
pub(crate) fn text(device: &DeviceLayout, entry: &Entry) -> String {
    let mut lines = facts(device, entry);
    lines.extend(sources(entry));
    lines.extend(remarks(device, entry));
    let mut text = format!("{}\n{}", entry.name, table::columns(&lines));
    add_meanings(&mut text, entry);
    text
}

/// Formats the description for a small window: values and bits precede the sources of the facts.
pub(crate) fn text_with_values_first(device: &DeviceLayout, entry: &Entry) -> String {
    let mut lines = facts(device, entry);
    lines.extend(remarks(device, entry));
    let mut text = format!("{}\n{}", entry.name, table::columns(&lines));
    add_meanings(&mut text, entry);
    section(&mut text, "sources", &sources(entry));
    text
}

fn line(name: &str, value: String) -> Vec<String> {
    vec![format!("  {name}"), value]
}

fn facts(device: &DeviceLayout, entry: &Entry) -> Vec<Vec<String>> {
    let mut lines = vec![
        line("meaning", entry.meaning.to_owned()),
        line("address", address(entry)),
        line("type", entry.ty.clone()),
        line("owner", entry.owner.clone()),
        line("reset value", entry.reset.clone()),
        line("structure", entry.structure.to_owned()),
    ];
    if !entry.page.is_empty() {
        lines.push(line("manual", pages(device, entry, entry.page)));
    }
    lines
}

/// Returns pages with their manual. The pages of an option card name the card's manual themselves.
fn pages(device: &DeviceLayout, entry: &Entry, pages: &str) -> String {
    match in_slot::card_of(device, entry.area) {
        Some(_) => format!("p. {pages}"),
        None => format!("{} p. {pages}", device.manual),
    }
}

/// The source of each fact.
fn sources(entry: &Entry) -> Vec<Vec<String>> {
    let sources = entry.provenance.all().iter();
    sources.map(|(fact, source)| line(&format!("{} from", fact.replace('_', " ")), source.clone())).collect()
}

fn remarks(device: &DeviceLayout, entry: &Entry) -> Vec<Vec<String>> {
    let mut lines = Vec::new();
    if !entry.used.is_empty() {
        lines.push(line("elements", format!("{} used, the others reserved", entry.used)));
    }
    if entry.reserved {
        lines.push(line("reserved", "yes".to_owned()));
    }
    let has_meaning = !entry.values.is_empty() || !entry.bits.is_empty();
    if has_meaning && !entry.meaning_page.is_empty() {
        lines.push(line("values, bits", pages(device, entry, entry.meaning_page)));
    }
    lines
}

/// Adds the values and bits that have a meaning.
fn add_meanings(text: &mut String, entry: &Entry) {
    let values = entry.values.iter().map(|value| vec![format!("    {}", value.hex), value.described()]);
    section(text, "values", &values.collect::<Vec<_>>());
    let bits = entry.bits.iter().map(|bit| {
        let range =
            if bit.first == bit.last { bit.first.to_string() } else { format!("{}-{}", bit.first, bit.last) };
        vec![format!("    {range}"), bit.name.to_owned(), bit.described()]
    });
    section(text, "bits", &bits.collect::<Vec<_>>());
}

fn section(text: &mut String, head: &str, lines: &[Vec<String>]) {
    if !lines.is_empty() {
        text.push_str(&format!("  {head}\n{}", table::columns(lines)));
    }
}
