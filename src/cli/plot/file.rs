//! A journal file written by `commram trace --format jsonl`.

use crate::cli::error::CliError;
use crate::input_file;
use crate::journal::jsonl::VERSION;
use crate::journal::{Past, Window};
use crate::memory::Width;
use core::ops::RangeInclusive;
use serde::Deserialize;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Maximum number of events of counted records in a plot. The first and last event of each record are not included in
/// this number.
const MOST_COUNTED: u64 = 1_000_000;

/// Values that a register of 4 bytes can have.
const RANGE: RangeInclusive<i64> = i32::MIN as i64..=u32::MAX as i64;

/// The reason why a text is not a readable journal.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
enum JournalFileError {
    /// The text has no lines.
    #[error("it is empty; a journal with records is written by `commram trace --format jsonl`")]
    Empty,
    /// A line is not a record.
    #[error("line {line}: {reason}; such a journal is written by `commram trace --format jsonl`")]
    NoRecord {
        /// Number of the line, from 1.
        line: usize,
        /// The error of the parser.
        reason: String,
    },
    /// Another version of commram has written the record.
    #[error(
        "line {line}: the record has format {found}, this commram ({ours}) reads format {VERSION}; use the commram that \
         has written it, or write the journal again with this one (`commram trace --format jsonl`)",
        ours = env!("CARGO_PKG_VERSION")
    )]
    OtherVersion {
        /// Number of the line, from 1.
        line: usize,
        /// Number of the format that the record names.
        found: u64,
    },
    /// A value that no register can have.
    #[error("line {line}: {value} is no value of a register; registers have 1, 2 or 4 bytes")]
    NoValue {
        /// Number of the line, from 1.
        line: usize,
        /// The value as the file contains it.
        value: serde_json::Value,
    },
    /// A value has more bytes than its register.
    #[error("line {line}: {value} does not fit into {address}")]
    TooWide {
        /// Number of the line, from 1.
        line: usize,
        /// Value that the register cannot have.
        value: i64,
        /// Address of the register, which determines the largest value.
        address: String,
    },
    /// The counted records have more events than a plot can have.
    #[error(
        "line {line}: with this counted record the plot has more than {MOST_COUNTED} counted events; commram writes no \
         such journal, because equal events of the same time are in one record"
    )]
    TooMany {
        /// Number of the line, from 1.
        line: usize,
    },
}

/// The register values in a journal file.
pub(super) struct RecordedRegisters {
    path: PathBuf,
    /// The last time in the file, in microseconds.
    pub end_us: u64,
    /// SYNC edges of the journal, as runs of equal distances.
    edges: Vec<Run>,
    /// History of each register. The keys are the PLC and the address.
    registers: BTreeMap<(String, String), Vec<Run>>,
    /// Number of events of counted records that can still be added to the plot.
    spare: Cell<u64>,
}

/// The events that one line records.
struct Run {
    /// Number of the line, from 1.
    line: usize,
    /// Time of the last event in microseconds.
    last_us: u64,
    count: u64,
    /// Interval between the events in microseconds; 0 for a single event.
    period_us: u64,
    /// Value of the register, as a number of its type.
    value: i64,
    /// True if every change of the register is recorded.
    is_recorded: bool,
}

/// The fields of a line that plots use. Records of other kinds have further fields.
#[derive(Deserialize)]
struct Line {
    v: u64,
    kind: String,
    #[serde(default)]
    time_us: u64,
    count: Option<u64>,
    period_us: Option<u64>,
    plc: Option<String>,
    address: Option<String>,
    to: Option<serde_json::Value>,
    value: Option<serde_json::Value>,
    answer: Option<serde_json::Value>,
}

/// Fields that the lines have in all versions.
#[derive(Deserialize)]
struct Versioned {
    v: u64,
}

