//! Output of tables in the formats for people and programs.

use super::{error::CliError, output, style};
use crate::export::{csv_line, markdown_text, md_table};
use clap::ValueEnum;
use core::borrow::Borrow;
use serde::Serialize;

/// Output format of a table.
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

/// The format option, the same for all commands.
#[derive(clap::Args)]
pub(crate) struct FormatArg {
    /// Output format
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    pub format: Format,
}

/// A row of a table. JSON uses its fields, the other formats use its cells.
pub(crate) trait Row: Serialize {
    /// Column names for CSV and JSON; the text format shows them without the unit.
    const COLUMNS: &'static [&'static str];

    /// Returns the cells of the row, one text per column.
    fn cells(&self) -> Vec<String>;

    /// Returns the cells for the text format, which can omit the last columns.
    fn text_cells(&self) -> Vec<String> {
        self.cells()
    }
}

/// Prints the rows; `text` produces the text format.
///
/// # Errors
/// Returns the errors of [`output::print`].
pub(crate) fn print<R: Row>(
    format: Format,
    rows: &[R],
    text: impl FnOnce(&[R]) -> String,
) -> Result<(), CliError> {
    match format {
        Format::Text => output::page(&text(rows)),
        Format::Json | Format::Csv => stream::<R>(format, rows.iter()),
        Format::Md => output::print(&markdown(rows)),
    }
}

/// Prints rows like [`print()`], but does not keep them in memory in the formats for programs.
///
/// # Errors
/// Returns the errors of [`output::print`].
pub(crate) fn print_each<R: Row>(
    format: Format,
    rows: impl Iterator<Item = R>,
    text: impl FnOnce(&[R]) -> String,
) -> Result<(), CliError> {
    match format {
        Format::Json | Format::Csv => stream::<R>(format, rows),
        Format::Text | Format::Md => print(format, &rows.collect::<Vec<_>>(), text),
    }
}

/// Prints rows as JSON or CSV.
fn stream<R: Row>(format: Format, rows: impl Iterator<Item: Borrow<R>>) -> Result<(), CliError> {
    match in_pieces::<R>(format, rows, |piece| output::print_while_read(piece.as_bytes())) {
        Err(CliError::BrokenPipe) => Ok(()),
        other => other,
    }
}

/// Number of bytes after which rows are written.
const PIECE: usize = 1 << 18;

/// Formats rows as JSON or CSV and passes the text to `write`, piece by piece.
fn in_pieces<R: Row>(
    format: Format,
    rows: impl Iterator<Item: Borrow<R>>,
    mut write: impl FnMut(&str) -> Result<(), CliError>,
) -> Result<(), CliError> {
    let is_json = format == Format::Json;
    let mut piece = if is_json { "[".to_owned() } else { csv_line(R::COLUMNS) };
    let (mut before, mut end) = ("\n  ", "]\n");
    for row in rows {
        let row: &R = row.borrow();
        if is_json {
            piece.push_str(before);
            piece.push_str(&output::json(row)?.trim_end().replace('\n', "\n  "));
            (before, end) = (",\n  ", "\n]\n");
        } else {
            piece.push_str(&csv_line(&harmless(&row.cells())));
        }
        if piece.len() >= PIECE {
            write(&piece)?;
            piece.clear();
        }
    }
    if is_json {
        piece.push_str(end);
    }
    write(&piece)
}

/// Returns the rows in a format; `text` produces the text format.
///
/// # Errors
/// Returns the errors of [`output::json`].
pub(crate) fn formatted<R: Row>(
    format: Format,
    rows: &[R],
    text: impl FnOnce(&[R]) -> String,
) -> Result<String, CliError> {
    let mut all = String::new();
    match format {
        Format::Text => all = text(rows),
        Format::Md => all = markdown(rows),
        Format::Json | Format::Csv => in_pieces::<R>(format, rows.iter(), |piece| {
            all.push_str(piece);
            Ok(())
        })?,
    }
    Ok(all)
}

/// Returns the rows in aligned columns below a heading.
pub(crate) fn aligned<R: Row>(rows: &[R]) -> String {
    let lines: Vec<_> = rows.iter().map(Row::text_cells).collect();
    let count = lines.first().map_or(R::COLUMNS.len(), Vec::len);
    let head = |column: &&str| column.strip_suffix("_us").unwrap_or(column).replace('_', " ").to_uppercase();
    let head = R::COLUMNS.iter().take(count).map(head).collect();
    with_head(head, lines)
}

