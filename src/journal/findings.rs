//! The table of findings: counted by rule and register, bounded.

use super::{Finding, Rule, Severity};
use std::sync::Arc;

/// Maximum number of entries for a single register: each counts the findings of one rule at one register.
pub const MAX_ENTRIES: usize = 256;
/// Longest note of a finding in bytes.
pub const LONGEST_NOTE: usize = 200;
/// Maximum number of records in the journal for one entry. A record is written when the value of the finding changes.
const MAX_RECORDS: u8 = 8;

/// Counters of a rule at a register.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The last occurrence of the finding.
    pub last: Finding,
    /// True: the entry counts the findings at one register. False: the entry counts the findings of the rule at all
    /// registers without a separate entry. Place and value are then those of the last finding.
    pub is_single: bool,
    /// Number of occurrences of the finding.
    pub count: u64,
    /// Emulated time of the first finding, in microseconds.
    pub first_us: u64,
    /// Emulated time of the last finding, in microseconds.
    pub last_us: u64,
    /// The longest delay of all findings of the entry, in microseconds; 0 for rules without a deadline.
    pub latest_us: u32,
    /// Text about the violation, if the rule alone does not describe it: at most [`LONGEST_NOTE`] bytes without control
    /// characters. Findings of one rule at one register with different notes have separate entries.
    pub note: Option<Arc<str>>,
}

impl Entry {
    fn new(finding: Finding, note: Option<Arc<str>>, time_us: u64, is_single: bool) -> Self {
        let latest_us = finding.late_us;
        Entry { last: finding, is_single, count: 1, first_us: time_us, last_us: time_us, latest_us, note }
    }

    /// Description of the violation: the note, or else the text of the rule.
    #[must_use]
    pub fn text(&self) -> &str {
        self.note.as_deref().unwrap_or(self.last.rule.text())
    }

    fn add(&mut self, finding: Finding, time_us: u64) {
        self.count += 1;
        self.last = finding;
        self.last_us = time_us;
        self.latest_us = self.latest_us.max(finding.late_us);
    }

    fn is_of(&self, finding: &Finding, note: Option<&str>) -> bool {
        let Finding { rule, plc, offset, live, .. } = self.last;
        (rule, plc, offset, live) == (finding.rule, finding.plc, finding.offset, finding.live)
            && self.note.as_deref() == note
    }
}

/// All findings since the start or since they were cleared.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    entries: Vec<Entry>,
    /// Number of records of each entry, in the order of the entries.
    records: Vec<u8>,
    /// Entries for several registers: one for each rule that was broken at further registers when `entries` was full.
    further: Vec<Entry>,
}

impl Findings {
    /// Counts a finding. Returns true if the finding must become a record of the journal, because its rule or register
    /// is new, or its value differs from the last finding. So a program that repeats an error in every interval does
    /// not fill the journal.
    pub fn add(&mut self, time_us: u64, finding: Finding, note: Option<&str>) -> bool {
        if let Some(index) = self.entries.iter().position(|entry| entry.is_of(&finding, note)) {
            let (entry, records) = (&mut self.entries[index], &mut self.records[index]);
            let is_news = entry.last.value != finding.value && *records < MAX_RECORDS;
            *records += u8::from(is_news);
            entry.add(finding, time_us);
            return is_news;
        }
        if self.entries.len() < MAX_ENTRIES {
            self.entries.push(Entry::new(finding, note.map(Arc::from), time_us, true));
            self.records.push(1);
            return true;
        }
        match self.further.iter_mut().find(|entry| entry.last.rule == finding.rule) {
            Some(entry) => {
                entry.add(finding, time_us);
                false
            }
            None => {
                self.further.push(Entry::new(finding, None, time_us, false));
                true
            }
        }
    }

    /// Returns the parts of the table: entries of single registers, number of records of each entry, further entries.
    pub(super) fn parts(&self) -> (&[Entry], &[u8], &[Entry]) {
        let Findings { entries, records, further } = self;
        (entries, records, further)
    }

    /// Creates a table from the parts that [`Findings::parts`] returns; `None` if they do not fit together.
    pub(super) fn of_parts(entries: Vec<Entry>, records: Vec<u8>, further: Vec<Entry>) -> Option<Self> {
        let fits = entries.len() == records.len() && entries.len() <= MAX_ENTRIES;
        fits.then_some(Findings { entries, records, further })
    }

