//! The text of an open document. Positions are bytes in this program, but lines and UTF-16 units in the protocol.

use core::ops::Range;
use lsp_types::{Position, TextDocumentContentChangeEvent};

/// The text of a document, with the positions of its lines.
pub(super) struct Text {
    text: String,
    /// Position of each line's first byte. A line ends with `\n`, `\r\n` or `\r`.
    starts: Vec<usize>,
}

impl Text {
    pub(super) fn new(text: String) -> Self {
        let starts = starts(&text);
        Self { text, starts }
    }

    pub(super) fn as_str(&self) -> &str {
        &self.text
    }

    /// Applies a change of the editor, which replaces the whole text or a range of it.
    pub(super) fn apply(&mut self, change: TextDocumentContentChangeEvent) {
        match change.range {
            None => self.text = change.text,
            Some(range) => {
                let (start, end) = (self.offset(range.start), self.offset(range.end));
                self.text.replace_range(start.min(end)..start.max(end), &change.text);
            }
        }
        self.starts = starts(&self.text);
    }

    /// Converts a position of the protocol to a byte. A position beyond the end of its line means the end of the line, and
    /// a line beyond the text means the end of the text. A position within a surrogate pair means the beginning of the
    /// character.
    pub(super) fn offset(&self, position: Position) -> usize {
        let Some(start) = self.starts.get(position.line as usize).copied() else { return self.text.len() };
        let line = self.text[start..self.end_of(position.line as usize)].trim_end_matches(['\r', '\n']);
        let mut units = 0;
        for (at, letter) in line.char_indices() {
            units += letter.len_utf16();
            if units > position.character as usize {
                return start + at;
            }
        }
        start + line.len()
    }

    /// Converts a byte to a position of the protocol. The byte must be the beginning of a character or the end of the
    /// text.
    pub(super) fn position(&self, offset: usize) -> Position {
        let line = self.starts.partition_point(|start| *start <= offset).saturating_sub(1);
        let before = self.text.get(self.starts[line]..offset).unwrap_or_default();
        let units = before.encode_utf16().count();
        Position::new(u32::try_from(line).unwrap_or(u32::MAX), u32::try_from(units).unwrap_or(u32::MAX))
    }

    pub(super) fn range(&self, range: &Range<usize>) -> lsp_types::Range {
        lsp_types::Range::new(self.position(range.start), self.position(range.end))
    }

    /// Returns the range of a line, without blanks at its ends. Lines are counted from 1 and end only at `\n`, as in the
    /// error messages of commram. `None`, or a line that does not exist, means the last line that is not empty.
    pub(super) fn line(&self, number: Option<usize>) -> Range<usize> {
        let lines = || {
            self.text.split_inclusive('\n').scan(0, |at, line| {
                let start = *at;
                *at += line.len();
                Some((start, line))
            })
        };
        let found = number.and_then(|number| lines().nth(number.checked_sub(1)?));
        let (start, line) =
            found.or_else(|| lines().filter(|(_, line)| !line.trim().is_empty()).last()).unwrap_or_default();
        let front = start + line.len() - line.trim_start().len();
        front..front + line.trim().len()
    }

    /// Returns the byte at a line and a column. Both count from 1, and columns count characters.
    pub(super) fn byte_at(&self, line: usize, column: usize) -> usize {
        let start = match line.checked_sub(2) {
            None => 0,
            Some(ends) => self.text.match_indices('\n').nth(ends).map_or(self.text.len(), |(at, _)| at + 1),
        };
        let rest = &self.text[start..];
        let at = rest.char_indices().nth(column.saturating_sub(1)).map_or(rest.len(), |(at, _)| at);
        start + rest.find('\n').map_or(at, |end| at.min(end))
    }

    fn end_of(&self, line: usize) -> usize {
        self.starts.get(line + 1).copied().unwrap_or(self.text.len())
    }
}

fn starts(text: &str) -> Vec<usize> {
    let bytes = text.as_bytes();
    let ends = |(at, byte): (usize, &u8)| match byte {
        b'\n' => Some(at + 1),
        b'\r' if bytes.get(at + 1) != Some(&b'\n') => Some(at + 1),
        _ => None,
    };
    [0].into_iter().chain(bytes.iter().enumerate().filter_map(ends)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(from: (u32, u32), to: (u32, u32), text: &str) -> TextDocumentContentChangeEvent {
        let range = lsp_types::Range::new(Position::new(from.0, from.1), Position::new(to.0, to.1));
        TextDocumentContentChangeEvent { range: Some(range), range_length: None, text: text.to_owned() }
    }

    #[test]
    fn positions_count_units_of_utf_16() {
        let text = Text::new("a\u{1F980}b\r\nü\rx\n".to_owned());
        // The crab emoji has four bytes in UTF-8 and two units in UTF-16.
        for (position, offset) in
            [((0, 0), 0), ((0, 1), 1), ((0, 3), 5), ((1, 1), 10), ((2, 1), 12), ((3, 0), 13)]
        {
            let position = Position::new(position.0, position.1);
            assert_eq!((text.offset(position), text.position(offset)), (offset, position));
        }
        assert_eq!(text.offset(Position::new(0, 2)), 1, "within the surrogate pair");
        assert_eq!(text.offset(Position::new(0, 99)), 6, "before the end of the line");
        assert_eq!(text.offset(Position::new(99, 0)), text.as_str().len());
    }

    #[test]
    fn changes_replace_a_range_or_everything() {
        let mut text = Text::new("one\ntwo\r\nthree".to_owned());
        text.apply(change((0, 3), (1, 0), " "));
        text.apply(change((0, 4), (0, 7), "2"));
        assert_eq!(text.as_str(), "one 2\r\nthree");
        // The ends of a range may be swapped, or lie outside of the text.
        text.apply(change((9, 9), (1, 0), "3"));
        assert_eq!(text.as_str(), "one 2\r\n3");
        text.apply(TextDocumentContentChangeEvent {
            range: None,
            range_length: None,
            text: "new".to_owned(),
        });
        assert_eq!(text.as_str(), "new");
    }

    #[test]
    fn lines_of_the_readers_end_at_line_feeds() {
        let text = Text::new("one\r\n  two\r\n\n".to_owned());
        assert_eq!(&text.as_str()[text.line(Some(2))], "two");
        assert_eq!(&text.as_str()[text.line(Some(7))], "two");
        assert_eq!(&text.as_str()[text.line(None)], "two");
        assert_eq!((text.byte_at(2, 3), text.byte_at(1, 99), text.byte_at(99, 1)), (7, 4, 13));
        assert_eq!(Text::new(String::new()).line(None), 0..0);
    }
}