/// Returns lines of cells in columns below a heading.
pub(crate) fn with_head(head: Vec<String>, lines: Vec<Vec<String>>) -> String {
    let lines: Vec<_> = std::iter::once(head).chain(lines).collect();
    let mut rows = rows(&lines).into_iter();
    let head = rows.next().map(|head| style::head(&head) + "\n").unwrap_or_default();
    head + &rows.map(|row| row + "\n").collect::<String>()
}

/// Returns lines of cells in aligned columns, two blanks between them.
pub(crate) fn columns(lines: &[Vec<String>]) -> String {
    rows(lines).into_iter().map(|row| row + "\n").collect()
}

/// Aligns cells as [`columns`] does, and returns one text per row. On a terminal a long row continues in further lines.
pub(crate) fn rows(lines: &[Vec<String>]) -> Vec<String> {
    within(lines, style::width())
}

/// Minimum width of the last column, if its text is wrapped inside the column.
const NARROW: usize = 24;
/// Greatest width to which a column is padded. A longer cell moves the rest of its own row only.
const WIDE: usize = 1000;
/// Indentation of the further lines of a row.
const INDENT: usize = 4;

fn within(lines: &[Vec<String>], most: Option<usize>) -> Vec<String> {
    let lines = &lines.iter().map(|line| harmless(line)).collect::<Vec<_>>();
    let mut widths: Vec<usize> = Vec::new();
    for line in lines {
        widths.resize(widths.len().max(line.len()), 0);
        for (width, cell) in widths.iter_mut().zip(line) {
            *width = (*width).max(cell.chars().count().min(WIDE));
        }
    }
    let padded = |line: &[String]| {
        let padded = line.iter().zip(&widths).map(|(cell, &width)| format!("{cell:width$}"));
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let end_of = |count: usize| widths.iter().take(count).sum::<usize>() + 2 * count.saturating_sub(1);
    let Some(most) = most.filter(|most| end_of(widths.len()) > *most) else {
        return lines.iter().map(|line| padded(line)).collect();
    };
    let (before_last, last) = (widths.len().saturating_sub(1), end_of(widths.len() - 1) + 2);
    if before_last > 0 && last + NARROW <= most {
        let row = |line: &Vec<String>| {
            let (front, text) = line.split_at(before_last.min(line.len()));
            let text = wrapped(text.first().map_or("", String::as_str), most - last);
            let front = padded(front);
            let joined = text.join(&format!("\n{:last$}", ""));
            if joined.is_empty() { front } else { format!("{front:width$}{joined}", width = last) }
        };
        return lines.iter().map(row).collect();
    }
    // Finds how many columns fit. The remaining cells go into the lines below.
    let fitting = (1..=widths.len()).rev().find(|count| end_of(*count) <= most).unwrap_or(1);
    let row = |line: &Vec<String>| {
        let (front, rest) = line.split_at(fitting.min(line.len()));
        let rest: Vec<_> = rest.iter().map(String::as_str).filter(|cell| !cell.is_empty()).collect();
        let below = wrapped(&rest.join("; "), most.saturating_sub(INDENT).max(NARROW));
        let below = below.into_iter().map(|text| format!("\n{:INDENT$}{text}", ""));
        padded(front) + &below.collect::<String>()
    };
    lines.iter().map(row).collect()
}

/// Wraps a text into lines of at most `most` characters. A longer word is a line of its own.
fn wrapped(text: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn markdown<R: Row>(rows: &[R]) -> String {
    let cells = |row: &R| harmless(&row.cells()).iter().map(|cell| markdown_text(cell)).collect();
    md_table(R::COLUMNS, rows.iter().map(cells))
}

/// Escapes characters that a terminal interprets. Text, CSV and Markdown use the same cells.
fn harmless(cells: &[String]) -> Vec<String> {
    cells.iter().map(|cell| output::harmless(cell)).collect()
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

    /// A text of any length can come from a file of the user.
    #[test]
    fn a_very_long_cell_does_not_pad_the_other_rows() {
        let long = "x".repeat(100_000);
        let cells = |line: &[&str]| line.iter().map(|cell| (*cell).to_owned()).collect::<Vec<_>>();
        let lines = [cells(&[&long, "a"]), cells(&["b", "c"])];
        let expected = [format!("{long}  a"), format!("{:WIDE$}  c", "b")];
        assert_eq!(within(&lines, None), expected);
        assert!(within(&lines, Some(80)).iter().all(|row| row.chars().count() < long.len() + 100));
    }

    #[test]
    fn rows_are_written_while_they_are_made() {
        let rows = [Pair("a", "\n\u{9b}"), Pair("[]", ""), Pair("c", "\u{e9}")];
        for count in 0..=rows.len() {
            let some = &rows[..count];
            let whole = output::json(&some).unwrap();
            assert_eq!(formatted(Format::Json, some, |_| String::new()).unwrap(), whole);
        }
        assert_eq!(csv(&rows[1..2]), "name,text\n[],\n");
        for format in [Format::Json, Format::Csv] {
            let made = core::cell::Cell::new(0);
            let many = (0..100_000).map(|number| {
                made.set(number);
                Pair("name", "text")
            });
            let mut at = Vec::new();
            in_pieces::<Pair>(format, many, |piece| {
                assert!(piece.len() < 2 * PIECE);
                at.push(made.get());
                Ok(())
            })
            .unwrap();
            assert!(at.len() > 2 && at[0] < 30_000 && at.is_sorted(), "{at:?}");
        }
    }

    fn csv<R: Row>(rows: &[R]) -> String {
        formatted(Format::Csv, rows, |_| String::new()).unwrap()
    }

    fn lines(text: &[&[&str]]) -> Vec<Vec<String>> {
        text.iter().map(|line| line.iter().map(|cell| (*cell).to_owned()).collect()).collect()
    }

    #[test]
    fn on_a_terminal_the_last_column_is_wrapped_inside_the_column() {
        let table = lines(&[&["name", "one two three four five six seven"], &["n", ""]]);
        assert_eq!(within(&table, Some(80)).join("\n"), "name  one two three four five six seven\nn");
        assert_eq!(within(&table, Some(30)).join("\n"), "name  one two three four five\n      six seven\nn");
    }

    #[test]
    fn cells_that_do_not_fit_continue_in_the_lines_below() {
        let table = lines(&[&["a_long_name", "WORD", "p. 149", "", "one two three four five six"]]);
        assert_eq!(
            within(&table, Some(20)).join("\n"),
            "a_long_name  WORD\n    p. 149; one two three\n    four five six"
        );
        for width in [10, 20, 40] {
            assert!(within(&lines(&[&["a_very_long_name_indeed"]]), Some(width)).len() == 1);
        }
    }

    #[test]
    fn csv_quotes_special_characters() {
        let text = csv(&[Pair("a,b", "say \"x\""), Pair("plain", "")]);
        assert_eq!(text, "name,text\n\"a,b\",\"say \"\"x\"\"\"\nplain,\n");
    }

    #[test]
    fn csv_and_markdown_spell_control_characters_as_the_text_format_does() {
        let pair = || [Pair("a", "\x1b[2J\u{9b}\u{202e}")];
        for text in [csv(&pair()), aligned(&pair())] {
            assert!(text.contains("\\u{1b}[2J\\u{9b}\\u{202e}"), "{text:?}");
        }
        // Markdown has an entity in place of each brace, because some programs expand two adjacent braces as a
        // template.
        let text = markdown(&pair());
        assert!(text.contains("\\u&#123;1b}[2J\\u&#123;9b}\\u&#123;202e}"), "{text:?}");
    }

    #[test]
    fn texts_are_no_markup_and_no_formulas() {
        let pair = [Pair("<b>", "=1+1"), Pair("-5", "[a](b)")];
        assert_eq!(markdown(&pair), "| name | text |\n| --- | --- |\n| &lt;b> | =1+1 |\n| -5 | [a\\](b) |\n");
        assert_eq!(csv(&pair), "name,text\n<b>,'=1+1\n-5,[a](b)\n");
    }

    #[test]
    fn markdown_escapes_bars() {
        assert_eq!(markdown(&[Pair("a|b", "c")]), "| name | text |\n| --- | --- |\n| a\\|b | c |\n");
    }

    #[test]
    fn an_empty_table_has_a_head_and_empty_json() {
        assert_eq!(csv::<Pair>(&[]), "name,text\n");
        assert_eq!(output::json(&[(); 0]).unwrap(), "[]\n");
    }
}