    /// Returns the entries in the order of their first findings; entries that cover several registers come last.
    pub fn iter(&self) -> impl Iterator<Item = &Entry> + Clone {
        self.entries.iter().chain(&self.further)
    }

    /// Returns the number of entries.
    pub fn len(&self) -> usize {
        self.entries.len() + self.further.len()
    }

    /// True if there are no findings.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the broken rules of severity [`Severity::Error`], without repetitions.
    pub fn errors(&self) -> Vec<&'static Rule> {
        self.rules(Severity::Error)
    }

    /// Returns the broken rules of one severity, without repetitions, in the order of the rules.
    pub fn rules(&self, severity: Severity) -> Vec<&'static Rule> {
        let broken = self.iter().map(|entry| entry.last.rule);
        let mut rules: Vec<_> = broken.filter(|rule| rule.severity() == severity).collect();
        rules.sort_by_key(|rule| rule.number());
        rules.dedup();
        rules
    }

    /// Removes all findings and counts.
    pub fn clear(&mut self) {
        *self = Findings::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::phases;
    use crate::identity::DeviceIndex;
    use declared::{ALL, ORDER, OWNER};

    #[allow(unreachable_pub, reason = "the macro declares what families publish")]
    mod declared {
        crate::rules! {
            OWNER: 0, "owner", Error, "p. 1", "Do not. Only read it.";
            ORDER: 1, "order", Error, "p. 2", "The other way round. So.";
        }
    }

    fn finding(rule: &'static Rule, offset: u32, value: u32) -> Finding {
        Finding { rule, plc: DeviceIndex(0), offset, live: phases::CYCLIC, value, late_us: value }
    }

    #[test]
    fn equal_findings_are_counted_with_first_and_last_time() {
        let mut findings = Findings::default();
        for time in [10, 20, 30] {
            findings.add(time, finding(&OWNER, 200_002, 7), None);
        }
        findings.add(40, finding(&OWNER, 200_004, 7), None);
        let [first, second] = findings.iter().collect::<Vec<_>>()[..] else { panic!("{findings:?}") };
        assert_eq!((first.count, first.first_us, first.last_us), (3, 10, 30));
        assert_eq!((second.count, second.first_us, second.last_us), (1, 40, 40));
    }

    #[test]
    fn different_notes_are_different_findings() {
        let mut findings = Findings::default();
        for note in [Some("twice"), Some("late"), Some("twice"), None] {
            findings.add(0, finding(&OWNER, 200_002, 7), note);
        }
        let counts: Vec<_> = findings.iter().map(|entry| (entry.text(), entry.count)).collect();
        assert_eq!(counts, [("twice", 2), ("late", 1), (OWNER.text(), 1)]);
    }

    #[test]
    fn only_news_is_worth_a_record_and_not_for_ever() {
        let mut findings = Findings::default();
        let records = |findings: &mut Findings, values: &mut dyn Iterator<Item = u32>| {
            values.filter(|&value| findings.add(0, finding(&OWNER, 200_002, value), None)).count()
        };
        assert_eq!(records(&mut findings, &mut [1, 1, 1, 2, 2].into_iter()), 2);
        assert_eq!(records(&mut findings, &mut (0..100)), 6);
        assert_eq!(findings.iter().next().unwrap().latest_us, 99);
    }

    #[test]
    fn without_room_findings_are_counted_under_their_rule() {
        let mut findings = Findings::default();
        for offset in 0..2 * MAX_ENTRIES as u32 {
            findings.add(u64::from(offset), finding(&OWNER, offset, 0), None);
        }
        findings.add(1000, finding(&ORDER, 0, 0), None);
        assert_eq!(findings.len(), MAX_ENTRIES + 2);
        let rest: Vec<_> = findings.iter().filter(|entry| !entry.is_single).collect();
        assert_eq!((rest[0].last.rule, rest[0].count), (&OWNER, MAX_ENTRIES as u64));
        assert_eq!((rest[1].last.rule, rest[1].count), (&ORDER, 1));
        assert_eq!(findings.errors(), ALL);
        findings.clear();
        assert!(findings.is_empty());
    }
}
