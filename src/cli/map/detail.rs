//! Detailed description of one register.

use super::entry::Entry;
use crate::cli::table;
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
    let line = |name: &str, value: String| vec![format!("  {name}"), value];
    let mut lines = vec![
        line("meaning", entry.meaning.to_owned()),
        line("address", address(entry)),
        line("type", entry.ty.clone()),
        line("owner", entry.owner.clone()),
        line("reset value", entry.reset.clone()),
        line("structure", entry.structure.to_owned()),
        line("manual", format!("{} p. {}", device.manual, entry.page)),
    ];
    for (fact, source) in entry.provenance.all() {
        lines.push(line(&format!("{} from", fact.replace('_', " ")), source.clone()));
    }
    if !entry.used.is_empty() {
        lines.push(line("elements", format!("{} used, the others reserved", entry.used)));
    }
    if entry.reserved {
        lines.push(line("reserved", "yes".to_owned()));
    }
    let has_meaning = !entry.values.is_empty() || !entry.bits.is_empty();
    if has_meaning && !entry.meaning_page.is_empty() {
        lines.push(line("values, bits", format!("{} p. {}", device.manual, entry.meaning_page)));
    }
    let mut text = format!("{}\n{}", entry.name, table::columns(&lines));
    let described = |meaning: &str, source: &str| match source {
        "manual" => meaning.to_owned(),
        other => format!("{meaning} ({other})"),
    };
    let values = entry
        .values
        .iter()
        .map(|value| vec![format!("    {}", value.hex), described(&value.meaning, &value.provenance)]);
    section(&mut text, "values", &values.collect::<Vec<_>>());
    let bits = entry.bits.iter().map(|bit| {
        let range =
            if bit.first == bit.last { bit.first.to_string() } else { format!("{}-{}", bit.first, bit.last) };
        vec![format!("    {range}"), bit.name.to_owned(), described(&bit.meaning, &bit.provenance)]
    });
    section(&mut text, "bits", &bits.collect::<Vec<_>>());
    text
}

fn section(text: &mut String, head: &str, lines: &[Vec<String>]) {
    if !lines.is_empty() {
        text.push_str(&format!("  {head}\n{}", table::columns(lines)));
    }
}
