//! Characters that an XML document may contain.

use crate::plain_text::is_interpreted;

/// Replaces each character that a document must not contain by U+FFFD.
pub(crate) fn allowed(document: String) -> String {
    if document.chars().all(is_allowed) {
        return document;
    }
    document.chars().map(|sign| if is_allowed(sign) { sign } else { char::REPLACEMENT_CHARACTER }).collect()
}

/// True if a document may contain this character. XML 1.0 (section 2.2) does not allow U+FFFE, U+FFFF and control
/// characters, except tabs and line ends, and not as references such as `&#xFFFF;` either. Other characters that a
/// terminal or an editor interprets are not allowed, because a document may be printed on a terminal.
pub(crate) fn is_allowed(sign: char) -> bool {
    matches!(sign, '\t' | '\n' | '\r') || !is_interpreted(sign) && !matches!(sign, '\u{FFFE}' | '\u{FFFF}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_forbidden_and_interpreted_characters_are_replaced() {
        let kept = "<a b=\"ä\u{5d0}\u{fffd}\u{10ffff}\">\t\r\n</a>";
        assert_eq!(allowed(kept.to_owned()), kept);
        assert_eq!(allowed("a\u{1b}b\u{fffe}c\u{ffff}\0".to_owned()), "a\u{fffd}b\u{fffd}c\u{fffd}\u{fffd}");
        assert_eq!(allowed("a\u{202e}b\u{7f}c\u{9b}".to_owned()), "a\u{fffd}b\u{fffd}c\u{fffd}");
    }
}
