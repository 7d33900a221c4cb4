//! `commram test merge`: combines the reports of shards into the report of a single run.

use super::html;
use super::origin::Origin;
use super::report_file::{ReportFile, ReportKind};
use super::selection::Shard;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::overwrite::refuse_inputs;
use crate::input_file;
use crate::plural::plural;
use crate::script::{self, SKIP, junit_input, junit_text, junit_value, shard_of_junit};
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use serde_json::Value;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Merge the reports of all shards into the report of a single run.
///
/// The reports are written by `commram test --shard`, either all with `--junit` or all with `--report json` (or
/// `--format json`); the page of `--report html` needs `--report json`. The
/// scenarios are in the order of a single run, and the exit code is the exit code of that run.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram test merge report-1.xml report-2.xml --output report.xml
  commram test merge shard-*.json --output report.json --report html=report.html

Exit codes:
  0  all scenarios passed
  1  a scenario failed, crashed or was not run
  2  wrong use: a file is not a report, a report is duplicate or missing, or a scenario has an error")]
pub(crate) struct Args {
    /// The reports of all shards, in any order
    #[arg(value_name = "REPORT", required = true)]
    reports: Vec<PathBuf>,
    /// File to write; the standard output if omitted
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write a report into this file: html, a self-contained page for people (commram-report.html)
    #[arg(long, value_name = "KIND[=FILE]", value_parser = page_file)]
    report: Option<ReportFile>,
}

/// Parses the file name of the page.
fn page_file(text: &str) -> Result<ReportFile, String> {
    match ReportFile::parse(text) {
        Ok(page) if page.kind == ReportKind::Html => Ok(page),
        Err(reason) if text.starts_with("html=") => Err(reason),
        _ => Err("write html, or html=FILE".to_owned()),
    }
}

/// Result of a scenario, reduced to the cases that determine the exit code.
#[derive(Clone, Copy, PartialEq, Eq)]
enum EndResult {
    Passed,
    /// The scenario failed, crashed or was not run.
    NotPassed,
    /// The script has an error.
    Broken,
    /// The scenario skipped itself.
    Skipped,
}

/// One scenario of a report.
struct Scenario<T> {
    file: String,
    ending: EndResult,
    is_run: bool,
    content: T,
}

/// The report of a shard.
struct Part<T> {
    path: PathBuf,
    /// The shard of the report; `None` for a JSON report without scenarios.
    shard: Option<Shard>,
    scenarios: Vec<Scenario<T>>,
}

pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let page = args.report.as_ref().map(|report| report.path.as_path());
    for output in [args.output.as_deref(), page] {
        refuse_inputs(output, args.reports.iter().map(PathBuf::as_path))?;
    }
    let mut texts = Vec::with_capacity(args.reports.len());
    for path in &args.reports {
        let text = input_file::read(path, input_file::LONGEST);
        texts.push((path, text.map_err(|reason| wrong(path, reason))?));
    }
    let is_xml = |text: &str| text.trim_start().starts_with('<');
    let xml = texts.iter().filter(|(_, text)| is_xml(text)).count();
    if xml != 0
        && let Some((path, _)) = texts.iter().find(|(_, text)| !is_xml(text))
    {
        return Err(wrong(path, "it is not a JUnit report, but others are; use reports of one kind"));
    }
    let (text, endings) = if xml > 0 {
        if let (Some(page), Some((path, _))) = (page, texts.first()) {
            let right = format!("a JUnit report has no data for {}; {PAGE_DATA}", page.display());
            return Err(wrong(path, right));
        }
        let parts = texts.iter().map(|(path, text)| of_junit(path, text)).collect::<Result<_, _>>()?;
        let merged = in_order(parts)?;
        let mut all = Report::new("commram");
        let endings: Vec<_> = merged.iter().map(|it| (it.ending, it.is_run)).collect();
        let suites: Vec<_> = merged.into_iter().map(|it| it.content).collect();
        all.set_time(suites.iter().filter_map(|suite: &TestSuite| suite.time).sum::<Duration>());
        all.add_test_suites(suites);
        let text = junit_text(&all).map_err(|reason| output_of(args, io::Error::other(reason)))?;
        (output::xml_escaped(&text), endings)
    } else {
        let parts = texts.iter().map(|(path, text)| of_json(path, text)).collect::<Result<_, _>>()?;
        let merged = in_order(parts)?;
        let endings = merged.iter().map(|it| (it.ending, it.is_run)).collect();
        let lines: Vec<_> = merged.into_iter().map(|it| it.content).collect();
        if let Some(path) = page {
            write_page(path, &lines)?;
        }
        (output::json(&lines)?, endings)
    };
    match args.output.as_deref().filter(|path| !input_file::is_standard(path)) {
        None => output::print(&text)?,
        Some(path) => {
            output::write(path, text.as_bytes())?;
            output::print(&summary(&endings))?;
        }
    }
    verdict(&endings)
}

