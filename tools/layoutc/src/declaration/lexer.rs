//! Cuts IEC 61131-3 text into words, numbers and symbols; comments and pragmas are omitted.

use super::error::{Fault, TextPosition, Wrong};

/// The tokens of the text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Token<'a> {
    /// A name or keyword.
    Word(&'a str),
    /// A number as written, including base and underscores.
    Number(&'a str),
    /// The address of a variable: `%MB3.200000`.
    Direct,
    /// The token is a string literal.
    Text,
    /// Any other symbol.
    Symbol(&'static str),
    /// End of the text.
    End,
}

/// The symbols of the language. A longer symbol precedes a shorter one with which it begins, because the lexer takes
/// the first match.
const SYMBOLS: [&str; 26] = [
    ":=", "..", "=>", "<=", ">=", "<>", "**", ":", ";", ",", "(", ")", "[", "]", ".", "+", "-", "#", "*",
    "/", "=", "<", ">", "&", "^", "@",
];
/// Begin and end of skipped text. MULTIPROG exports descriptions in any language between two comments.
const SKIPPED: [(&str, &str, &str); 4] = [
    ("(*@KEY@:DESCRIPTION*)", "(*@KEY@:END_DESCRIPTION*)", "description"),
    ("(*", "*)", "comment"),
    ("/*", "*/", "comment"),
    ("{", "}", "pragma"),
];

/// Reads the tokens in order.
#[derive(Clone)]
pub(crate) struct Lexer<'a> {
    rest: &'a str,
    place: TextPosition,
    /// True if `(*` in a comment begins a nested comment, as in the third edition of the standard. Earlier editions do
    /// not nest comments. The lexer first assumes nested comments. If a comment then has no end, it assumes that
    /// comments do not nest.
    nests: bool,
    /// The alignment of the last `{attribute 'pack_mode' := '1'}`, which applies to the next structure.
    pub pack: Option<u32>,
}

impl<'a> Lexer<'a> {
    /// Creates a lexer that begins at `place` of the file.
    pub(crate) fn new(text: &'a str, place: TextPosition) -> Self {
        Self { rest: text, place, nests: true, pack: None }
    }

    /// Continues after the next word `end` outside of comments and strings. Returns false if there is none. The skipped
    /// text can be in any language.
    pub(crate) fn skip_past(&mut self, end: &str) -> Result<bool, Fault> {
        loop {
            self.skip()?;
            let Some(first) = self.rest.chars().next() else { return Ok(false) };
            let length = match first {
                _ if is_name(first) => word_length(self.rest),
                '\'' | '"' => match string_length(self.rest, first) {
                    Some(length) => length,
                    // An apostrophe without a partner does not begin a string; it is a part of a text.
                    None => self.rest.find('\n').unwrap_or(self.rest.len()),
                },
                _ => first.len_utf8(),
            };
            if self.take(length).eq_ignore_ascii_case(end) {
                return Ok(true);
            }
        }
    }

    /// Returns the next token and its place.
    pub(crate) fn next(&mut self) -> Result<(TextPosition, Token<'a>), Fault> {
        self.skip()?;
        let place = self.place;
        let Some(first) = self.rest.chars().next() else { return Ok((place, Token::End)) };
        let token = match first {
            _ if is_name(first) && !first.is_ascii_digit() => Token::Word(self.take(word_length(self.rest))),
            '0'..='9' => Token::Number(self.take(number_length(self.rest))),
            '%' => {
                let length = 1 + direct_length(&self.rest[1..]);
                self.take(length);
                Token::Direct
            }
            '\'' | '"' => {
                let length = string_length(self.rest, first);
                self.take(length.ok_or((place, Wrong::Unfinished("string")))?);
                Token::Text
            }
            _ if self.rest.starts_with("*)") => return Err((place, Wrong::NoComment)),
            _ => match SYMBOLS.iter().find(|symbol| self.rest.starts_with(**symbol)) {
                Some(symbol) => {
                    self.take(symbol.len());
                    Token::Symbol(symbol)
                }
                None => return Err((place, Wrong::Character(first))),
            },
        };
        Ok((place, token))
    }

    /// Skips blanks, comments and pragmas.
    fn skip(&mut self) -> Result<(), Fault> {
        loop {
            let blanks = self.rest.len() - self.rest.trim_start().len();
            self.take(blanks);
            if self.rest.starts_with("//") {
                self.take(self.rest.find('\n').unwrap_or(self.rest.len()));
            } else if let Some((begin, end, what)) =
                SKIPPED.iter().find(|(begin, ..)| self.rest.starts_with(begin))
            {
                let inside = &self.rest[begin.len()..];
                let may_nest = self.nests && *begin == "(*";
                let nested = may_nest.then(|| nested_length(inside)).flatten();
                self.nests &= may_nest == nested.is_some();
                let Some(length) = nested.or_else(|| inside.find(end)) else {
                    return Err((self.place, Wrong::Unfinished(what)));
                };
                if *begin == "{" {
                    self.pack = pack_mode(&inside[..length]).or(self.pack);
                }
                self.take(begin.len() + length + end.len());
            } else {
                return Ok(());
            }
        }
    }

    /// Advances by `bytes`. The new position must be between two characters.
    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        taken.chars().for_each(|c| self.place.advance(c));
        self.rest = rest;
        taken
    }
}

