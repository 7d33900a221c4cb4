//! A journal file written by `commram trace --format jsonl`.

use crate::cli::error::CliError;
use crate::input_file;
use crate::journal::Past;
use crate::journal::jsonl::VERSION;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Maximum number of events in one line: a counted record ends after at most one second.
const MOST_TIMES: u64 = 1_000_000;

/// Why a text is no journal that can be read.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
enum JournalFileError {
    /// A line that is no record.
    #[error("line {line}: {reason}; such a journal is written by `commram trace --format jsonl`")]
    NoRecord {
        /// Number of the line, from 1.
        line: usize,
        /// The error of the parser.
        reason: String,
    },
    /// A record that another version of commram has written.
    #[error(
        "line {line}: the record has format {found}, this commram ({ours}) reads format {VERSION}; use the commram that \
         has written it, or write the journal again with this one (`commram trace --format jsonl`)",
        ours = env!("CARGO_PKG_VERSION")
    )]
    OtherVersion {
        /// Number of the line, from 1.
        line: usize,
        /// Its format.
        found: u64,
    },
}

/// The register values in a journal file.
pub(super) struct RecordedRegisters {
    /// SYNC edges, ascending.
    pub edges: Vec<u64>,
    /// The last time in the file, in microseconds.
    pub end_us: u64,
    /// History of each register by PLC and address.
    registers: BTreeMap<(String, String), Past>,
}

/// The fields of a line that matter for plots; records of other kinds have further fields.
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

/// What lines of all versions have.
#[derive(Deserialize)]
struct Versioned {
    v: u64,
}

impl Line {
    /// Reads a line.
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

    /// The new value of the register, and whether every change of this register is recorded.
    fn value(&self) -> Option<(u32, bool)> {
        let (value, is_recorded) = match self.kind.as_str() {
            "changed" => (&self.to, true),
            "register" => (&self.to, false),
            "channel_write" => (&self.value, false),
            "handshake" => (&self.answer, false),
            _ => return None,
        };
        let number = value.as_ref()?.as_u64()?;
        Some((u32::try_from(number).ok()?, is_recorded))
    }

    /// Times of all events that the record counts.
    fn times(&self) -> impl Iterator<Item = u64> + use<> {
        let (count, period) = (self.count.unwrap_or(1).min(MOST_TIMES), self.period_us.unwrap_or(0));
        let last = self.time_us;
        (0..count).rev().map(move |back| last.saturating_sub(back.saturating_mul(period)))
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
        Self::parse(&text).map_err(|error| wrong(error.to_string()))
    }

    fn parse(text: &str) -> Result<Self, JournalFileError> {
        let mut journal_data = RecordedRegisters { edges: Vec::new(), end_us: 0, registers: BTreeMap::new() };
        let mut recorded = BTreeSet::new();
        let mut reported: Vec<((String, String), u64, u32, bool)> = Vec::new();
        for (number, line) in (1..).zip(text.lines()) {
            let line = Line::parse(number, line)?;
            journal_data.end_us = journal_data.end_us.max(line.time_us);
            if line.kind == "sync" {
                journal_data.edges.extend(line.times());
            }
            if let (Some(plc), Some(address), Some((value, is_recorded))) =
                (&line.plc, &line.address, line.value())
            {
                let register = (plc.clone(), address.clone());
                if is_recorded {
                    recorded.insert(register.clone());
                }
                reported.extend(line.times().map(|time| (register.clone(), time, value, is_recorded)));
            }
        }
        journal_data.edges.sort_unstable();
        journal_data.edges.dedup();
        // A counted record appears in the file at the end of its count.
        reported.sort_by_key(|(_, time, ..)| *time);
        for (register, time, value, is_recorded) in reported {
            if is_recorded == recorded.contains(&register) {
                let past = journal_data.registers.entry(register).or_default();
                past.is_recorded = is_recorded;
                if past.values.last().is_none_or(|(_, before)| *before != value) {
                    past.values.push((time, value));
                }
            }
        }
        Ok(journal_data)
    }

    /// Returns the history of a register; it is empty if the file does not mention the register.
    ///
    /// # Errors
    /// Registers of several PLCs have this address, and no PLC was named.
    pub(super) fn register(&self, plc: Option<&str>, address: &str, text: &str) -> Result<Past, CliError> {
        let is_it = |(of, at): &(String, String)| at == address && plc.is_none_or(|plc| plc == of);
        let mut found = self.registers.iter().filter(|(register, _)| is_it(register));
        match (found.next(), found.next()) {
            (None, _) => Ok(Past::default()),
            (Some((_, past)), None) => Ok(past.clone()),
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

    /// A change of what the reader relies on needs a new version, and keeps the sample of the old one.
    #[test]
    fn a_sample_of_the_format_can_be_read() {
        let bytes =
            crate::format_samples::sample(&format!("journal-{VERSION}.jsonl"), || LINES.as_bytes().to_vec());
        let journal_data = RecordedRegisters::parse(core::str::from_utf8(&bytes).unwrap()).unwrap();
        assert_eq!((journal_data.edges.as_slice(), journal_data.end_us), (&[2000, 4000][..], 4100));
        assert_eq!(journal_data.register(None, "%MB3.5", "a").unwrap().values, [(100, 5), (500, 4)]);
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
        assert_eq!((journal_data.edges.as_slice(), journal_data.end_us), (&[2000, 4000][..], 4100));
        let five = journal_data.register(None, "%MB3.5", "a").unwrap();
        assert_eq!(five.values, [(100, 5), (500, 4)]);
        assert!(!five.is_recorded);
        let six = journal_data.register(Some("line"), "%MB3.6", "a").unwrap();
        assert_eq!((six.values.as_slice(), six.is_recorded), (&[(50, 7)][..], true));
        assert!(
            journal_data.register(None, "%MB3.6", "a").unwrap_err().to_string().contains("line:a or other:a")
        );
        assert_eq!(journal_data.register(None, "%MB3.7", "a").unwrap(), Past::default());
    }

    #[test]
    fn what_is_no_journal_is_refused_by_its_line() {
        for (text, message) in [("hello", "line 1: "), ("{\"v\":1,\"kind\":\"x\"}\n{}", "line 2: ")] {
            let error = RecordedRegisters::parse(text).err().unwrap().to_string();
            assert!(error.contains(message) && error.contains("--format jsonl"), "{error}");
        }
    }
}
