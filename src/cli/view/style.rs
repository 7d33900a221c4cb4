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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_have_the_width_that_is_asked_for() {
        assert_eq!(
            (padded("ab", 4), padded("abcdef", 4), at_right("ab", 4)),
            ("ab  ".into(), "abc…".into(), "  ab".into())
        );
        assert_eq!((cut("ab", 0), cut("ab", 1)), (String::new(), "…".to_owned()));
    }
}