fn output_of(args: &Args, reason: io::Error) -> CliError {
    match &args.output {
        Some(path) => CliError::File { path: path.clone(), reason },
        None => CliError::Output { reason },
    }
}

/// Maximum number of missing shards that a message lists.
const MAX_LISTED: usize = 20;

/// Advice in the error message about a report without data for a page.
const PAGE_DATA: &str = "`commram test --shard I/N --report json=FILE` writes reports with this data";

/// Writes the page about these scenarios.
fn write_page(path: &Path, lines: &[Value]) -> Result<(), CliError> {
    let reports = lines.iter().map(|line| {
        let text = |name: &str| line.get(name).and_then(Value::as_str).unwrap_or_default();
        let report = line.get("page").map(|page| serde_json::from_value::<script::Report>(page.clone()));
        let report = report.and_then(Result::ok).ok_or_else(|| {
            let right = format!("its report has no data for {}; {PAGE_DATA}", path.display());
            CliError::Argument { text: text("file").to_owned(), right }
        })?;
        Ok(script::Report { file: text("file").into(), printed: text("printed").to_owned(), ..report })
    });
    let reports = reports.collect::<Result<Vec<_>, CliError>>()?;
    let page = html::page(&reports, &Origin::of_this_run());
    output::write(path, page.as_bytes())
}

fn wrong(path: &Path, what: impl ToString) -> CliError {
    CliError::Argument { text: path.display().to_string(), right: what.to_string() }
}

fn of_junit(path: &Path, text: &str) -> Result<Part<TestSuite>, CliError> {
    let mut report =
        Report::deserialize_from_str(&with_edges(&junit_input(text))).map_err(|error| wrong(path, error))?;
    report.test_suites.iter_mut().flat_map(|suite| &mut suite.test_cases).for_each(without_edges);
    let name = report.name.as_ref().map(|name| name.to_string()).unwrap_or_default();
    let shard = shard_of_junit(&name).ok_or_else(|| {
        wrong(path, "it does not name its shard; `commram test --shard I/N --junit FILE` writes such reports")
    })?;
    let shard = Shard::parse(shard).map_err(|right| wrong(path, format!("shard {shard}: {right}")))?;
    let scenarios = report.test_suites.into_iter().map(|suite| {
        let file = junit_value(suite.extra.get("file").unwrap_or(&suite.name));
        let status = suite.test_cases.first().map(|case| &case.status);
        let (ending, is_run) = match status {
            Some(TestCaseStatus::Success { .. }) => (EndResult::Passed, true),
            Some(TestCaseStatus::NonSuccess { kind: NonSuccessKind::Error, ty: Some(ty), .. })
                if ty.as_str() == "script" =>
            {
                (EndResult::Broken, true)
            }
            Some(TestCaseStatus::Skipped { ty: Some(ty), .. }) if ty.as_str() == SKIP => {
                (EndResult::Skipped, true)
            }
            Some(TestCaseStatus::Skipped { .. }) => (EndResult::NotPassed, false),
            _ => (EndResult::NotPassed, true),
        };
        Scenario { file, ending, is_run, content: suite }
    });
    Ok(Part { path: path.to_owned(), shard: Some(shard), scenarios: scenarios.collect() })
}

/// The parser removes blanks and line ends at both ends of an output. A character of private use at both ends protects
/// them.
const EDGE: char = '\u{E000}';

fn with_edges(text: &str) -> String {
    text.replace("<system-out>", &format!("<system-out>{EDGE}"))
        .replace("</system-out>", &format!("{EDGE}</system-out>"))
}

fn without_edges(case: &mut TestCase) {
    let printed = case.system_out.as_deref().and_then(|text| text.strip_prefix(EDGE)?.strip_suffix(EDGE));
    if let Some(printed) = printed.map(str::to_owned) {
        case.set_system_out(printed);
    }
}

fn of_json(path: &Path, text: &str) -> Result<Part<Value>, CliError> {
    let none =
        "it is not a report; `commram test --shard I/N` writes them with --junit FILE and with --format json";
    let lines: Vec<Value> = serde_json::from_str(text).map_err(|_| wrong(path, none))?;
    let mut part = Part { path: path.to_owned(), shard: None, scenarios: Vec::with_capacity(lines.len()) };
    for mut line in lines {
        let text = |name: &str| line.get(name).and_then(Value::as_str).map(str::to_owned);
        let (Some(file), Some(outcome)) = (text("file"), text("outcome")) else {
            return Err(wrong(path, none));
        };
        let shard = text("shard").ok_or_else(|| {
            wrong(path, "it does not name its shard; `commram test --shard I/N` writes such reports")
        })?;
        let shard = Shard::parse(&shard).map_err(|right| wrong(path, format!("shard {shard}: {right}")))?;
        if let Some(other) = part.shard.filter(|other| *other != shard) {
            return Err(wrong(path, format!("it has scenarios of shard {other} and of shard {shard}")));
        }
        part.shard = Some(shard);
        if let Some(line) = line.as_object_mut() {
            line.remove("shard");
        }
        if !html::OUTCOMES.contains(&outcome.as_str()) {
            let right =
                format!("{file} has the outcome {outcome}; outcomes are {}", html::OUTCOMES.join(", "));
            return Err(wrong(path, right));
        }
        let ending = match outcome.as_str() {
            "passed" => EndResult::Passed,
            "broken" => EndResult::Broken,
            "skipped" => EndResult::Skipped,
            _ => EndResult::NotPassed,
        };
        part.scenarios.push(Scenario { file, ending, is_run: outcome != "not run", content: line });
    }
    Ok(part)
}