impl Line {
    /// Parses a line of a journal file; `line` is its number for errors.
    fn parse(line: usize, text: &str) -> Result<Self, JournalFileError> {
        let read = serde_json::from_str::<Self>(text);
        // Lines of another version may have other fields.
        let found = match &read {
            Ok(read) => Some(read.v),
            Err(_) => serde_json::from_str::<Versioned>(text).ok().map(|it| it.v),
        };
        match found.filter(|found| *found != u64::from(VERSION)) {
            Some(found) => Err(JournalFileError::OtherVersion { line, found }),
            None => read.map_err(|error| JournalFileError::NoRecord { line, reason: error.to_string() }),
        }
    }

    /// Returns the new value of the register, and true if the journal records every change of this register.
    fn value(&self, line: usize) -> Result<Option<(i64, bool)>, JournalFileError> {
        let (value, is_recorded) = match self.kind.as_str() {
            "changed" => (&self.to, true),
            "register" | "state" => (&self.to, false),
            "channel_write" => (&self.value, false),
            "handshake" => (&self.answer, false),
            _ => return Ok(None),
        };
        let Some(value) = value else { return Ok(None) };
        let number = value.as_i64().filter(|number| RANGE.contains(number));
        let number = number.ok_or_else(|| JournalFileError::NoValue { line, value: value.clone() })?;
        Ok(Some((number, is_recorded)))
    }

    /// Returns the events that the record counts.
    fn run(&self, line: usize, (value, is_recorded): (i64, bool)) -> Run {
        let (count, period_us) = (self.count.unwrap_or(1), self.period_us.unwrap_or(0));
        Run { line, last_us: self.time_us, count, period_us, value, is_recorded }
    }
}

impl RecordedRegisters {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or is not a journal.
    pub(super) fn read(path: &Path) -> Result<Self, CliError> {
        let wrong = |reason| CliError::Unreadable { path: path.to_owned(), reason };
        let text = input_file::read(path, input_file::LONGEST).map_err(|error| wrong(error.to_string()))?;
        let read = Self::parse(&text).map_err(|error| wrong(error.to_string()))?;
        Ok(Self { path: path.to_owned(), ..read })
    }

    fn parse(text: &str) -> Result<Self, JournalFileError> {
        let mut journal_data = RecordedRegisters {
            path: PathBuf::new(),
            end_us: 0,
            edges: Vec::new(),
            registers: BTreeMap::new(),
            spare: Cell::new(MOST_COUNTED),
        };
        if text.is_empty() {
            return Err(JournalFileError::Empty);
        }
        for (number, line) in (1..).zip(text.lines()) {
            let line = Line::parse(number, line)?;
            journal_data.end_us = journal_data.end_us.max(line.time_us);
            if line.kind == "sync" {
                journal_data.edges.push(line.run(number, (0, false)));
            }
            if let (Some(plc), Some(address), Some(value)) = (&line.plc, &line.address, line.value(number)?) {
                let runs = journal_data.registers.entry((plc.clone(), address.clone())).or_default();
                runs.push(line.run(number, value));
            }
        }
        Ok(journal_data)
    }