fn is_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn word_length(text: &str) -> usize {
    text.find(|c: char| !is_name(c)).unwrap_or(text.len())
}

/// Returns the length of a string literal, which ends on its line; `$` escapes the next character.
fn string_length(text: &str, quote: char) -> Option<usize> {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            '\n' => break,
            _ if escaped => escaped = false,
            '$' => escaped = true,
            _ if c == quote => return Some(at + c.len_utf8()),
            _ => {}
        }
    }
    None
}

/// Returns the length of a comment with nested comments, up to its `*)`.
fn nested_length(inside: &str) -> Option<usize> {
    let bytes = inside.as_bytes();
    let mut depth = 0;
    let mut at = 0;
    loop {
        match bytes.get(at..at + 2)? {
            b"*)" if depth == 0 => return Some(at),
            b"*)" => depth -= 1,
            b"(*" => depth += 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
    }
}

/// Returns the value of `attribute 'pack_mode' := '2'`. 0 means the same as 1: no gaps.
fn pack_mode(pragma: &str) -> Option<u32> {
    let (name, value) = pragma.split_once(":=")?;
    let name = name.trim().strip_prefix("attribute")?.trim();
    let is_it = name.trim_matches('\'').eq_ignore_ascii_case("pack_mode");
    alignment_of_pack_mode(is_it.then(|| value.trim().trim_matches('\''))?)
}

/// Returns the alignment in bytes of a value of the attribute `pack_mode`.
pub(crate) fn alignment_of_pack_mode(value: &str) -> Option<u32> {
    match value {
        "0" | "1" => Some(1),
        "2" => Some(2),
        "4" => Some(4),
        "8" => Some(8),
        _ => None,
    }
}

/// Returns the length of a number: digits, base, underscores and a fraction. The two dots of a range are not a
/// fraction.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let mut length = 0;
    while let Some(byte) = bytes.get(length) {
        let fraction = *byte == b'.' && bytes.get(length + 1).is_some_and(u8::is_ascii_digit);
        if !(byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'#') || fraction) {
            break;
        }
        length += 1;
    }
    length
}

fn direct_length(text: &str) -> usize {
    text.find(|c: char| !c.is_ascii_alphanumeric() && !matches!(c, '.' | '*')).unwrap_or(text.len())
}

impl Token<'_> {
    /// Returns the name of the token in error messages.
    pub(crate) fn description(self) -> String {
        match self {
            Token::Word(text) | Token::Number(text) => format!("`{text}`"),
            Token::Direct => "an address".to_owned(),
            Token::Text => "a string".to_owned(),
            Token::Symbol(text) => format!("`{text}`"),
            Token::End => "the end of the file".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Result<Vec<String>, Fault> {
        let mut lexer = Lexer::new(text, TextPosition { line: 1, column: 1 });
        let mut found = Vec::new();
        loop {
            match lexer.next()? {
                (_, Token::End) => return Ok(found),
                (place, token) => {
                    found.push(format!("{}:{} {}", place.line, place.column, token.description()))
                }
            }
        }
    }

    #[test]
    fn places_are_lines_and_characters() {
        assert_eq!(
            tokens("a_B(* ä\n ö *) :=\r\n\t16#1_F;").unwrap(),
            ["1:1 `a_B`", "2:7 `:=`", "3:2 `16#1_F`", "3:8 `;`"]
        );
    }

    #[test]
    fn a_range_is_no_fraction() {
        assert_eq!(tokens("0..31 1.5").unwrap(), ["1:1 `0`", "1:2 `..`", "1:4 `31`", "1:7 `1.5`"]);
    }

    #[test]
    fn comments_and_pragmas_are_left_out() {
        assert_eq!(tokens("(* ( * *)//x\n/* y */{z}A").unwrap(), ["2:11 `A`"]);
        assert_eq!(tokens("(* a (* b *) 'c *)A").unwrap(), ["1:19 `A`"], "comments nest");
        assert_eq!(tokens("(* a (* b *)A").unwrap(), ["1:13 `A`"], "comments do not nest");
        assert_eq!(tokens("A *)").unwrap_err(), (TextPosition { line: 1, column: 3 }, Wrong::NoComment));
        assert_eq!(
            tokens(" (* x").unwrap_err(),
            (TextPosition { line: 1, column: 2 }, Wrong::Unfinished("comment"))
        );
        assert_eq!(tokens("{").unwrap_err().1, Wrong::Unfinished("pragma"));
    }

    #[test]
    fn strings_end_on_their_line() {
        assert_eq!(tokens("'a$'b' \"\" %MB3.5;").unwrap().len(), 4);
        assert_eq!(
            tokens("'a\n'").unwrap_err(),
            (TextPosition { line: 1, column: 1 }, Wrong::Unfinished("string"))
        );
        assert_eq!(tokens("a §").unwrap_err(), (TextPosition { line: 1, column: 3 }, Wrong::Character('§')));
    }
}