/// Returns the scenarios of all shards in the order of a single run. Each shard has every N-th scenario.
fn in_order<T>(parts: Vec<Part<T>>) -> Result<Vec<Scenario<T>>, CliError> {
    let (known, empty): (Vec<_>, Vec<_>) = parts.into_iter().partition(|part| part.shard.is_some());
    let Some(count) = known.first().and_then(|part| part.shard).map(Shard::count) else {
        // A JSON report without scenarios does not contain the number of shards. If all reports are such, a missing
        // report cannot be detected.
        let path = empty.first().map(|part| part.path.as_path()).unwrap_or(Path::new("-"));
        return Err(wrong(path, "no report has a scenario; reports of other shards are missing"));
    };
    let mut places: Vec<Option<Part<T>>> = (0..count).map(|_| None).collect();
    for part in known {
        let Some(shard) = part.shard else { continue };
        if shard.count() != count {
            return Err(wrong(
                &part.path,
                format!("it is shard {shard}, but others belong to {}", plural(count as u64, "shard")),
            ));
        }
        let place = &mut places[shard.index() - 1];
        if let Some(other) = place {
            let other = other.path.display();
            return Err(wrong(&part.path, format!("it is shard {shard}, as is {other}")));
        }
        *place = Some(part);
    }
    // A report without the number of its shard belongs to a shard without scenarios. Only the last shards can be empty,
    // so these reports get the last free numbers.
    let mut empty = empty.into_iter();
    for place in places.iter_mut().rev().take_while(|place| place.is_none()) {
        *place = empty.next();
    }
    if let Some(more) = empty.next() {
        return Err(wrong(
            &more.path,
            "it has no scenarios, and all shards are present without it".to_owned(),
        ));
    }
    let missing = places.iter().enumerate().filter(|(_, place)| place.is_none());
    let missing: Vec<_> = missing.map(|(index, _)| format!("{}/{count}", index + 1)).collect();
    let (listed, others) = missing.split_at(missing.len().min(MAX_LISTED));
    if !listed.is_empty() {
        let others = match others.len() {
            0 => String::new(),
            count => format!(" and {count} more"),
        };
        let right = "the reports of these shards are needed".to_owned();
        let text = format!("missing: shard {}{others}", listed.join(", "));
        return Err(CliError::Argument { text, right });
    }
    let parts: Vec<_> = places.into_iter().flatten().collect();
    let total: usize = parts.iter().map(|part| part.scenarios.len()).sum();
    let mut files = HashMap::new();
    for (index, part) in parts.iter().enumerate() {
        let due = total.saturating_sub(index).div_ceil(count);
        if part.scenarios.len() != due {
            let has = plural(part.scenarios.len() as u64, "scenario");
            let what = format!(
                "it has {has}, expected are {due} of all {total}; the shards do not have the same files"
            );
            return Err(wrong(&part.path, what));
        }
        for scenario in &part.scenarios {
            if let Some(other) = files.insert(scenario.file.clone(), &part.path) {
                let (file, other) = (&scenario.file, other.display());
                return Err(wrong(&part.path, format!("{file} is in this report and in {other}")));
            }
        }
    }
    let mut queues: Vec<_> = parts.into_iter().map(|part| part.scenarios.into_iter()).collect();
    Ok((0..total).filter_map(|place| queues[place % count].next()).collect())
}

fn summary(endings: &[(EndResult, bool)]) -> String {
    let of = |ending: EndResult| endings.iter().filter(|(it, is_run)| *it == ending && *is_run).count();
    let skipped = match of(EndResult::Skipped) {
        0 => String::new(),
        count => format!(", {count} skipped"),
    };
    let not_run = match endings.iter().filter(|(_, is_run)| !is_run).count() {
        0 => String::new(),
        count => format!(", {count} not run"),
    };
    let (passed, failed, broken) = (of(EndResult::Passed), of(EndResult::NotPassed), of(EndResult::Broken));
    format!("{passed} passed, {failed} failed, {broken} broken{skipped}{not_run}\n")
}

fn verdict(endings: &[(EndResult, bool)]) -> Result<(), CliError> {
    if endings.iter().any(|(ending, _)| *ending == EndResult::Broken) {
        return Err(CliError::ReportedWrongUse);
    }
    if endings.iter().any(|(ending, _)| *ending == EndResult::NotPassed) {
        Err(CliError::Reported)
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests;
