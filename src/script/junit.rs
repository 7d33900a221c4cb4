//! The report that CI servers read.

use super::{Outcome, Report};
use quick_junit::{NonSuccessKind, SerializeError, TestCase, TestCaseStatus, TestSuite};
use std::time::Duration;

/// The reports as JUnit XML: one test suite, one test case per scenario. Times are real time; the emulated time is a
/// property of the suite, `emulated_us FILE`, if it is known. A scenario that died is an error, as is a broken one.
///
/// Jenkins' schema (junit-10) takes it: that has no properties in a test case and no `skipped` at the head.
///
/// # Errors
/// The XML cannot be written, which does not happen to strings.
pub fn junit(reports: &[Report]) -> Result<String, SerializeError> {
    let mut suite = TestSuite::new("commram test");
    suite.set_time(reports.iter().map(|report| report.took).sum::<Duration>());
    for report in reports {
        if let Some(emulated_us) = report.emulated_us {
            let name = format!("emulated_us {}", report.file.display());
            suite.add_property((name.as_str(), emulated_us.to_string().as_str()));
        }
    }
    suite.add_test_cases(reports.iter().map(case));
    let mut report = quick_junit::Report::new("commram");
    report.add_test_suite(suite);
    Ok(report.to_string()?.replacen(" skipped=\"0\"", "", 1))
}

fn case(report: &Report) -> TestCase {
    let mut case = TestCase::new(report.name(), status(&report.outcome));
    let directory = report.file.parent().map(|directory| directory.display().to_string());
    case.set_classname(directory.filter(|name| !name.is_empty()).unwrap_or_else(|| ".".to_owned()));
    case.set_time(report.took);
    if !report.printed.is_empty() {
        case.set_system_out(report.printed.as_str());
    }
    case
}

fn status(outcome: &Outcome) -> TestCaseStatus {
    let (kind, message, description) = match outcome {
        Outcome::Passed => return TestCaseStatus::success(),
        Outcome::Failed(failure) => (NonSuccessKind::Failure, failure.what.clone(), failure.to_string()),
        Outcome::Broken(text) | Outcome::Died(text) => {
            (NonSuccessKind::Error, text.lines().next().unwrap_or_default().to_owned(), text.clone())
        }
    };
    let mut status = TestCaseStatus::non_success(kind);
    status.set_message(message);
    status.set_description(description);
    status
}
