//! The report as one page. It needs no other file and no network, and follows the reader's light or dark mode. Its only
//! script sorts and filters the table. Names and output of scenarios are always escaped, so they never become markup.

mod sequence;

use super::line::summary;
use super::origin::Origin;
use crate::script::{Failure, FoundLine, Outcome, PlotFile, Report, ScriptLocation, Step};
use crate::time::seconds;
use crate::xml_text;
use chrono::{DateTime, SecondsFormat, Utc};
use std::fmt::{self, Display};

const STYLE: &str = include_str!("html/style.css");

/// Sorts and filters the table of scenarios.
const SCRIPT: &str = include_str!("html/report.js");

/// The content of a page may come from untrusted scenarios: the page loads nothing, and runs only the script with this
/// SHA-256 hash.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; \
    script-src 'sha256-tNU4keKFyEtY/0dOBHlXalqXSDqwov1+2WLd6wQnn+s='";

/// Columns of the table of scenarios, and whether a column has numbers.
const COLUMNS: [(&str, bool); 6] = [
    ("Scenario", false),
    ("Plant", false),
    ("Outcome", false),
    ("Expectations", true),
    ("Emulated", true),
    ("Real", true),
];

/// Names of the outcomes of scenarios.
pub(super) const OUTCOMES: [&str; 6] = ["passed", "failed", "broken", "died", "not run", "skipped"];

/// Returns the HTML page of the reports.
pub(crate) fn page(reports: &[Report], origin: &Origin) -> String {
    let all_passed = reports.iter().all(|report| report.outcome.is_fine());
    let (sign, word) = if all_passed { ("passed", "passed") } else { ("failed", "not all passed") };
    let rows: String = reports.iter().enumerate().map(|(number, report)| row(number, report)).collect();
    let details: String =
        reports.iter().enumerate().map(|(number, report)| scenario(number, report)).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>commram: {word}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <h1>Scenarios <span class=\"badge {sign}\">{word}</span></h1>\n<p>{}</p>\n\
         {}{}<table class=\"sortable\">\n<thead><tr>{}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n{details}\
         <footer>commram {}</footer>\n<script>{SCRIPT}</script>\n</body>\n</html>\n",
        EscapedText(summary(reports).trim()),
        facts(reports, origin),
        filter(),
        COLUMNS.map(head).concat(),
        env!("CARGO_PKG_VERSION"),
    )
}

/// Returns host, commit and time of the run.
fn facts(reports: &[Report], origin: &Origin) -> String {
    let started = reports.iter().map(|report| report.started).min();
    let started = started.map(|time| DateTime::<Utc>::from(time).to_rfc3339_opts(SecondsFormat::Secs, true));
    let rows =
        [("host", Some(&origin.host)), ("commit", origin.commit.as_ref()), ("begun", started.as_ref())];
    let row = |(name, text): (&str, Option<&String>)| {
        Some(format!("<dt>{name}</dt><dd>{}</dd>\n", EscapedText(text?)))
    };
    format!("<dl class=\"facts\">\n{}</dl>\n", rows.into_iter().filter_map(row).collect::<String>())
}

/// Returns the inputs that select rows of the table.
fn filter() -> String {
    let option = |name: &str| format!("<option>{name}</option>");
    format!(
        "<p class=\"filter\"><input type=\"search\" placeholder=\"part of a path\" aria-label=\"Filter by path\"> \
         <select aria-label=\"Filter by outcome\"><option value=\"\">all outcomes</option>{}</select> <output></output></p>\n",
        OUTCOMES.map(option).concat()
    )
}

/// Returns the head of a column. A click on it sorts the table by the column.
fn head((name, is_number): (&str, bool)) -> String {
    let class = if is_number { " class=\"n\"" } else { "" };
    format!("<th{class} aria-sort=\"none\"><button>{name}</button></th>")
}

/// A text for a page. Its markup is escaped when the text is formatted.
struct EscapedText<T>(T);

impl<T: Display> Display for EscapedText<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for letter in self.0.to_string().chars() {
            match letter {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\'' => f.write_str("&#39;")?,
                '\n' | '\t' => write!(f, "{letter}")?,
                // Characters that a page must not contain.
                sign if sign == '\r' || !xml_text::is_allowed(sign) => f.write_str("\u{FFFD}")?,
                other => write!(f, "{other}")?,
            }
        }
        Ok(())
    }
}

