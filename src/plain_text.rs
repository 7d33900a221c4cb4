//! Characters that a text in one line must not have, because a terminal or an editor interprets them.

/// True for control characters, separators of lines and paragraphs, and characters that change the direction of the text
/// (Unicode Standard Annex 9, table 4).
pub(crate) fn is_interpreted(sign: char) -> bool {
    let changes_direction = matches!(
        sign,
        '\u{61C}' | '\u{200E}' | '\u{200F}' | '\u{202A}'..='\u{202E}' | '\u{2066}'..='\u{2069}'
    );
    sign.is_control() || matches!(sign, '\u{2028}' | '\u{2029}') || changes_direction
}

/// Returns the text with a blank in place of each interpreted character.
#[cfg(any(test, feature = "emulator"))]
pub(crate) fn without_interpreted(text: &str) -> String {
    text.replace(is_interpreted, " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpreted_characters_become_blanks() {
        let text = "a\u{1b}[31mb\u{202e}c\u{2066}d\u{200f}e\u{61c}f\u{2028}g\u{85}h\u{9b}i\nj";
        assert_eq!(without_interpreted(text), "a [31mb c d e f g h i j");
        assert_eq!(without_interpreted("\u{e4} \u{5d0}"), "\u{e4} \u{5d0}", "letters of any direction stay");
    }
}