    /// Returns the events of these lines in the window, sorted by time. The lines themselves are not sorted: a counted
    /// record is written at the end of its count.
    fn unfold<'a>(
        &self,
        runs: impl IntoIterator<Item = &'a Run>,
        window: Window,
    ) -> Result<Vec<(u64, &'a Run)>, CliError> {
        let mut events = Vec::new();
        for run in runs {
            let times = window.times(run.last_us, run.count, run.period_us);
            // The first and the last event of a line are always in the plot. Only the events between them count towards
            // the limit.
            let more = (times.size_hint().0 as u64).saturating_sub(2);
            let spare = self.spare.get().checked_sub(more);
            self.spare.set(spare.ok_or_else(|| self.wrong(&JournalFileError::TooMany { line: run.line }))?);
            events.extend(times.map(|time| (time, run)));
        }
        events.sort_by_key(|(time, _)| *time);
        Ok(events)
    }

    /// Returns the times of the SYNC edges in the window, ascending, in microseconds.
    ///
    /// # Errors
    /// The counted records have too many events.
    pub(super) fn edges(&self, window: Window) -> Result<Vec<u64>, CliError> {
        let mut edges: Vec<_> = self.unfold(&self.edges, window)?.into_iter().map(|(time, _)| time).collect();
        edges.dedup();
        Ok(edges)
    }

    fn wrong(&self, reason: &JournalFileError) -> CliError {
        CliError::Unreadable { path: self.path.clone(), reason: reason.to_string() }
    }

    /// Returns the values of the register at `address`.
    fn past(&self, runs: &[Run], address: &str, width: Width, window: Window) -> Result<Past, CliError> {
        let mask = width.max_value();
        // A negative number is a value of a signed type.
        let range = -i64::from(mask / 2) - 1..=i64::from(mask);
        if let Some(Run { line, value, .. }) = runs.iter().find(|run| !range.contains(&run.value)) {
            return Err(self.wrong(&JournalFileError::TooWide {
                line: *line,
                value: *value,
                address: address.to_owned(),
            }));
        }
        let is_recorded = runs.iter().any(|run| run.is_recorded);
        let mut values: Vec<(u64, u32)> = Vec::new();
        for (time, run) in self.unfold(runs.iter().filter(|run| run.is_recorded == is_recorded), window)? {
            // The cast keeps the low bits of the two's complement.
            let bits = run.value as u32 & mask;
            if values.last().is_none_or(|(_, before)| *before != bits) {
                values.push((time, bits));
            }
        }
        Ok(Past { values, is_recorded })
    }

    /// Returns the history of a register; it is empty if the file does not mention the register.
    ///
    /// # Errors
    /// The journal contains this address for several PLCs and the user named none, a value does not fit into the
    /// register, or the counted records have too many events.
    pub(super) fn register(
        &self,
        plc: Option<&str>,
        address: &str,
        width: Width,
        text: &str,
        window: Window,
    ) -> Result<Past, CliError> {
        let is_it = |(of, at): &(String, String)| at == address && plc.is_none_or(|plc| plc == of);
        let mut found = self.registers.iter().filter(|(register, _)| is_it(register));
        match (found.next(), found.next()) {
            (None, _) => Ok(Past::default()),
            (Some((_, runs)), None) => self.past(runs, address, width, window),
            (Some(((one, _), _)), Some(((other, _), _))) => {
                let right = format!(
                    "the journal contains this register for several PLCs; write {one}:{text} or {other}:{text}"
                );
                Err(CliError::Argument { text: text.to_owned(), right })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINES: &str = r#"{"v":1,"seq":0,"time_us":0,"kind":"board","plc":"line","what":"up","text":"up"}
{"v":1,"seq":1,"time_us":100,"kind":"channel_write","plc":"line","register":"a","address":"%MB3.5","width":1,"value":5}
{"v":1,"seq":2,"time_us":900,"kind":"handshake","plc":"line","node":2,"address":"%MB3.5","request":5,"answer":4,"count":3,"period_us":200,"first_us":500}
{"v":1,"seq":3,"time_us":50,"kind":"changed","plc":"line","address":"%MB3.6","from":0,"to":7}
{"v":1,"seq":4,"time_us":60,"kind":"channel_write","plc":"line","address":"%MB3.6","value":7}
{"v":1,"kind":"gap","lost":868}
{"v":1,"seq":900,"time_us":4000,"kind":"sync","bus":"drives","count":2,"period_us":2000,"first_us":2000}
{"v":1,"seq":901,"time_us":4100,"kind":"changed","plc":"other","address":"%MB3.6","from":0,"to":9}
"#;

    /// A change of a field that this reader uses needs a new version of the format. The sample of the old version must
    /// then be kept, too.
    #[test]
    fn a_sample_of_the_format_can_be_read() {
        let bytes =
            crate::format_samples::sample(&format!("journal-{VERSION}.jsonl"), || LINES.as_bytes().to_vec());
        let journal_data = RecordedRegisters::parse(core::str::from_utf8(&bytes).unwrap()).unwrap();
        assert_eq!((journal_data.edges(Window::ALL).unwrap(), journal_data.end_us), (vec![2000, 4000], 4100));
        assert_eq!(
            journal_data.register(None, "%MB3.5", Width::Byte, "a", Window::ALL).unwrap().values,
            [(100, 5), (500, 4)]
        );
    }

    #[test]
    fn other_versions_are_refused_by_their_number() {
        for (text, line, found) in [
            ("{\"v\":0,\"kind\":\"x\"}", 1, 0),
            ("{\"v\":1,\"kind\":\"x\"}\n{\"v\":2,\"kind\":\"x\"}", 2, 2),
            // A later version may have other fields.
            ("{\"v\":99,\"kind\":7,\"time\":[]}", 1, 99),
        ] {
            let error = RecordedRegisters::parse(text).err().unwrap();
            assert_eq!(error, JournalFileError::OtherVersion { line, found });
            let words = format!(
                "line {line}: the record has format {found}, this commram ({}) reads format 1; use the commram that has \
                 written it, or write the journal again with this one (`commram trace --format jsonl`)",
                env!("CARGO_PKG_VERSION")
            );
            assert_eq!(error.to_string(), words);
        }
    }

    #[test]
    fn counted_records_of_a_journal_are_expanded() {
        let journal_data = RecordedRegisters::parse(LINES).unwrap();
        assert_eq!((journal_data.edges(Window::ALL).unwrap(), journal_data.end_us), (vec![2000, 4000], 4100));
        let five = journal_data.register(None, "%MB3.5", Width::Byte, "a", Window::ALL).unwrap();
        assert_eq!(five.values, [(100, 5), (500, 4)]);
        assert!(!five.is_recorded);
        let six = journal_data.register(Some("line"), "%MB3.6", Width::Byte, "a", Window::ALL).unwrap();
        assert_eq!((six.values.as_slice(), six.is_recorded), (&[(50, 7)][..], true));
        assert!(
            journal_data
                .register(None, "%MB3.6", Width::Byte, "a", Window::ALL)
                .unwrap_err()
                .to_string()
                .contains("line:a or other:a")
        );
        assert_eq!(
            journal_data.register(None, "%MB3.7", Width::Byte, "a", Window::ALL).unwrap(),
            Past::default()
        );
    }

    #[test]
    fn a_value_that_its_register_cannot_have_is_refused_by_its_line() {
        let line = |kind: &str, key: &str, value: &str| {
            format!(
                "{{\"v\":1,\"kind\":\"{kind}\",\"plc\":\"a\",\"address\":\"%MB3.5\",\"{key}\":{value}}}\n"
            )
        };
        let fits = line("changed", "to", "255");
        for (kind, key) in [
            ("changed", "to"),
            ("register", "to"),
            ("state", "to"),
            ("channel_write", "value"),
            ("handshake", "answer"),
        ] {
            for value in ["256", "-129"] {
                let wide = RecordedRegisters::parse(&(fits.clone() + &line(kind, key, value))).unwrap();
                let message =
                    wide.register(None, "%MB3.5", Width::Byte, "a", Window::ALL).unwrap_err().to_string();
                assert!(message.contains(&format!("line 2: {value} does not fit into %MB3.5")), "{message}");
            }
            let negative = RecordedRegisters::parse(&line(kind, key, "-2")).unwrap();
            let past = negative.register(None, "%MB3.5", Width::Byte, "a", Window::ALL).unwrap();
            assert_eq!(past.values, [(0, 254)], "a number of a signed type");
            for value in ["18446744073709551615", "4294967296", "-2147483649", "1.5", "\"5\""] {
                let message = RecordedRegisters::parse(&(fits.clone() + &line(kind, key, value)))
                    .err()
                    .unwrap()
                    .to_string();
                assert!(message.contains(&format!("line 2: {value} is no value of a register")), "{message}");
            }
        }
        let whole = RecordedRegisters::parse(&fits).unwrap();
        assert_eq!(whole.register(None, "%MB3.5", Width::Byte, "a", Window::ALL).unwrap().values, [(0, 255)]);
    }

    #[test]
    fn what_is_no_journal_is_refused_by_its_line() {
        for (text, message) in [("hello", "line 1: "), ("{\"v\":1,\"kind\":\"x\"}\n{}", "line 2: ")] {
            let error = RecordedRegisters::parse(text).err().unwrap().to_string();
            assert!(error.contains(message) && error.contains("--format jsonl"), "{error}");
        }
    }
}
