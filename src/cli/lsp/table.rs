//! A position in a TOML file, which may be incomplete: the table that contains the position, and the key or value
//! there.

use core::ops::Range;

/// What the file can contain at a position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    /// The position is in a header, `[[plc]]`.
    Header,
    /// The position is in a key.
    Key,
    /// The value of the last key of the path.
    Value,
    /// No name: the position is in a comment.
    Nothing,
}

/// A position in a TOML file, with its context.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct TablePlace {
    pub(super) slot: Slot,
    /// Keys from the root of the file to the table or value at the position.
    pub(super) path: Vec<String>,
    /// Range of the word at the position, in bytes: the line of a header, a key, or a value.
    pub(super) word: Range<usize>,
    /// Other keys of the same table. In a section, these are the keys of all its other lines. In a table in braces,
    /// these are the keys before the position.
    pub(super) given: Vec<String>,
    /// The value of the key `kind` in the section.
    pub(super) kind: Option<String>,
}

/// A table or array around the position.
struct Open {
    sign: char,
    /// Length of the path at the beginning of the table or array.
    depth: usize,
    /// Keys that the enclosing table has before the position.
    given: Vec<String>,
}

impl TablePlace {
    /// Determines the context of a byte of the text.
    pub(super) fn at(text: &str, offset: usize) -> Self {
        let line_start = text[..offset].rfind('\n').map_or(0, |end| end + 1);
        let line_end = text[offset..].find('\n').map_or(text.len(), |end| offset + end);
        let line = &text[line_start..line_end];
        let (section_start, section_end, header) = section(text, line_start);
        let nothing =
            |slot| Self { slot, path: Vec::new(), word: offset..offset, given: Vec::new(), kind: None };
        // A line that begins with a bracket is a header, unless the bracket belongs to an array that continues from an
        // earlier line.
        if line.trim_start().starts_with('[') && header_of(line).is_none_or(|_| line_start >= section_start) {
            let is_continued = scan(text, section_start, line_start, &[]).open_brackets > 0;
            if !is_continued {
                let front = line.len() - line.trim_start().len();
                let word = line_start + front..line_start + line.trim_end().len();
                return Self { word, ..nothing(Slot::Header) };
            }
        }
        let scanned = scan(text, section_start, offset, &header);
        let Scanned { mut path, mut given, is_value, in_text, is_comment, open_brackets: _, is_inline } =
            scanned;
        if is_comment {
            return nothing(Slot::Nothing);
        }
        let body = &text[section_start..section_end];
        let kind = body.lines().find_map(|line| line.split_once('=').filter(|(key, _)| key.trim() == "kind"));
        let kind = kind.map(|(_, value)| {
            value.split('#').next().unwrap_or_default().trim().trim_matches(['"', '\'']).to_owned()
        });
        if !is_inline {
            let others = body.lines().filter_map(|line| Some(line.split_once('=')?.0.trim().to_owned()));
            given.extend(others);
        }
        let is_part = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '_' | '-');
        let word = match in_text {
            Some(start) => {
                let quote = text[start..].chars().next().unwrap_or('"');
                let end = text[offset..line_end].find(quote).map_or(line_end, |end| offset + end + 1);
                start..end
            }
            None => {
                let start = text[line_start..offset].trim_end_matches(is_part).len() + line_start;
                let end = offset
                    + text[offset..line_end].find(|letter| !is_part(letter)).unwrap_or(line_end - offset);
                start..end
            }
        };
        if is_value {
            return Self { slot: Slot::Value, path, word, given, kind };
        }
        // A dotted key also names tables.
        let before = text[line_start..word.start].rsplit([',', '{']).next().unwrap_or_default();
        path.extend(
            before
                .split('.')
                .map(str::trim)
                .filter(|key| !key.is_empty() && key.chars().all(is_part))
                .map(str::to_owned),
        );
        let own = &text[word.clone()];
        if let Some(index) = given.iter().position(|key| key == own) {
            given.remove(index);
        }
        Self { slot: Slot::Key, path, word, given, kind }
    }
}

/// Returns the section of a line: the first byte after the header, the end, and the names in the header.
fn section(text: &str, line_start: usize) -> (usize, usize, Vec<String>) {
    let (mut start, mut header, mut at) = (0, Vec::new(), 0);
    for line in text.split_inclusive('\n') {
        let end = at + line.len();
        if at < line_start
            && let Some(names) = header_of(line)
        {
            (start, header) = (end, names);
        } else if at > line_start && header_of(line).is_some() {
            return (start, at, header);
        }
        at = end;
    }
    (start.min(text.len()), text.len(), header)
}

/// Returns the names in a complete header, such as `[plc.drive]` or `[[bus]]`.
pub(super) fn header_of(line: &str) -> Option<Vec<String>> {
    let line = line.split('#').next().unwrap_or_default().trim();
    let inner = line.strip_prefix('[')?;
    let inner = inner.strip_prefix('[').unwrap_or(inner);
    let inner = inner.strip_suffix("]]").or_else(|| inner.strip_suffix(']'))?;
    let is_name = |name: &str| {
        !name.is_empty()
            && name.chars().all(|letter| letter.is_ascii_alphanumeric() || matches!(letter, '_' | '-'))
    };
    let names: Vec<_> = inner.split('.').map(|name| name.trim().to_owned()).collect();
    names.iter().all(|name| is_name(name)).then_some(names)
}

