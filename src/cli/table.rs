//! Tables in the formats that people and programs read.

use super::{error::CliError, output};
use crate::export::{csv_line, md_table};
use clap::ValueEnum;
use serde::Serialize;

/// How a table is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Columns for people
    Text,
    /// An array of objects
    Json,
    /// Comma-separated values (RFC 4180) with a head line
    Csv,
    /// A Markdown table
    Md,
}

/// The format option, the same at all commands.
#[derive(clap::Args)]
pub(crate) struct FormatArg {
    /// Output format
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    pub format: Format,
}

/// A row of a table. JSON gets its fields, the other formats get its cells.
pub(crate) trait Row: Serialize {
    /// Heads of the columns, also the names in CSV.
    const COLUMNS: &'static [&'static str];

    /// One text per column.
    fn cells(&self) -> Vec<String>;
}

/// Prints the rows; `text` makes the text format.
///
/// # Errors
/// As [`output::print`].
pub(crate) fn print<R: Row>(
    format: Format,
    rows: &[R],
    text: impl FnOnce(&[R]) -> String,
) -> Result<(), CliError> {
    output::print(&match format {
        Format::Text => text(rows),
        Format::Json => json(rows)?,
        Format::Csv => csv(rows),
        Format::Md => markdown(rows),
    })
}

/// The rows in columns as wide as needed, under a head line.
pub(crate) fn aligned<R: Row>(rows: &[R]) -> String {
    let head = R::COLUMNS.iter().map(|column| column.to_uppercase()).collect();
    let lines: Vec<_> = std::iter::once(head).chain(rows.iter().map(Row::cells)).collect();
    columns(&lines)
}

/// Lines of cells in columns as wide as needed, two blanks between them.
pub(crate) fn columns(lines: &[Vec<String>]) -> String {
    let mut widths: Vec<usize> = Vec::new();
    for line in lines {
        widths.resize(widths.len().max(line.len()), 0);
        for (width, cell) in widths.iter_mut().zip(line) {
            *width = (*width).max(cell.chars().count());
        }
    }
    let mut text = String::new();
    for line in lines {
        let padded = line.iter().zip(&widths).map(|(cell, &width)| format!("{cell:width$}"));
        let padded = padded.collect::<Vec<_>>().join("  ");
        text.push_str(padded.trim_end());
        text.push('\n');
    }
    text
}

fn json<R: Row>(rows: &[R]) -> Result<String, CliError> {
    let mut text =
        serde_json::to_string_pretty(rows).map_err(|error| CliError::Output { reason: error.into() })?;
    text.push('\n');
    Ok(text)
}

fn csv<R: Row>(rows: &[R]) -> String {
    csv_line(R::COLUMNS) + &rows.iter().map(|row| csv_line(&row.cells())).collect::<String>()
}

fn markdown<R: Row>(rows: &[R]) -> String {
    md_table(R::COLUMNS, rows.iter().map(Row::cells))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Pair(&'static str, &'static str);

    impl Row for Pair {
        const COLUMNS: &'static [&'static str] = &["name", "text"];

        fn cells(&self) -> Vec<String> {
            vec![self.0.to_owned(), self.1.to_owned()]
        }
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_and_lines_end_without_blanks() {
        let text = aligned(&[Pair("größer", "a"), Pair("b", "")]);
        assert_eq!(text, "NAME    TEXT\ngrößer  a\nb\n");
    }

    #[test]
    fn csv_quotes_what_needs_it() {
        let text = csv(&[Pair("a,b", "say \"x\""), Pair("plain", "")]);
        assert_eq!(text, "name,text\n\"a,b\",\"say \"\"x\"\"\"\nplain,\n");
    }

    #[test]
    fn markdown_escapes_bars() {
        assert_eq!(markdown(&[Pair("a|b", "c")]), "| name | text |\n| --- | --- |\n| a\\|b | c |\n");
    }

    #[test]
    fn an_empty_table_has_a_head_and_empty_json() {
        assert_eq!(csv::<Pair>(&[]), "name,text\n");
        assert_eq!(json::<Pair>(&[]).unwrap(), "[]\n");
    }
}
