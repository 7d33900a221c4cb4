//! One list of registers: `register = [ { offset = 0, ... }, ... ]`.

use std::ops::Range;
use toml_edit::{Array, InlineTable, RawString, Value};

/// An entry with the text around it.
struct Line {
    /// The text before the entry, from the end of the previous line: comments and the indentation.
    lead: String,
    /// A comment after the entry on the same line.
    tail: String,
    offset: u32,
    entry: InlineTable,
}

/// Sets the offset of each register and adds padding for each gap. Returns nothing if an entry is no inline table.
pub(crate) fn place(list: &mut Array, offsets: &[Option<u32>], gaps: &[Range<u32>]) -> Option<()> {
    let (mut lines, end) = take_apart(list)?;
    let mut is_changed = false;
    let mut fillers: Vec<_> = gaps.iter().collect();
    let mut comments = String::new();
    let mut kept = Vec::new();
    let indent = lines.first().map_or("\n  ".to_owned(), |line| indent(&line.lead).to_owned());
    for (mut line, offset) in lines.drain(..).zip(offsets.iter().copied().chain(std::iter::repeat(None))) {
        match (offset, padding(&line.entry)) {
            (Some(offset), _) => {
                is_changed |= line.offset != offset;
                line.offset = offset;
            }
            (None, Some(bytes)) => {
                let same = |gap: &&Range<u32>| gap.start == line.offset && gap.len() == bytes as usize;
                match fillers.iter().position(same) {
                    Some(found) => drop(fillers.remove(found)),
                    None => {
                        is_changed = true;
                        comments += &remarks(&line, &indent);
                        continue;
                    }
                }
            }
            (None, None) => return None,
        }
        line.lead.insert_str(0, &std::mem::take(&mut comments));
        kept.push(line);
    }
    is_changed |= !fillers.is_empty();
    kept.extend(fillers.into_iter().map(|gap| filler(gap, &indent)));
    kept.sort_by_key(|line| line.offset);
    if is_changed {
        align(&mut kept);
        put_together(list, kept, &(comments + &end));
    }
    Some(())
}

/// Returns the lines, and the text before the closing bracket.
fn take_apart(list: &Array) -> Option<(Vec<Line>, String)> {
    let mut lines: Vec<Line> = Vec::new();
    for value in list {
        let (tail, lead) = split(value.decor().prefix()?.as_str()?);
        match lines.last_mut() {
            Some(line) => line.tail = tail.to_owned(),
            // Text between the opening bracket and the end of its line belongs to the bracket and not to an entry.
            None if !tail.is_empty() => return None,
            None => {}
        }
        let entry = value.as_inline_table()?.clone();
        let offset = entry.get("offset")?.as_integer()?.try_into().ok()?;
        lines.push(Line { lead: lead.to_owned(), tail: String::new(), offset, entry });
    }
    let last = lines.last_mut()?;
    // If no comma follows the last entry, the text after it belongs to the entry.
    let suffix = last.entry.decor().suffix().and_then(RawString::as_str).unwrap_or_default().to_owned();
    last.entry.decor_mut().set_suffix("");
    let behind = suffix + list.trailing().as_str()?;
    let (tail, end) = split(&behind);
    last.tail = tail.to_owned();
    Some((lines, end.to_owned()))
}

/// Splits into the part that still belongs to the previous line, and the rest.
fn split(between: &str) -> (&str, &str) {
    between.split_at(between.find('\n').filter(|at| !between[..*at].trim().is_empty()).unwrap_or(0))
}

fn padding(entry: &InlineTable) -> Option<i64> {
    entry.get("padding")?.as_integer()
}

/// Returns the comments at a removed line, as separate lines.
fn remarks(line: &Line, indent: &str) -> String {
    let lead = line.lead.rfind('\n').map_or("", |at| &line.lead[..at]);
    let tail = line.tail.trim();
    let tail = if tail.is_empty() { String::new() } else { format!("{indent}{tail}") };
    format!("{lead}{tail}")
}

/// Returns the line break and the blanks before an entry.
fn indent(lead: &str) -> &str {
    lead.rfind('\n').map_or("\n  ", |at| &lead[at..])
}

fn filler(gap: &Range<u32>, indent: &str) -> Line {
    let mut entry = InlineTable::new();
    entry.insert("offset", i64::from(gap.start).into());
    entry.insert("padding", i64::from(gap.end - gap.start).into());
    Line { lead: indent.to_owned(), tail: String::new(), offset: gap.start, entry }
}

/// Writes the offsets, followed by blanks that align the next keys.
fn align(lines: &mut [Line]) {
    let widest = lines.iter().map(|line| line.offset.to_string().len()).max().unwrap_or_default();
    for line in lines {
        let blanks = 1 + widest - line.offset.to_string().len();
        if let Some(old) = line.entry.get_mut("offset") {
            let mut new = Value::from(i64::from(line.offset));
            *new.decor_mut() = old.decor().clone();
            *old = new;
        }
        let mut keys = line.entry.iter_mut().map(|(key, _)| key);
        if keys.next().is_some_and(|key| key.get() == "offset")
            && let Some(mut next) = keys.next()
        {
            next.leaf_decor_mut().set_prefix(" ".repeat(blanks));
        }
    }
}

fn put_together(list: &mut Array, lines: Vec<Line>, end: &str) {
    list.clear();
    let mut tail = String::new();
    for mut line in lines {
        // A comment extends to the end of its line.
        let next_line = if tail.is_empty() || line.lead.starts_with('\n') { "" } else { "\n  " };
        line.entry.decor_mut().set_prefix(format!("{tail}{next_line}{}", line.lead));
        list.push_formatted(line.entry.into());
        tail = line.tail;
    }
    list.set_trailing_comma(true);
    list.set_trailing(format!("{tail}{end}"));
}
