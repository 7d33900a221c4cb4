//! Formats records for people, one line per record.

use super::{Catalogue, Format, Names, Reader, Record, Source};
use crate::plural::plural;
use std::fmt::Write;

/// Writes records as lines of text: time, source, event.
pub struct Text {
    reader: Reader,
    /// Width of the column of sources.
    width: usize,
}

impl Text {
    /// Returns a writer with these names.
    pub fn new(names: Names, catalogue: &'static Catalogue) -> Self {
        let nodes = names.plcs.iter().map(|name| name.len() + ":node1".len());
        let width = nodes.chain(names.buses.iter().map(String::len)).max().unwrap_or(0);
        Text { reader: Reader::new(names, catalogue), width }
    }

    /// Returns the line of the next record, without time and source.
    pub(crate) fn description(&mut self, record: &Record) -> String {
        let mut text = self.event(record);
        // Writing to a String cannot fail.
        if let Some(latency) = record.latency_us {
            let _ = write!(text, ", answered after {latency} us");
        }
        if record.count > 1 {
            let (count, period) = (record.count, record.period_us);
            let since = seconds(record.first_us());
            let _ = write!(text, ", {count} times every {period} us since {}", since.trim_start());
        }
        if record.may_continue() {
            text.push_str(", going on");
        }
        text
    }

    /// Returns the text of the event alone, without latency and repetitions.
    pub(super) fn event(&mut self, record: &Record) -> String {
        self.reader.observe(record);
        record.event.text(&mut self.reader)
    }

    /// Appends a line of the output.
    pub(super) fn line(&self, time_us: u64, source: Source, description: &str, out: &mut String) {
        let source = self.reader.names.source(source);
        let width = self.width;
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{}  {source:width$}  {description}", seconds(time_us));
    }
}

impl Format for Text {
    fn record(&mut self, record: &Record, out: &mut String) {
        let description = self.description(record);
        self.line(record.time_us, record.event.source(), &description, out);
    }

    fn skip(&mut self, record: &Record) {
        self.reader.observe(record);
    }

    fn gap(&mut self, lost: u64, out: &mut String) -> bool {
        self.reader.gap();
        let _ = writeln!(out, "-- {} lost here --", plural(lost, "record"));
        true
    }
}

/// `    12.345678 s`
pub(super) fn seconds(us: u64) -> String {
    format!("{:>6}.{:06} s", us / 1_000_000, us % 1_000_000)
}