fn class(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Passed => "passed",
        Outcome::NotRun(_) | Outcome::Skipped(_) => "skipped",
        Outcome::Failed(_) | Outcome::Broken(_) | Outcome::Died(_) => "failed",
    }
}

fn badge(outcome: &Outcome) -> String {
    format!("<span class=\"badge {}\">{}</span>", class(outcome), outcome.name())
}

/// Returns the table row of a scenario.
fn row(number: usize, report: &Report) -> String {
    let emulated = report.emulated_us.map(seconds).unwrap_or_default();
    format!(
        "<tr data-outcome=\"{}\" data-section=\"s{number}\"><td><a href=\"#s{number}\">{}</a></td><td>{}</td><td>{badge}</td>\
         <td class=\"n\" data-key=\"{3}\">{3}</td><td class=\"n\" data-key=\"{4}\">{emulated}</td>\
         <td class=\"n\" data-key=\"{5}\">{6} ms</td></tr>\n",
        report.outcome.name(),
        EscapedText(report.file.display()),
        EscapedText(&report.plant),
        report.expectations,
        report.emulated_us.unwrap_or_default(),
        report.took.as_micros(),
        report.took.as_millis(),
        badge = badge(&report.outcome),
    )
}

/// Returns all details of a scenario. The section of a passed scenario is collapsed.
fn scenario(number: usize, report: &Report) -> String {
    let is_open = if report.outcome.is_passed() && report.plots.is_empty() { "" } else { " open" };
    let started = DateTime::<Utc>::from(report.started).to_rfc3339_opts(SecondsFormat::Secs, true);
    let why = match &report.outcome {
        Outcome::Passed => String::new(),
        Outcome::Failed(failure) => failed(failure),
        Outcome::Broken(mistake) => {
            format!("<p>{}</p>\n{}", EscapedText(&mistake.what), place(&mistake.location))
        }
        Outcome::Died(why) | Outcome::NotRun(why) | Outcome::Skipped(why) => {
            format!("<pre>{}</pre>\n", EscapedText(why))
        }
    };
    format!(
        "<details id=\"s{number}\"{is_open}>\n<summary><h2>{} {}</h2></summary>\n\
         <p class=\"faint\">{}, {}, begun {started}</p>\n{why}{}{}{}{}</details>\n",
        EscapedText(report.name()),
        badge(&report.outcome),
        EscapedText(report.file.display()),
        EscapedText(if report.plant.is_empty() { "no plant" } else { &report.plant }),
        steps(report),
        findings(&report.findings),
        report.plots.iter().map(plot).collect::<String>(),
        printed(&report.printed),
    )
}

fn failed(failure: &Failure) -> String {
    let Failure { what, expected, actual, section, time_us, journal, exchange, location, faults, .. } =
        failure;
    let rows = [("expected", expected), ("actual", actual), ("section", section)];
    let rows: String = rows
        .into_iter()
        .filter_map(|(name, text)| Some(format!("<dt>{name}</dt><dd>{}</dd>\n", EscapedText(text.as_ref()?))))
        .collect();
    let journal: String = journal.iter().map(|line| format!("{}\n", EscapedText(&line.text))).collect();
    let faults: String = faults.iter().map(|line| format!("{}\n", EscapedText(line))).collect();
    let faults = match faults.as_str() {
        "" => faults,
        lines => format!("<h3>Faults</h3>\n<pre>{lines}</pre>\n"),
    };
    let picture = if exchange.is_empty() {
        String::new()
    } else {
        let svg = sequence::picture(exchange, *time_us);
        format!("<h3>Handshakes before the failure</h3>\n<div class=\"scroll\">{svg}</div>\n")
    };
    format!(
        "<p><strong>{}</strong></p>\n<dl>\n{rows}<dt>time</dt><dd>{} emulated</dd>\n</dl>\n{}{faults}{picture}\
         <h3>Journal, last entries</h3>\n<pre>{journal}</pre>\n",
        EscapedText(what),
        seconds(*time_us),
        location.as_ref().map(place).unwrap_or_default(),
    )
}

fn place(place: &ScriptLocation) -> String {
    let line = place.line.map(|line| format!(":{line}")).unwrap_or_default();
    let source = place.source.as_deref().unwrap_or_default();
    format!("<p>{}{line}</p>\n<pre>{}</pre>\n", EscapedText(&place.file), EscapedText(source))
}

