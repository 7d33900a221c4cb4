//! JUnit report, for CI servers.

use super::{Outcome, Report};
use crate::xml_text;
use quick_junit::{NonSuccessKind, SerializeError, TestCase, TestCaseStatus, TestSuite};
use std::path::{Component, Path};
use std::time::Duration;

/// Name of the test suites as a whole.
const NAME: &str = "commram";
/// Type of a skipped result if the scenario has called `skip`.
pub(crate) const SKIP: &str = "skip";

/// Returns the reports as JUnit XML. Each scenario file is a test suite with one test case. Times are real time. The
/// emulated time, the number of expectations and the line of a failure are properties of the suite, as far as they are
/// known. A scenario that died or is broken is an error. A scenario that was not run is skipped. A scenario that has
/// called `skip` is skipped with the type `skip`.
///
/// The XML conforms to Jenkins' schema (junit-10), which has no properties, file or line in a test case, and no
/// `skipped` in the root element (D-552).
///
/// # Errors
/// The XML cannot be written, which does not happen to strings.
pub fn junit(reports: &[Report]) -> Result<String, SerializeError> {
    named(reports, NAME)
}

/// Writes a report like [`junit`], for the scenarios of a shard. The name of the report contains `shard`, for example
/// `2/3`.
///
/// # Errors
/// Returns the errors of [`junit`].
pub fn junit_of_shard(reports: &[Report], shard: &str) -> Result<String, SerializeError> {
    named(reports, &format!("{NAME} {shard}"))
}

/// Returns the shard in the name of a report, for example `2/3`.
#[cfg(feature = "cli")]
pub(crate) fn shard_of_junit(name: &str) -> Option<&str> {
    name.strip_prefix(NAME)?.strip_prefix(' ')
}

/// Characters that the library removes from texts, their references in XML, and the characters that replace them until
/// [`junit_text`]. XML does not allow the latter, so no text contains them.
const KEPT: [(char, &str, char); 2] = [('\t', "&#9;", '\u{FFFE}'), ('\r', "&#13;", '\u{FFFF}')];

/// Returns a text for a report. It has the same characters in the XML, except those that XML does not allow.
fn kept(text: &str) -> String {
    let text = xml_text::allowed(text.to_owned());
    KEPT.iter().fold(text, |text, (sign, _, mark)| text.replace(*sign, &mark.to_string()))
}

/// Prepares the XML of a report for the library, so that the texts keep their characters.
#[cfg(feature = "cli")]
pub(crate) fn junit_input(xml: &str) -> String {
    // The report of another program may contain the marks.
    let xml = xml_text::allowed(xml.to_owned());
    KEPT.iter().fold(xml, |xml, (_, reference, mark)| xml.replace(reference, &mark.to_string()))
}

/// Returns a text of a report that was read from [`junit_input`].
#[cfg(feature = "cli")]
pub(crate) fn junit_value(text: &str) -> String {
    KEPT.iter().fold(text.to_owned(), |text, (sign, _, mark)| text.replace(*mark, &sign.to_string()))
}

fn named(reports: &[Report], name: &str) -> Result<String, SerializeError> {
    let mut all = quick_junit::Report::new(name);
    all.set_time(reports.iter().map(|report| report.took).sum::<Duration>());
    all.add_test_suites(reports.iter().map(suite));
    junit_text(&all)
}

/// Returns the XML, in the form of Jenkins' schema.
///
/// # Errors
/// Returns the errors of [`junit`].
pub(crate) fn junit_text(all: &quick_junit::Report) -> Result<String, SerializeError> {
    let text =
        KEPT.iter().fold(all.to_string()?, |text, (_, reference, mark)| text.replace(*mark, reference));
    // A report that `merge` has read may have other forbidden characters; the library removes only control characters.
    let text = xml_text::allowed(text);
    // The first attribute with this name in the text is the one in the root element.
    let skipped = text.find(" skipped=\"").map(|start| {
        let end = text[start..].match_indices('"').nth(1).map_or(start, |(quote, _)| start + quote + 1);
        start..end
    });
    Ok(skipped
        .map_or_else(|| text.clone(), |skipped| text[..skipped.start].to_owned() + &text[skipped.end..]))
}

fn suite(report: &Report) -> TestSuite {
    let path = |path: &Path| kept(&path.display().to_string());
    let mut suite = TestSuite::new(path(&report.file.with_extension("")));
    suite.extra.insert("file".into(), path(&report.file).into());
    suite.set_timestamp(chrono::DateTime::<chrono::Utc>::from(report.started));
    suite.set_time(report.took);
    let line = match &report.outcome {
        Outcome::Failed(failure) => failure.location.as_ref(),
        Outcome::Broken(mistake) => Some(&mistake.location),
        _ => None,
    };
    let mut property = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            suite.add_property((name, kept(&value).as_str()));
        }
    };
    property("emulated_us", report.emulated_us.map(|us| us.to_string()));
    property("expectations", report.emulated_us.map(|_| report.expectations.to_string()));
    property("line", line.and_then(|place| place.line.map(|line| format!("{}:{line}", place.file))));
    suite.add_test_case(case(report));
    suite
}

