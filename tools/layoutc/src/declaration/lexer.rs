//! Cuts IEC 61131-3 text into words, numbers and symbols; comments and pragmas are left out.

use super::error::{Fault, TextPosition, Wrong};

/// The tokens of the text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Token<'a> {
    /// A name or keyword.
    Word(&'a str),
    /// A number as written, base and underscores included.
    Number(&'a str),
    /// A place of a variable: `%MB3.200000`.
    Direct,
    /// A string literal.
    Text,
    /// Everything else.
    Symbol(&'static str),
    /// End of the text.
    End,
}

/// A longer symbol comes before a shorter one that is its prefix.
const SYMBOLS: [&str; 13] = [":=", "..", ":", ";", ",", "(", ")", "[", "]", ".", "+", "-", "#"];
/// Begin and end of skipped text. Comments do not nest in the standard's editions before the third.
const SKIPPED: [(&str, &str, &str); 3] =
    [("(*", "*)", "comment"), ("/*", "*/", "comment"), ("{", "}", "pragma")];

/// Reads the tokens in order.
pub(crate) struct Lexer<'a> {
    rest: &'a str,
    place: TextPosition,
}

impl<'a> Lexer<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self { rest: text, place: TextPosition { line: 1, column: 1 } }
    }

    /// The next token and where it begins.
    pub(crate) fn next(&mut self) -> Result<(TextPosition, Token<'a>), Fault> {
        self.skip()?;
        let place = self.place;
        let Some(first) = self.rest.chars().next() else { return Ok((place, Token::End)) };
        let token = match first {
            'A'..='Z' | 'a'..='z' | '_' => Token::Word(self.take(word_length(self.rest))),
            '0'..='9' => Token::Number(self.take(number_length(self.rest))),
            '%' => {
                let length = 1 + direct_length(&self.rest[1..]);
                self.take(length);
                Token::Direct
            }
            '\'' | '"' => {
                self.string(first)?;
                Token::Text
            }
            _ => match SYMBOLS.iter().find(|symbol| self.rest.starts_with(**symbol)) {
                Some(symbol) => {
                    self.take(symbol.len());
                    Token::Symbol(symbol)
                }
                None if self.rest.starts_with("*)") => return Err((place, Wrong::NoComment)),
                None => return Err((place, Wrong::Character(first))),
            },
        };
        Ok((place, token))
    }

    /// Leaves out blanks, comments and pragmas.
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
                let Some(length) = inside.find(end) else {
                    return Err((self.place, Wrong::Unfinished(what)));
                };
                self.take(begin.len() + length + end.len());
            } else {
                return Ok(());
            }
        }
    }

    /// A string literal ends on its line; `$` escapes the next character.
    fn string(&mut self, quote: char) -> Result<(), Fault> {
        let mut escaped = false;
        for (at, c) in self.rest.char_indices().skip(1) {
            match c {
                '\n' => break,
                _ if escaped => escaped = false,
                '$' => escaped = true,
                _ if c == quote => {
                    self.take(at + c.len_utf8());
                    return Ok(());
                }
                _ => {}
            }
        }
        Err((self.place, Wrong::Unfinished("string")))
    }

    /// Advances by `bytes`, which end between two characters.
    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        for c in taken.chars() {
            if c == '\n' {
                self.place = TextPosition { line: self.place.line + 1, column: 1 };
            } else {
                self.place.column += 1;
            }
        }
        self.rest = rest;
        taken
    }
}

fn word_length(text: &str) -> usize {
    text.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(text.len())
}

/// Digits, base, underscores and a fraction; the two points of a range are not a fraction.
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
    /// Name of the token in error messages.
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
        let mut lexer = Lexer::new(text);
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
