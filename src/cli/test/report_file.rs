//! Reports that `--report` writes.

use super::html;
use super::line::Line;
use super::origin::Origin;
use super::selection::Shard;
use crate::cli::error::CliError;
use crate::cli::file_name;
use crate::cli::output;
use crate::script::Report;
use std::fmt;
use std::io;
use std::path::PathBuf;

/// Kind of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReportKind {
    /// A page for people.
    Html,
    /// The objects of `--format json`, each with the data of the page.
    Json,
}

impl ReportKind {
    fn name(self) -> &'static str {
        match self {
            ReportKind::Html => "html",
            ReportKind::Json => "json",
        }
    }
}

/// A report: its kind and its file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ReportFile {
    pub(super) kind: ReportKind,
    pub(super) path: PathBuf,
}

impl ReportFile {
    /// Parses `html`, `html=FILE`, `json` or `json=FILE`.
    ///
    /// # Errors
    /// The text names another kind of report, or has no file after `=`.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let (name, file) = text.split_once('=').map_or((text, None), |(name, file)| (name, Some(file)));
        let kind = [ReportKind::Html, ReportKind::Json].into_iter().find(|kind| kind.name() == name);
        match (kind, file) {
            (Some(kind), None) => Ok(Self { kind, path: format!("commram-report.{name}").into() }),
            (Some(kind), Some(file)) if !file.is_empty() => {
                let path = PathBuf::from(file);
                file_name::check(&path)?;
                Ok(Self { kind, path })
            }
            _ => Err(
                "write html, or html=FILE, json or json=FILE; the option --junit writes a report for CI servers"
                    .to_owned(),
            ),
        }
    }

    /// Returns the text of the report.
    ///
    /// # Errors
    /// The report cannot be represented in JSON, which does not happen.
    pub(super) fn content(&self, reports: &[Report], shard: Option<Shard>) -> Result<String, CliError> {
        match self.kind {
            ReportKind::Html => Ok(html::page(reports, &Origin::of_this_run())),
            ReportKind::Json => {
                let lines = reports.iter().map(|report| Line::with_page(report, shard));
                let failed = |reason: serde_json::Error| CliError::File {
                    path: self.path.clone(),
                    reason: io::Error::other(reason),
                };
                output::json(&lines.collect::<Result<Vec<_>, _>>().map_err(failed)?)
            }
        }
    }
}

impl fmt::Display for ReportFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.kind.name(), self.path.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_has_a_kind_and_a_file() {
        let shown = |text: &str| ReportFile::parse(text).map(|file| file.to_string());
        assert_eq!(shown("html").unwrap(), "html=commram-report.html");
        assert_eq!(shown("json=a=b.json").unwrap(), "json=a=b.json");
        assert!(["", "pdf", "html=", "json=", "xml=x"].iter().all(|text| shown(text).is_err()));
    }
}
