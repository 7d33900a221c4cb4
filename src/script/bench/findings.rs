//! The findings of the access checker.

use super::Bench;
use crate::devices;
use crate::journal::{Entry, Source};
use crate::plural::{plural, plural_of};
use crate::request::Op;
use crate::script::ScenarioError;
use crate::time::seconds;
use core::panic::Location;

impl Bench {
    /// Returns the findings of the access checker up to now, by rule and register, in the order of the first findings.
    ///
    /// # Errors
    /// The emulator of the instance has ended.
    pub fn findings(&mut self) -> Result<Vec<Entry>, ScenarioError> {
        self.entries()
    }

    /// Clears the findings of the access checker.
    ///
    /// # Errors
    /// The emulator of the instance has ended.
    pub fn clear_findings(&mut self) -> Result<(), ScenarioError> {
        Ok(self.ask(Op::ClearFindings)?.cleared()?)
    }

    /// Expects that the access checker has no findings (errors or warnings), except of the rules in `allowed`.
    ///
    /// # Errors
    /// There are other findings, or the rule does not exist.
    #[track_caller]
    pub fn expect_no_findings(&mut self, allowed: &[&str]) -> Result<(), ScenarioError> {
        let at = Location::caller();
        let catalogue = devices::catalogue();
        if let Some(name) = allowed.iter().find(|name| catalogue.rule_called(name).is_none()) {
            let known: Vec<_> = catalogue.rules.iter().map(|rule| rule.id()).collect();
            let (name, known) = ((*name).to_owned(), known.join(", "));
            return Err(ScenarioError::Unknown { what: "rule", name, known });
        }
        let mut found = self.findings()?;
        found.retain(|entry| !allowed.contains(&entry.last.rule.id()));
        if found.is_empty() {
            return Ok(());
        }
        let lines: Vec<_> = found.iter().map(|entry| self.finding_text(entry)).collect();
        let what = format!("the access checker has {}", plural_of(&found, "finding"));
        let mut failure = self.failure(what, at)?;
        // The text of the failure already lists all findings.
        (failure.findings, failure.first_findings) = (0, Vec::new());
        failure.expected = Some("no findings".to_owned());
        failure.actual = Some(lines.join("\n            "));
        Err(failure.into())
    }

    /// Returns the register of a finding, with the PLC as a prefix if there are several. The address of the register if
    /// it has no name.
    pub fn finding_place(&self, entry: &Entry) -> String {
        let fitted = self.names.fitted(entry.last.plc);
        let address = || entry.last.address(fitted).map(|address| address.to_string());
        let name = entry.last.name(fitted).or_else(address).unwrap_or_default();
        match entry.last.source() {
            Source::Bus(bus) => {
                let bus = self.names.buses.get(bus.index()).map_or("", String::as_str);
                format!("{bus}:{name}")
            }
            _ => format!("{}{name}", self.prefix(entry.last.plc)),
        }
    }

    /// Returns the value of a finding, as a number of the register's type.
    pub fn finding_value(&self, entry: &Entry) -> i64 {
        entry.last.number(self.names.fitted(entry.last.plc))
    }

    /// `error: owner: node2.w_OPTION_STATUS (%MW3.200002) := 16#0003, 2 times since 0.001000 s: ...`
    fn finding_text(&self, entry: &Entry) -> String {
        match entry.note {
            Some(_) => self.finding_line(entry),
            None => format!("{}: {}", self.finding_line(entry), entry.last.rule.text()),
        }
    }

    /// Returns the line of a finding with its note, without advice.
    pub(super) fn finding_line(&self, entry: &Entry) -> String {
        let Entry { last, count, first_us, note, .. } = entry;
        let note = note.as_ref().map_or_else(String::new, |note| format!(": {note}"));
        let fitted = self.names.fitted(last.plc);
        let address = last.address(fitted).map_or_else(String::new, |address| format!(" ({address})"));
        format!(
            "{}: {}: {}{address} := {}, {} since {}{note}",
            last.rule.severity(),
            last.rule.id(),
            self.finding_place(entry),
            last.value_text(fitted),
            plural(*count, "time"),
            seconds(*first_us),
        )
    }
}
