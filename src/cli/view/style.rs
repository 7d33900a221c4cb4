//! Colours, and texts that fit.

use ratatui::style::{Color, Modifier, Style};

/// The colours there are; without any, what matters is bold or reversed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Theme {
    /// Whether the terminal is to get colours.
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

    /// What is there to be looked at only if it is needed.
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

    /// Names of blocks and the like.
    pub(super) fn name(self) -> Style {
        self.of(Color::Cyan)
    }

    /// Values.
    pub(super) fn value(self) -> Style {
        self.of(Color::Yellow)
    }

    /// The chosen line of the list that the keys go to.
    pub(super) fn chosen(self) -> Style {
        Style::new().add_modifier(Modifier::REVERSED)
    }

    /// The chosen line of another list.
    pub(super) fn also_chosen(self) -> Style {
        Style::new().add_modifier(Modifier::UNDERLINED)
    }
}

/// The text, if need be cut, with a sign for that.
pub(super) fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    if width == 0 { kept } else { kept + "\u{2026}" }
}

/// The text in exactly so many columns.
pub(super) fn padded(text: &str, width: usize) -> String {
    let text = cut(text, width);
    format!("{text:width$}")
}

/// The same at the right.
pub(super) fn at_right(text: &str, width: usize) -> String {
    let text = cut(text, width);
    format!("{text:>width$}")
}

/// A name that fits: if need be it is cut in its middle, since its index and its field at the end tell registers apart.
pub(super) fn cut_name(name: &str, width: usize) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= width {
        return name.to_owned();
    }
    let Some(room) = width.checked_sub(1) else { return String::new() };
    let last = letters.iter().rposition(|letter| *letter == '[').map_or(0, |at| letters.len() - at);
    let behind = last.max(room / 2).min(room);
    let (front, end) = (&letters[..room - behind], &letters[letters.len() - behind..]);
    front.iter().chain(&['\u{2026}']).chain(end).collect()
}

/// The name in exactly so many columns.
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
    fn texts_have_the_width_that_is_asked_for() {
        assert_eq!(
            (padded("ab", 4), padded("abcdef", 4), at_right("ab", 4)),
            ("ab  ".into(), "abc…".into(), "  ab".into())
        );
        assert_eq!((cut("ab", 0), cut("ab", 1)), (String::new(), "…".to_owned()));
    }
}
