//! Characters that an XML document may contain.

/// Replaces each character that XML 1.0 (section 2.2) does not allow by U+FFFD. XML does not allow U+FFFE, U+FFFF and
/// control characters, except tabs and line ends. References to these characters, such as `&#xFFFF;`, are not allowed,
/// either.
pub(crate) fn allowed(document: String) -> String {
    if document.chars().all(is_allowed) {
        return document;
    }
    document.chars().map(|sign| if is_allowed(sign) { sign } else { char::REPLACEMENT_CHARACTER }).collect()
}

/// True if an XML document may contain this character.
pub(crate) fn is_allowed(sign: char) -> bool {
    matches!(sign, '\t' | '\n' | '\r') || (sign >= ' ' && !matches!(sign, '\u{FFFE}' | '\u{FFFF}'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_characters_that_xml_does_not_allow_are_replaced() {
        let kept = "<a b=\"ä\u{7f}\u{fffd}\u{10ffff}\">\t\r\n</a>";
        assert_eq!(allowed(kept.to_owned()), kept);
        assert_eq!(allowed("a\u{1b}b\u{fffe}c\u{ffff}\0".to_owned()), "a\u{fffd}b\u{fffd}c\u{fffd}\u{fffd}");
    }
}
