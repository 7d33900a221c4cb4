//! One line per record, for people.

use super::{Catalogue, Format, Names, Reader, Record};
use std::fmt::Write;

/// Writes records as lines of text: time, source, event.
pub struct Text {
    reader: Reader,
    /// Width of the column of sources.
    width: usize,
}

impl Text {
    /// A writer with these names.
    pub fn new(names: Names, catalogue: &'static Catalogue) -> Self {
        let nodes = names.plcs.iter().map(|name| name.len() + ":node1".len());
        let width = nodes.chain(names.buses.iter().map(String::len)).max().unwrap_or(0);
        Text { reader: Reader::new(names, catalogue), width }
    }
}

impl Format for Text {
    fn record(&mut self, record: &Record, out: &mut String) {
        self.reader.observe(record);
        let source = self.reader.names.source(record.event.source());
        let what = record.event.text(&mut self.reader);
        let width = self.width;
        // Writing to a String cannot fail.
        let _ = write!(out, "{}  {source:width$}  {what}", seconds(record.time_us));
        if let Some(latency) = record.latency_us {
            let _ = write!(out, ", answered after {latency} us");
        }
        if record.count > 1 {
            let (count, period) = (record.count, record.period_us);
            let _ = write!(
                out,
                ", {count} times every {period} us since {}",
                seconds(record.first_us()).trim_start()
            );
        }
        if record.goes_on() {
            out.push_str(", going on");
        }
        out.push('\n');
    }

    fn skip(&mut self, record: &Record) {
        self.reader.observe(record);
    }

    fn gap(&mut self, lost: u64, out: &mut String) -> bool {
        self.reader.gap();
        let _ = writeln!(out, "-- {lost} records lost here --");
        true
    }
}

/// `    12.345678 s`
fn seconds(us: u64) -> String {
    format!("{:>6}.{:06} s", us / 1_000_000, us % 1_000_000)
}
