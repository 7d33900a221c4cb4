//! Quoting of words for bash. Bash inserts a completion into the line unchanged, and names of files can contain any
//! character.

/// Returns the text, quoted for bash. `None` for a text with control characters, which a command line cannot contain.
pub(super) fn quoted(text: &str) -> Option<String> {
    if text.chars().any(char::is_control) {
        return None;
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

/// Returns the text of an incomplete word, without backslashes and without the quote at its beginning.
pub(super) fn unquoted(word: &str) -> String {
    let mut out = String::with_capacity(word.len());
    let mut signs = word.strip_prefix(['"', '\'']).unwrap_or(word).chars();
    while let Some(sign) = signs.next() {
        out.extend(if sign == '\\' { signs.next() } else { Some(sign) });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_and_conditions_stay_as_they_are() {
        for text in
            ["node2.a_STAT_SL[3]", "%MB3.203968", "w_CPU_CONTROL==restart", "a!=b", "größe/x-1_2,3@4+5"]
        {
            assert_eq!(quoted(text).unwrap(), text);
        }
    }

    #[test]
    fn a_quoted_text_is_read_as_the_text() {
        let text = "~a b$(c)`d`;e|f&g<h>i'j\"k\\l{m,n}*o?p!q^2#r~";
        let spelled = quoted(text).unwrap();
        assert!(spelled.starts_with("\\~a\\ b\\$\\(c\\)\\`d\\`\\;"), "{spelled}");
        assert_eq!(unquoted(&spelled), text);
        assert_eq!(unquoted("\"begun"), "begun");
        assert_eq!(quoted("a\nb"), None);
    }
}
