//! `commram check`: the findings of the access checker.

use super::error::CliError;
use super::table::{self, FormatArg, Row};
use super::{Instance, time};
use crate::devices;
use crate::journal::{Entry, Names, Rule, Severity};
use crate::plural::plural;
use crate::request::json::findings::FindingJson;
use serde::Serialize;

/// Show violations of the manual by PLC programs.
///
/// An error is an access that the manual forbids or that cannot have the intended effect. A warning is an access
/// that is allowed or has no effect, but is probably not intended. docs/reference/checker.md describes the limits
/// of the checker.
///
/// Exit code 1: there is an error among the findings. Exit code 3: the emulator is not running, so nothing could be
/// checked.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram check
  commram check --clear
  commram check --format json
  commram check --rules")]
pub(crate) struct Args {
    /// Delete the findings after they are shown
    #[arg(long)]
    clear: bool,
    /// List the rules instead; needs no emulator
    #[arg(long, conflicts_with = "clear")]
    rules: bool,
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// Prints findings or rules.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if args.rules {
        return table::print(args.format.format, &rules(), rules_text);
    }
    let checked = findings(args)?;
    let rows: Vec<_> = checked.entries.iter().map(|entry| FindingRow::new(entry, &checked.names)).collect();
    table::print(args.format.format, &rows, |rows| text(rows, &checked))?;
    if checked.entries.iter().any(|entry| entry.last.rule.severity() == Severity::Error) {
        return Err(CliError::Reported);
    }
    Ok(())
}

/// The findings of an instance.
struct InstanceFindings {
    instance: String,
    names: Names,
    time_us: u64,
    entries: Vec<Entry>,
}

fn findings(args: &Args) -> Result<InstanceFindings, CliError> {
    use super::session::Session;
    use crate::request::{Op, Reply, WrongReply};
    let instance = args.instance.name().to_owned();
    let session = Session::open(&args.instance, 0)?;
    let mut ops = vec![Op::Info, Op::Findings];
    ops.extend(args.clear.then_some(Op::ClearFindings));
    let mut replies = session.request(&ops)?.into_iter();
    match (replies.next(), replies.next()) {
        (Some(Reply::Info(info)), Some(Reply::Findings(entries))) => {
            Ok(InstanceFindings { instance, names: info.names, time_us: info.time_us, entries })
        }
        _ => Err(WrongReply.into()),
    }
}

/// Findings of one rule at one register.
#[derive(Serialize)]
pub(crate) struct FindingRow {
    #[serde(flatten)]
    pub finding: FindingJson,
    #[serde(skip)]
    pub value_text: String,
}

impl FindingRow {
    /// Converts `entry`, with these names of PLCs and buses.
    pub(crate) fn new(entry: &Entry, names: &Names) -> Self {
        let value_text = entry.last.value_text(names.fitted(entry.last.plc));
        FindingRow { finding: FindingJson::new(entry, names), value_text }
    }
}

impl Row for FindingRow {
    const COLUMNS: &'static [&'static str] = &[
        "severity", "rule", "register", "address", "value", "count", "first_us", "last_us", "late_us", "note",
    ];

    fn cells(&self) -> Vec<String> {
        let finding = &self.finding;
        let or_dash = |text: &Option<String>| text.clone().unwrap_or_else(|| "-".to_owned());
        vec![
            finding.severity.to_owned(),
            finding.rule.to_owned(),
            finding.register.clone().unwrap_or_else(|| "(further registers)".to_owned()),
            or_dash(&finding.address),
            self.value_text.clone(),
            finding.count.to_string(),
            finding.first_us.to_string(),
            finding.last_us.to_string(),
            or_dash(&finding.late_us.map(|late| late.to_string())),
            finding.note.clone().unwrap_or_default(),
        ]
    }

    fn text_cells(&self) -> Vec<String> {
        let finding = &self.finding;
        let mut cells = self.cells();
        let times = [time::seconds(finding.first_us), time::seconds(finding.last_us)];
        let late = finding.late_us.map(|late| format!("{late} us"));
        let time_cells = times.into_iter().chain([late.unwrap_or_else(|| "-".to_owned())]);
        // Notes are printed below the table.
        cells.truncate(cells.len() - 4);
        cells.extend(time_cells);
        cells
    }
}

fn text(rows: &[FindingRow], checked: &InstanceFindings) -> String {
    let number = |severity: &str| rows.iter().filter(|row| row.finding.severity == severity).count();
    let counted = |severity: Severity| plural(number(severity.name()) as u64, severity);
    let head = format!("instance '{}' at {}: ", checked.instance, time::seconds(checked.time_us));
    if rows.is_empty() {
        return head + "no violations of the manual\n";
    }
    let mut text = format!("{head}{}, {}\n", counted(Severity::Error), counted(Severity::Warning));
    text += &table::aligned(rows);
    let broken = |rule: &&&Rule| rows.iter().any(|row| row.finding.rule == rule.id());
    for rule in devices::catalogue().rules.iter().filter(broken) {
        text += &format!("\n{rule} ({})\n  {}\n", rule.source(), rule.text());
        rows.iter()
            .filter(|row| row.finding.rule == rule.id())
            .filter_map(note_line)
            .for_each(|line| text += &line);
    }
    text
}

/// Returns the note of a finding as a line, if it has one.
fn note_line(row: &FindingRow) -> Option<String> {
    let FindingJson { register, note, .. } = &row.finding;
    let place = register.as_ref().map_or_else(String::new, |register| format!("{register}: "));
    note.as_ref().map(|note| format!("  {place}{note}\n"))
}

/// Returns the rules of the access checker as rows of a table.
pub(crate) fn rules() -> Vec<RuleRow> {
    devices::catalogue().rules.iter().copied().map(RuleRow::new).collect()
}

/// A rule of the access checker as a row of a table.
#[derive(Serialize)]
pub(crate) struct RuleRow {
    rule: &'static str,
    severity: &'static str,
    text: &'static str,
    source: &'static str,
}

impl RuleRow {
    fn new(rule: &'static Rule) -> Self {
        let severity = rule.severity().name();
        RuleRow { rule: rule.id(), severity, text: rule.text(), source: rule.source() }
    }
}

impl Row for RuleRow {
    const COLUMNS: &'static [&'static str] = &["rule", "severity", "text", "source"];

    fn cells(&self) -> Vec<String> {
        [self.rule, self.severity, self.text, self.source].map(str::to_owned).to_vec()
    }
}

fn rules_text(rules: &[RuleRow]) -> String {
    let rule = |row: &RuleRow| format!("{} ({}, {})\n  {}\n", row.rule, row.severity, row.source, row.text);
    rules.iter().map(rule).collect::<Vec<_>>().join("\n")
}
