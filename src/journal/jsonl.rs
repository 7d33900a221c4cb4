//! Formats records for programs, one JSON object per line. `docs/reference/journal.md` describes the fields. New
//! versions of commram may add fields and kinds. They increment `v` only if they change an existing field.

use super::{Catalogue, Fields, Format, Names, Origin, Reader, Record, Source};
use crate::identity::PortNumber;
use serde::Serialize;

/// Version of the format, in every line.
pub(crate) const VERSION: u8 = 1;

/// Writes records as JSON Lines.
pub struct Jsonl {
    reader: Reader,
}

impl Jsonl {
    /// Returns a writer with these names.
    pub fn new(names: Names, catalogue: &'static Catalogue) -> Self {
        Jsonl { reader: Reader::new(names, catalogue) }
    }

    /// Called when records are missing: the states of ports may have changed.
    #[cfg(feature = "cli")]
    pub(crate) fn forget_states(&mut self) {
        self.reader.gap();
    }

    /// Returns the object of the next record.
    pub(crate) fn line(&mut self, record: &Record) -> impl Serialize + use<> {
        self.reader.observe(record);
        let repeated = (record.count > 1).then(|| Repeated {
            count: record.count,
            period_us: record.period_us,
            first_us: record.first_us(),
        });
        Line {
            v: VERSION,
            seq: (!record.is_pending()).then_some(record.seq),
            time_us: record.time_us,
            repeated,
            kind: record.event.kind().name(),
            place: self.place(record.event.source()),
            what: record.event.fields(&mut self.reader),
            latency_us: record.latency_us,
        }
    }

    fn place(&self, source: Source) -> EventLocation {
        let names = &self.reader.names;
        match source {
            Source::Bus(index) => EventLocation::Bus { bus: names.bus(index).into_owned() },
            Source::Plc(index) => EventLocation::Plc { plc: names.plc(index).into_owned() },
            Source::Node(Origin { plc, node }) => {
                EventLocation::Node { plc: names.plc(plc).into_owned(), node }
            }
        }
    }
}

#[derive(Serialize)]
struct Line {
    v: u8,
    seq: Option<u64>,
    time_us: u64,
    #[serde(flatten)]
    repeated: Option<Repeated>,
    kind: &'static str,
    #[serde(flatten)]
    place: EventLocation,
    #[serde(flatten)]
    what: Fields,
    #[serde(skip_serializing_if = "Option::is_none")]
    latency_us: Option<u32>,
}

#[derive(Serialize)]
struct Repeated {
    count: u32,
    period_us: u32,
    first_us: u64,
}

#[derive(Serialize)]
struct Gap {
    v: u8,
    kind: &'static str,
    lost: u64,
}

/// The device or bus of the event.
#[derive(Serialize)]
#[serde(untagged)]
enum EventLocation {
    Bus { bus: String },
    Plc { plc: String },
    Node { plc: String, node: PortNumber },
}

impl Format for Jsonl {
    fn record(&mut self, record: &Record, out: &mut String) {
        write(&self.line(record), out);
    }

    fn skip(&mut self, record: &Record) {
        self.reader.observe(record);
    }

    fn gap(&mut self, lost: u64, out: &mut String) -> bool {
        self.reader.gap();
        write(&Gap { v: VERSION, kind: "gap", lost }, out);
        true
    }
}

fn write(line: &impl Serialize, out: &mut String) {
    // This cannot fail: the object contains only numbers and strings under fixed names.
    out.push_str(&serde_json::to_string(line).unwrap_or_default());
    out.push('\n');
}
