//! `commram trace --format csv`: one row per record, for spreadsheets and data frames.

use crate::export::csv_line;
use crate::journal::jsonl::Jsonl;
use crate::journal::text::Text;
use crate::journal::{Catalogue, Format, Names, Record};
use crate::plural::plural;
use serde_json::{Value, json};

/// Fields of jsonl with separate columns.
const FIELDS: [&str; 12] = [
    "seq",
    "time_us",
    "count",
    "period_us",
    "kind",
    "bus",
    "plc",
    "node",
    "register",
    "address",
    "value",
    "latency_us",
];
/// Columns after those of `FIELDS`: the line of the text format without time and source, and the remaining fields of
/// jsonl as an object.
const OTHERS: [&str; 2] = ["description", "fields"];

/// Writes records as comma-separated values (RFC 4180) with a head line.
pub(super) struct Csv {
    lines: Jsonl,
    text: Text,
}

impl Csv {
    /// Creates a writer with these names.
    pub(super) fn new(names: Names, catalogue: &'static Catalogue) -> Self {
        Self { lines: Jsonl::new(names.clone(), catalogue), text: Text::new(names, catalogue) }
    }
}

impl Format for Csv {
    fn begin(&self, out: &mut String) {
        out.push_str(&csv_line(&[&FIELDS[..], &OTHERS].concat()));
    }

    fn record(&mut self, record: &Record, out: &mut String) {
        let fields = serde_json::to_value(self.lines.line(record)).unwrap_or_default();
        out.push_str(&row(fields, self.text.description(record)));
    }

    fn skip(&mut self, record: &Record) {
        self.text.skip(record);
        self.lines.skip(record);
    }

    fn gap(&mut self, lost: u64, out: &mut String) -> bool {
        // The text writer must know about the gap, too, because names in later records may depend on it. Its own line
        // about the gap is dropped.
        self.text.gap(lost, &mut String::new());
        self.lines.gap(lost, &mut String::new());
        let fields = json!({"kind": "gap", "lost": lost});
        out.push_str(&row(fields, format!("{} lost here", plural(lost, "record"))));
        true
    }
}

/// Formats the fields of jsonl as a row.
fn row(fields: Value, description: String) -> String {
    let Value::Object(mut fields) = fields else { return String::new() };
    fields.remove("v");
    // The column `description` contains the same text.
    fields.remove("text");
    let mut cells: Vec<_> =
        FIELDS.iter().map(|name| fields.remove(*name).map_or_else(String::new, cell)).collect();
    cells.push(description);
    cells.push(if fields.is_empty() { String::new() } else { Value::Object(fields).to_string() });
    csv_line(&cells)
}

fn cell(value: Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::String(text) => text,
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_without_a_column_are_an_object() {
        let fields = json!({
            "v": 1, "seq": 1, "time_us": 500, "kind": "state", "plc": "line", "node": 2, "from": 1, "text": "x", "latency_us": 500,
        });
        assert_eq!(
            row(fields, "a, b".to_owned()),
            "1,500,,,state,,line,2,,,,500,\"a, b\",\"{\"\"from\"\":1}\"\n"
        );
        assert_eq!(
            row(json!({"v": 1, "kind": "gap", "lost": 7}), "x".to_owned()),
            ",,,,gap,,,,,,,,x,\"{\"\"lost\"\":7}\"\n"
        );
    }
}