/// Returns the sections of a scenario. If the scenario has not passed, it ended in the last section.
fn steps(report: &Report) -> String {
    let last = report.steps.len().saturating_sub(1);
    let step = |(number, step): (usize, &Step)| {
        let outcome = if number == last { &report.outcome } else { &Outcome::Passed };
        let name = step.name.as_deref().unwrap_or("beginning");
        format!(
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>\n",
            EscapedText(name),
            badge(outcome),
            seconds(step.from_us),
            step.expectations
        )
    };
    let rows: String = report.steps.iter().enumerate().map(step).collect();
    if rows.is_empty() {
        return rows;
    }
    format!(
        "<h3>Steps</h3>\n<table>\n<thead><tr><th>Section</th><th>Outcome</th><th class=\"n\">From</th><th class=\"n\">Expectations</th></tr>\
         </thead>\n<tbody>\n{rows}</tbody>\n</table>\n"
    )
}

fn findings(findings: &[FoundLine]) -> String {
    let row = |found: &FoundLine| {
        format!(
            "<tr><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{} ({})</td></tr>\n",
            EscapedText(&found.severity),
            EscapedText(&found.rule),
            EscapedText(&found.register),
            found.count,
            seconds(found.first_us),
            EscapedText(&found.text),
            EscapedText(&found.page)
        )
    };
    if findings.is_empty() {
        return String::new();
    }
    format!(
        "<h3>Findings of the access checker: {}</h3>\n<table>\n<thead><tr><th>Severity</th><th>Rule</th><th>Register</th>\
         <th class=\"n\">Count</th><th class=\"n\">First</th><th>What</th></tr></thead>\n<tbody>\n{}</tbody>\n</table>\n",
        findings.len(),
        findings.iter().map(row).collect::<String>()
    )
}

/// Returns a plot as an embedded image, so that its content cannot affect the page.
fn plot(plot: &PlotFile) -> String {
    format!(
        "<figure><img alt=\"plot {0}\" src=\"data:image/svg+xml,{1}\"><figcaption>{0}</figcaption></figure>\n",
        EscapedText(&plot.name),
        percent(&plot.svg)
    )
}

/// Percent-encodes a text for a URL.
fn percent(text: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.~!*()/:;=,' ".contains(&byte);
    let byte = |byte: u8| match byte {
        b'\'' => "%27".to_owned(),
        plainly if plain(plainly) => char::from(plainly).to_string(),
        other => format!("%{other:02X}"),
    };
    text.bytes().map(byte).collect()
}