fn case(report: &Report) -> TestCase {
    let mut case = TestCase::new(kept(&report.name()), status(&report.outcome));
    case.set_classname(kept(&class_name(&report.file)));
    case.set_time(report.took);
    if !report.printed.is_empty() {
        case.set_system_out(kept(&report.printed));
    }
    case
}

/// `tests.scenarios.04-deadlines`: servers show the parts between the dots as a tree.
fn class_name(file: &Path) -> String {
    let path = file.with_extension("");
    let names = path.components().filter_map(|part| match part {
        Component::Normal(name) => Some(name.to_string_lossy().replace('.', "_")),
        _ => None,
    });
    names.collect::<Vec<_>>().join(".")
}

fn status(outcome: &Outcome) -> TestCaseStatus {
    let first_line = |text: &str| text.lines().next().unwrap_or_default().to_owned();
    let (kind, ty, message, description) = match outcome {
        Outcome::Passed => return TestCaseStatus::success(),
        Outcome::NotRun(why) => {
            let mut status = TestCaseStatus::skipped();
            status.set_message(kept(why));
            return status;
        }
        Outcome::Skipped(reason) => {
            let mut status = TestCaseStatus::skipped();
            status.set_message(kept(reason));
            status.set_type(SKIP);
            return status;
        }
        Outcome::Failed(failure) => {
            (NonSuccessKind::Failure, failure.kind.name(), failure.what.clone(), failure.to_string())
        }
        Outcome::Broken(mistake) => {
            let text = mistake.to_string();
            (NonSuccessKind::Error, "script", first_line(&text), text)
        }
        Outcome::Died(text) => (NonSuccessKind::Error, "process", first_line(text), text.clone()),
    };
    let mut status = TestCaseStatus::non_success(kind);
    status.set_type(ty);
    status.set_message(kept(&message));
    // `commram test merge` reads descriptions without blanks at both ends.
    status.set_description(kept(description.trim()));
    status
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_with_characters_that_xml_does_not_allow_make_a_whole_report() {
        let hostile = "x\u{ffff}\u{fffe}\u{202e}\u{1b}[0m";
        let outcomes = [Outcome::Died, Outcome::NotRun, Outcome::Skipped, |_| Outcome::Passed]
            .map(|outcome: fn(String) -> Outcome| outcome(hostile.to_owned()));
        let reports = outcomes.map(|outcome| Report {
            printed: hostile.to_owned(),
            ..Report::bare(format!("{hostile}.rhai").into(), outcome)
        });
        let text = junit(&reports).unwrap();
        assert!(text.chars().all(xml_text::is_allowed), "{text:?}");
        assert!(text.contains("name=\"x\u{fffd}\u{fffd}"), "{text}");
    }

    #[cfg(feature = "cli")]
    #[test]
    fn tabs_and_carriage_returns_stay_in_names_messages_and_output() {
        let text = "1\t2\r3 &#9;";
        let report = Report {
            printed: text.to_owned(),
            ..Report::bare(format!("{text}.rhai").into(), Outcome::Died(text.to_owned()))
        };
        let xml = junit(&[report]).unwrap();
        for part in [" file=\"V.rhai\"", " message=\"V\"", "<system-out>V</system-out>"] {
            assert!(xml.contains(&part.replace('V', "1&#9;2&#13;3 &amp;#9;")), "{part}: {xml}");
        }
        assert_eq!(xml_text::allowed(xml.clone()), xml);
        // A report of another program.
        let foreign = junit_text(&quick_junit::Report::new(junit_input("x\u{202e}\u{fffe}&#9;y"))).unwrap();
        assert!(foreign.contains(" name=\"x\u{fffd}\u{fffd}&#9;y\""), "{foreign}");
    }

    #[test]
    fn a_scenario_that_was_not_run_is_skipped_and_the_head_does_not_say_so() {
        let reports = [
            Report::bare("tests/v1.2/a.rhai".into(), Outcome::Passed),
            Report::bare("b.rhai".into(), Outcome::NotRun("interrupted".to_owned())),
            Report::bare("c.rhai".into(), Outcome::Died("c.rhai: killed\n  by a signal".to_owned())),
        ];
        let text = junit(&reports).unwrap();
        let head = text.lines().find(|line| line.starts_with("<testsuites")).unwrap();
        assert_eq!(
            head,
            "<testsuites name=\"commram\" tests=\"3\" failures=\"0\" errors=\"1\" time=\"0.000\">"
        );
        for expected in [
            " name=\"tests/v1.2/a\" tests=\"1\" skipped=\"0\"",
            "file=\"tests/v1.2/a.rhai\"",
            "<testcase name=\"a\" classname=\"tests.v1_2.a\" time=\"0.000\"/>",
            "<skipped message=\"interrupted\"/>",
            "<error message=\"c.rhai: killed\" type=\"process\">",
        ] {
            assert!(text.contains(expected), "{text}\nlacks {expected}");
        }
        assert_eq!(text.matches(" timestamp=\"").count(), 3, "{text}");
    }
}
