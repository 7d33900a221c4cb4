//! Colours, and texts that are fitted to a width.

use ratatui::style::{Color, Modifier, Style};

/// The colours of the view; without colours important text is bold or reversed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Theme {
    /// True if the terminal gets colours.
    pub has_colours: bool,
}

impl Theme {
    fn of(self, colour: Color) -> Style {
        if self.has_colours { Style::new().fg(colour) } else { Style::new() }
    }

    pub(super) fn plain(self) -> Style {
        Style::new()
    }

    pub(super) fn head(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    /// Style of less important text.
    pub(super) fn dim(self) -> Style {
        self.of(Color::DarkGray)
    }

    pub(super) fn good(self) -> Style {
        self.of(Color::Green)
    }

    pub(super) fn warning(self) -> Style {
        self.of(Color::Yellow).add_modifier(Modifier::BOLD)
    }

    pub(super) fn bad(self) -> Style {
        self.of(Color::Red).add_modifier(Modifier::BOLD)
    }

    pub(super) fn name(self) -> Style {
        self.of(Color::Cyan)
    }

    pub(super) fn value(self) -> Style {
        self.of(Color::Yellow)
    }

    /// Style of the selected line in the list that has the keyboard focus.
    pub(super) fn chosen(self) -> Style {
        Style::new().add_modifier(Modifier::REVERSED)
    }

    /// Style of the selected line in any other list.
    pub(super) fn also_chosen(self) -> Style {
        Style::new().add_modifier(Modifier::UNDERLINED)
    }
}

/// Cuts a text to a width. The last character of a text that was cut is a mark.
pub(super) fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    if width == 0 { kept } else { kept + "\u{2026}" }
}

/// Returns the text in exactly `width` columns.
pub(super) fn padded(text: &str, width: usize) -> String {
    let text = cut(text, width);
    format!("{text:width$}")
}

/// Returns the text in exactly `width` columns, right-aligned.
pub(super) fn at_right(text: &str, width: usize) -> String {
    let text = cut(text, width);
    format!("{text:>width$}")
}

/// Fits a name into a width. A long name is cut in its middle: registers often differ only in the index or the field at
/// the end.
pub(super) fn cut_name(name: &str, width: usize) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= width {
        return name.to_owned();
    }
    let Some(room) = width.checked_sub(1) else { return String::new() };
    let last = letters.iter().rposition(|letter| *letter == '[').map_or(0, |at| letters.len() - at);
    let kept_end = last.max(room / 2).min(room);
    let (front, end) = (&letters[..room - kept_end], &letters[letters.len() - kept_end..]);
    front.iter().chain(&['\u{2026}']).chain(end).collect()
}

/// Wraps a text between words into at most `most` lines of `width` columns. A long text is cut in its
/// middle.
pub(super) fn wrapped(text: &str, width: usize, most: usize) -> Vec<String> {
    let (width, most) = (width.max(1), most.max(1));
    let (mut text, mut room) = (text.to_owned(), width * most);
    loop {
        let lines = broken(&text, width);
        if lines.len() <= most || room == 0 {
            return lines;
        }
        let letters = text.chars().count();
        let (front, end) = (room / 2, (room / 2).saturating_sub(1));
        let part = |from: usize, len: usize| text.chars().skip(from).take(len).collect::<String>();
        text = format!("{}\u{2026}{}", part(0, front), part(letters.saturating_sub(end), end));
        // Leaves room for unused columns: lines that end between words are not full.
        room -= (width / 4).clamp(1, room);
    }
}

/// Breaks a text into lines of `width` columns, between words where possible.
fn broken(text: &str, width: usize) -> Vec<String> {
    let (mut lines, mut line) = (Vec::new(), Vec::<char>::new());
    for word in text.split_whitespace() {
        let word: Vec<char> = word.chars().collect();
        if !line.is_empty() {
            if line.len() + 1 + word.len() > width {
                lines.push(core::mem::take(&mut line));
            } else {
                line.push(' ');
            }
        }
        line.extend(word);
        while line.len() > width {
            let rest = line.split_off(width);
            lines.push(core::mem::replace(&mut line, rest));
        }
    }
    lines.push(line);
    lines.into_iter().map(String::from_iter).collect()
}

/// Returns the name in exactly `width` columns.
pub(super) fn padded_name(name: &str, width: usize) -> String {
    let name = cut_name(name, width);
    format!("{name:width$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_their_end() {
        assert_eq!(cut_name("node2.a_CONTROLWORD_SL[1]", 18), "node2.a_C…RD_SL[1]");
        assert_eq!(cut_name("node2.a_CFG_RDC_WORD[1].b_CFG_RDC1_WORD0", 28), "node2.a…[1].b_CFG_RDC1_WORD0");
        assert_eq!(padded_name("line:node2.a[1]", 16), "line:node2.a[1] ");
        assert_eq!((cut_name("ab", 0), cut_name("ab", 1)), (String::new(), "…".to_owned()));
    }

    #[test]
    fn long_texts_take_lines_and_keep_their_end() {
        assert_eq!(wrapped("one two three", 80, 6), ["one two three"]);
        assert_eq!(wrapped("one two three", 8, 6), ["one two", "three"]);
        assert_eq!(wrapped("abcdefghij k", 4, 6), ["abcd", "efgh", "ij k"]);
        assert_eq!(wrapped("", 4, 1), [""]);
        let long = format!("begin {} end", "word ".repeat(100));
        let lines = wrapped(&long, 20, 3);
        assert!(lines.len() <= 3 && lines.iter().all(|line| line.chars().count() <= 20), "{lines:?}");
        assert!(lines[0].starts_with("begin") && lines.last().unwrap().ends_with("end"), "{lines:?}");
        assert!(lines.concat().contains('\u{2026}'), "{lines:?}");
    }

    #[test]
    fn texts_have_the_requested_width() {
        assert_eq!(
            (padded("ab", 4), padded("abcdef", 4), at_right("ab", 4)),
            ("ab  ".into(), "abc…".into(), "  ab".into())
        );
        assert_eq!((cut("ab", 0), cut("ab", 1)), (String::new(), "…".to_owned()));
    }
}
