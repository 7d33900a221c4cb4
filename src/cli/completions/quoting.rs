//! Quoting of words for bash. Bash inserts a completion into the line unchanged, and names of files can contain any
//! character.

use crate::plain_text::is_interpreted;

/// Returns the text, quoted for bash. Within quotes it stays unchanged, because bash quotes it and adds the `/` of a
/// directory. `None` for a text with characters that a terminal interprets.
pub(super) fn quoted(text: &str, quote: Option<Quote>) -> Option<String> {
    if text.contains(is_interpreted) {
        return None;
    }
    if quote.is_some() {
        return Some(text.strip_suffix('/').unwrap_or(text).to_owned());
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text.char_indices();
    while let Some((at, sign)) = rest.next() {
        let is_read = match sign {
            '~' | '#' => at == 0,
            // In the operator `!=` of a condition, `!` needs no quotes.
            '!' => !rest.as_str().starts_with('='),
            _ => " \\'\"`$&;|<>(){}*?^".contains(sign),
        };
        if is_read {
            out.push('\\');
        }
        out.push(sign);
    }
    Some(out)
}

/// The open quote at the end of an incomplete word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quote {
    /// `'`: every character belongs to the text.
    Single,
    /// `"`: a backslash quotes some characters.
    Double,
}

/// Returns the text of an incomplete word, and its open quote.
pub(super) fn unquoted(word: &str) -> (Option<Quote>, String) {
    let (mut quote, mut out) = (None, String::with_capacity(word.len()));
    let mut signs = word.chars().peekable();
    while let Some(sign) = signs.next() {
        match (sign, quote) {
            ('\'', None) => quote = Some(Quote::Single),
            ('"', None) => quote = Some(Quote::Double),
            ('\'', Some(Quote::Single)) | ('"', Some(Quote::Double)) => quote = None,
            ('\\', None) => out.extend(signs.next()),
            ('\\', Some(Quote::Double)) => {
                out.push(signs.next_if(|next| "\"\\$`".contains(*next)).unwrap_or(sign));
            }
            _ => out.push(sign),
        }
    }
    (quote, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_and_conditions_stay_as_they_are() {
        for text in
            ["node2.a_STAT_SL[3]", "%MB3.203968", "w_CPU_CONTROL==restart", "a!=b", "größe/x-1_2,3@4+5"]
        {
            assert_eq!(quoted(text, None).unwrap(), text);
        }
    }

    #[test]
    fn a_quoted_text_is_read_as_the_text() {
        let text = "~a b$(c)`d`;e|f&g<h>i'j\"k\\l{m,n}*o?p!q^2#r~";
        let spelled = quoted(text, None).unwrap();
        assert!(spelled.starts_with("\\~a\\ b\\$\\(c\\)\\`d\\`\\;"), "{spelled}");
        assert_eq!(unquoted(&spelled), (None, text.to_owned()));
        assert_eq!(quoted("a\nb", None), None);
    }

    #[test]
    fn a_quote_decides_what_a_backslash_means() {
        for (word, quote, text) in [
            (r#""a\$b\c\\"#, Some(Quote::Double), r"a$b\c\"),
            (r"'a\$b", Some(Quote::Single), r"a\$b"),
            (r"a\$b", None, "a$b"),
            ("\"my plants\"/", None, "my plants/"),
            ("'it'\\''s", Some(Quote::Single), "it's"),
            ("\"", Some(Quote::Double), ""),
            ("", None, ""),
            ("größe", None, "größe"),
        ] {
            assert_eq!(unquoted(word), (quote, text.to_owned()), "{word}");
        }
        assert_eq!(quoted("a b$c/", Some(Quote::Double)).unwrap(), "a b$c");
    }
}