fn printed(printed: &str) -> String {
    if printed.is_empty() {
        return String::new();
    }
    format!("<h3>Printed</h3>\n<pre>{}</pre>\n", EscapedText(printed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::{ExchangeKind, ExchangeStep, FailureKind, JournalLine};

    const HOSTILE: &str = "<script>alert('1')</script><img src=x onerror=\"x()\">&\u{202E}\u{1}";

    /// Returns the page without its own script.
    fn page_of(reports: &[Report]) -> String {
        let origin = Origin { host: hostile(), commit: Some(hostile()) };
        let page = page(reports, &origin);
        assert_eq!(page.matches(&format!("<script>{SCRIPT}</script>")).count(), 1);
        page.replace(&format!("<script>{SCRIPT}</script>"), "")
    }

    fn hostile() -> String {
        HOSTILE.to_owned()
    }

    fn report() -> Report {
        let line = JournalLine { time_us: 5, kind: hostile(), text: format!("0.000005 s  line  {HOSTILE}") };
        let exchange =
            [ExchangeKind::Program, ExchangeKind::Firmware, ExchangeKind::Bus, ExchangeKind::Wrong];
        let failure = Failure {
            kind: FailureKind::Expectation,
            what: hostile(),
            register: Some(hostile()),
            address: Some(hostile()),
            expected: Some(hostile()),
            actual: Some(hostile()),
            numbers: None,
            within_us: None,
            time_us: 5,
            section: Some(hostile()),
            findings: 0,
            first_findings: Vec::new(),
            faults: vec![hostile()],
            journal: vec![line.clone()],
            exchange: exchange.map(|kind| ExchangeStep { kind, line: line.clone() }).to_vec(),
            location: Some(ScriptLocation {
                file: hostile(),
                line: Some(1),
                column: None,
                source: Some(hostile()),
            }),
        };
        let found = FoundLine {
            first_us: 5,
            severity: hostile(),
            rule: hostile(),
            register: hostile(),
            count: 2,
            text: hostile(),
            page: hostile(),
        };
        Report {
            plant: hostile(),
            printed: hostile(),
            steps: vec![Step { name: Some(hostile()), from_us: 0, expectations: 3 }],
            findings: vec![found],
            plots: vec![PlotFile { name: hostile(), svg: format!("<svg>{HOSTILE}</svg>") }],
            ..Report::bare(format!("{HOSTILE}.rhai").into(), Outcome::Failed(Box::new(failure)))
        }
    }

    #[test]
    fn texts_of_scenarios_never_become_markup() {
        let mut reports = vec![report()];
        reports.push(Report::bare("b".into(), Outcome::Died(hostile())));
        reports.push(Report::bare("c".into(), Outcome::NotRun(hostile())));
        let page = page_of(&reports);
        for wrong in ["<script", "<img src=x", "onerror=\"", "\u{202E}", "\u{1}", "alert('1')"] {
            assert!(!page.contains(wrong), "{wrong}\n{page}");
        }
        assert!(page.contains("&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;"), "{page}");
        assert!(page.contains("%3Csvg%3E%3Cscript%3Ealert(%271%27)"), "{page}");
        // A text that was not escaped could open a tag or a quote. So every tag must be closed, and quotes must come in
        // pairs.
        assert_eq!(page.matches("<details").count(), page.matches("</details>").count());
        assert_eq!(page.matches("<svg").count(), page.matches("</svg>").count());
    }

    #[test]
    fn each_scenario_is_listed_with_its_outcome() {
        let reports = [report(), Report::bare("tests/start.rhai".into(), Outcome::Passed)];
        let page = page_of(&reports);
        assert!(page.contains("<title>commram: not all passed</title>"));
        assert!(page.contains("Findings of the access checker: 1<"), "{page}");
        assert!(
            page.contains(
                "<details id=\"s1\">\n<summary><h2>start <span class=\"badge passed\">passed</span>"
            )
        );
        assert!(page_of(&reports[1..]).contains("<title>commram: passed</title>"));
        for outside in ["http://", "https://", "<script", "@import", "url("] {
            let own = page.replace("http://www.w3.org/2000/svg", "");
            assert!(!own.contains(outside), "{outside}");
        }
    }

    /// A browser runs the script only if its hash is in the policy.
    #[test]
    fn the_policy_has_the_hash_of_the_script() {
        use std::io::Write;
        let mut command = std::process::Command::new("sha256sum");
        let pipe = || std::process::Stdio::piped();
        let mut child = command.stdin(pipe()).stdout(pipe()).spawn().unwrap();
        child.stdin.take().unwrap().write_all(SCRIPT.as_bytes()).unwrap();
        let out = String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap();
        let digit = |at: usize| u32::from_str_radix(&out[at..=at], 16).unwrap();
        let bits: Vec<_> = (0..64).flat_map(|at| (0..4).rev().map(move |bit| digit(at) >> bit & 1)).collect();
        let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let letter = |six: &[u32]| {
            let padded = six.iter().chain([&0; 5]).take(6);
            char::from(letters[padded.fold(0, |number, bit| number << 1 | bit) as usize])
        };
        let hash: String = bits.chunks(6).map(letter).collect();
        assert!(POLICY.contains(&format!("'sha256-{hash}='")), "html.rs needs the hash {hash}=");
    }

    #[test]
    fn plant_host_and_commit_are_in_the_page_and_rows_have_keys() {
        let mut passed = Report::bare("a.rhai".into(), Outcome::Passed);
        (passed.plant, passed.emulated_us) = ("press.toml".to_owned(), Some(1500));
        let page =
            page(&[passed], &Origin { host: "press-1".to_owned(), commit: Some("0123abc".to_owned()) });
        for part in [
            "<dt>host</dt><dd>press-1</dd>",
            "<dt>commit</dt><dd>0123abc</dd>",
            "<tr data-outcome=\"passed\" data-section=\"s0\">",
            "<td>press.toml</td>",
            "data-key=\"1500\">0.001500 s</td>",
            "<th aria-sort=\"none\"><button>Plant</button></th>",
        ] {
            assert!(page.contains(part), "{part}\n{page}");
        }
    }
}