/// State of the parser at a position.
struct Scanned {
    path: Vec<String>,
    given: Vec<String>,
    /// True if a value is expected at the position.
    is_value: bool,
    /// Position of the opening quote, if the position is inside a text.
    in_text: Option<usize>,
    is_comment: bool,
    open_brackets: usize,
    /// True if the position is in a table in braces.
    is_inline: bool,
}

/// Parses a section from its beginning up to a position.
fn scan(text: &str, start: usize, offset: usize, header: &[String]) -> Scanned {
    let mut path = header.to_vec();
    let mut given: Vec<String> = Vec::new();
    let mut open: Vec<Open> = Vec::new();
    let (mut word, mut is_value, mut is_comment) = (String::new(), false, false);
    let mut in_text: Option<(usize, char)> = None;
    let mut letters = text[start..offset].char_indices();
    while let Some((at, letter)) = letters.next() {
        if let Some((_, quote)) = in_text {
            if letter == '\\' && quote == '"' {
                letters.next();
            } else if letter == quote || letter == '\n' {
                in_text = None;
            }
            continue;
        }
        if is_comment && letter != '\n' {
            continue;
        }
        match letter {
            '#' => is_comment = true,
            '"' | '\'' => in_text = Some((start + at, letter)),
            '=' if !is_value => {
                let key = core::mem::take(&mut word);
                path.extend(key.split('.').map(|key| key.trim().to_owned()));
                given.push(key.trim().to_owned());
                is_value = true;
            }
            '{' | '[' => {
                open.push(Open { sign: letter, depth: path.len(), given: core::mem::take(&mut given) });
                is_value &= letter == '[';
                word.clear();
            }
            '}' | ']' => {
                let sign = if letter == '}' { '{' } else { '[' };
                if open.last().is_some_and(|top| top.sign == sign)
                    && let Some(top) = open.pop()
                {
                    path.truncate(top.depth);
                    given = top.given;
                    is_value = true;
                }
            }
            ',' | '\n' => {
                is_comment = false;
                let (depth, in_array) = match open.last() {
                    Some(top) => (top.depth, top.sign == '['),
                    None => (header.len(), false),
                };
                // Inside an array or a table in braces, the end of a line counts as a blank.
                if letter == ',' || open.is_empty() {
                    if !in_array {
                        path.truncate(depth);
                    }
                    is_value = in_array;
                    word.clear();
                }
            }
            letter => word.push(letter),
        }
    }
    let is_inline = open.last().is_some_and(|top| top.sign == '{');
    Scanned {
        path,
        given,
        is_value,
        in_text: in_text.map(|(at, _)| at),
        is_comment,
        open_brackets: open.len(),
        is_inline,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str) -> (Slot, String, String) {
        let offset = text.find('|').unwrap();
        let text = text.replacen('|', "", 1);
        let place = TablePlace::at(&text, offset);
        (place.slot, place.path.join("."), text[place.word].to_owned())
    }

    #[test]
    fn places_are_keys_values_and_headers() {
        for (text, slot, path, word) in [
            ("na|me = 1", Slot::Key, "", "name"),
            ("[[plc]]\nna|", Slot::Key, "plc", "na"),
            ("[[plc]]\nname = \"a|b\"", Slot::Value, "plc.name", "\"ab\""),
            ("[plc.drive]\nsoftware = |", Slot::Value, "plc.drive.software", ""),
            ("[[plc]]\nname = \"a\"\n|", Slot::Key, "plc", ""),
            ("[[pl|", Slot::Header, "", "[[pl"),
            ("[[plc]]\na = 1 # no|", Slot::Nothing, "", ""),
            ("register = [\n  { offset = 0, na|", Slot::Key, "register", "na"),
            ("register = [\n  { offset = 0, owner = \"|\" },\n]", Slot::Value, "register.owner", "\"\""),
            ("register = [\n  { offset = 0 },\n  { |", Slot::Key, "register", ""),
            ("reserved = { owner = \"plc\" }\n|", Slot::Key, "", ""),
            ("[[a]]\nzk.z|", Slot::Key, "a.zk", "z"),
        ] {
            assert_eq!(at(text), (slot, path.to_owned(), word.to_owned()), "{text}");
        }
    }

    #[test]
    fn the_section_has_its_kind_and_its_keys() {
        let text = "[[device]]\nkind = \"can-dp2\" # x\n\nname = 'a'\n[[bus]]\nkind = \"can\"\n";
        let place = TablePlace::at(text, text.find("\n\nname").unwrap() + 1);
        assert_eq!(place.kind.as_deref(), Some("can-dp2"));
        assert!(place.given.contains(&"name".to_owned()) && place.given.contains(&"kind".to_owned()));
    }
}
