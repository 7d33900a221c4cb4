//! Splits a script into tokens, even if it is incomplete: Rhai's own tokenizer stops at the first error.

use core::ops::Range;

/// A word, number, text or sign of a script. Comments and blanks are not tokens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Token {
    pub(super) kind: TokenKind,
    /// Range of the token, in bytes.
    pub(super) range: Range<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TokenKind {
    /// A name, or a keyword of the language.
    Word,
    Number,
    /// A text in double quotes. If the closing quote is missing, the text ends at the end of the line.
    Text,
    /// A text in backticks without `${...}`, or a raw text.
    Template,
    /// A part of a text in backticks with `${...}`: it ends with the opening `${`, begins with the closing `}`, or both. The
    /// tokens of the code are between such parts.
    Piece,
    /// A character in single quotes.
    Letter,
    /// `::`.
    Path,
    /// Any other character; each is a separate token.
    Sign,
}

/// Maximum number of open `${` after which the script is split again: each of them costs another pass.
const MOST_OPEN: usize = 8;

/// The tokens and the comments of a script.
#[derive(Default)]
pub(super) struct Tokens {
    pub(super) all: Vec<Token>,
    pub(super) comments: Vec<Range<usize>>,
    /// For each `${` without a closing `}`, the range from it to the end of its line. The script is read as if the text with
    /// this `${` ended there.
    pub(super) unclosed: Vec<Range<usize>>,
}

impl Tokens {
    /// Splits any text into tokens.
    pub(super) fn of(text: &str) -> Self {
        let mut tokens = Tokens::default();
        // The first line may be an interpreter line, `#!`.
        let mut at = if text.starts_with("#!") { line_end(text, 0) } else { 0 };
        // For each open `${`, the number of open braces in its code, and the end of the `${`.
        let mut open: Vec<(usize, usize)> = Vec::new();
        loop {
            let Some(letter) = text[at..].chars().next() else {
                match open.first() {
                    Some((_, end)) if tokens.unclosed.len() < MOST_OPEN => at = tokens.cut(text, end - 2),
                    _ => break,
                }
                open.clear();
                continue;
            };
            let rest = &text[at..];
            let (kind, end) = match letter {
                _ if letter.is_whitespace() => {
                    at += letter.len_utf8();
                    continue;
                }
                '/' if rest.starts_with("//") => {
                    tokens.comments.push(at..line_end(text, at));
                    at = line_end(text, at);
                    continue;
                }
                '/' if rest.starts_with("/*") => {
                    let end = block_comment_end(text, at);
                    tokens.comments.push(at..end);
                    at = end;
                    continue;
                }
                '"' => (TokenKind::Text, text_end(text, at)),
                '`' => match template_end(text, at + 1) {
                    (end, true) => {
                        open.push((0, end));
                        (TokenKind::Piece, end)
                    }
                    (end, false) => (TokenKind::Template, end),
                },
                '}' if open.last().is_some_and(|(braces, _)| *braces == 0) => {
                    let (end, is_open) = template_end(text, at + 1);
                    open.pop();
                    open.extend(is_open.then_some((0, end)));
                    (TokenKind::Piece, end)
                }
                '\'' => {
                    letter_end(text, at).map_or((TokenKind::Sign, at + 1), |end| (TokenKind::Letter, end))
                }
                '#' if rest.trim_start_matches('#').starts_with('"') => {
                    (TokenKind::Template, raw_end(text, at))
                }
                '0'..='9' => (TokenKind::Number, number_end(text, at)),
                '_' | 'a'..='z' | 'A'..='Z' => (TokenKind::Word, at + word_length(rest)),
                ':' if rest.starts_with("::") => (TokenKind::Path, at + 2),
                _ => {
                    if let Some((braces, _)) = open.last_mut() {
                        *braces += usize::from(letter == '{');
                        *braces -= usize::from(letter == '}');
                    }
                    (TokenKind::Sign, at + letter.len_utf8())
                }
            };
            tokens.all.push(Token { kind, range: at..end });
            at = end;
        }
        tokens
    }

    /// Ends the text with an open `${` at `begin` at the end of its line, and removes what was read after it. Returns the
    /// end of the line.
    fn cut(&mut self, text: &str, begin: usize) -> usize {
        let end = line_end(text, begin);
        self.all.truncate(self.all.partition_point(|token| token.range.start < end));
        self.comments.truncate(self.comments.partition_point(|comment| comment.start < end));
        let last = self.all.last_mut().map(|token| &mut token.range);
        for range in last.into_iter().chain(self.comments.last_mut()) {
            range.end = range.end.min(end);
        }
        self.unclosed.push(begin..end);
        end
    }

    /// True if a position is inside a comment.
    pub(super) fn is_comment(&self, offset: usize) -> bool {
        self.comments.iter().any(|comment| comment.start < offset && offset <= comment.end)
    }
}

impl Token {
    /// Returns the text of the token.
    pub(super) fn text<'a>(&self, text: &'a str) -> &'a str {
        text.get(self.range.clone()).unwrap_or_default()
    }

    /// True if the token is this word or sign.
    pub(super) fn is(&self, text: &str, wanted: &str) -> bool {
        matches!(self.kind, TokenKind::Word | TokenKind::Sign | TokenKind::Path) && self.text(text) == wanted
    }

    /// True if the token is a part of a text after which code begins.
    pub(super) fn begins_code(&self, text: &str) -> bool {
        self.kind == TokenKind::Piece && self.text(text).ends_with("${")
    }

    /// True if the token is a part of a text before which code ends.
    pub(super) fn ends_code(&self, text: &str) -> bool {
        self.kind == TokenKind::Piece && self.text(text).starts_with('}')
    }

    /// Returns the range between the quotes of a text. `None` for other tokens, and for texts with escapes or code.
    pub(super) fn content(&self, text: &str) -> Option<Range<usize>> {
        let whole = self.text(text);
        let quote = match self.kind {
            TokenKind::Text => '"',
            TokenKind::Template if whole.starts_with('`') => '`',
            _ => return None,
        };
        let inner = whole.strip_prefix(quote)?;
        let inner = inner.strip_suffix(quote).unwrap_or(inner);
        let start = self.range.start + 1;
        let is_plain = quote == '`' || !inner.contains('\\');
        is_plain.then(|| start..start + inner.len())
    }
}

fn line_end(text: &str, at: usize) -> usize {
    text[at..].find('\n').map_or(text.len(), |end| at + end)
}

fn word_length(rest: &str) -> usize {
    rest.find(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_').unwrap_or(rest.len())
}

/// Returns the end of a block comment. Block comments can be nested.
fn block_comment_end(text: &str, at: usize) -> usize {
    let (mut depth, mut end) = (0, at);
    while end < text.len() {
        let rest = &text[end..];
        if rest.starts_with("/*") {
            depth += 1;
            end += 2;
        } else if rest.starts_with("*/") {
            depth -= 1;
            end += 2;
            if depth == 0 {
                return end;
            }
        } else {
            end += rest.chars().next().map_or(1, char::len_utf8);
        }
    }
    text.len()
}

/// Returns the end of a text in double quotes: the closing quote, or the end of the line.
fn text_end(text: &str, at: usize) -> usize {
    let mut letters = text[at..].char_indices().skip(1);
    while let Some((place, letter)) = letters.next() {
        match letter {
            '"' => return at + place + 1,
            '\n' => return at + place,
            // A backslash at the end of a line continues the text in the next one.
            '\\' => drop(letters.next()),
            _ => {}
        }
    }
    text.len()
}

/// Returns the end of a text in backticks, or of its part up to the next `${`, and true if it ends with `${`.
fn template_end(text: &str, at: usize) -> (usize, bool) {
    let rest = &text[at..];
    let code = rest.find("${").unwrap_or(rest.len());
    match rest.find('`') {
        Some(end) if end < code => (at + end + 1, false),
        _ if code < rest.len() => (at + code + 2, true),
        _ => (text.len(), false),
    }
}

/// Returns the end of a raw text, `#"..."#` with any number of `#`.
fn raw_end(text: &str, at: usize) -> usize {
    let signs = text[at..].bytes().take_while(|byte| *byte == b'#').count();
    let close = format!("\"{}", "#".repeat(signs));
    let inner = at + signs + 1;
    text[inner..].find(&close).map_or(text.len(), |end| inner + end + close.len())
}

/// Returns the end of a character literal, `'x'` or `'\n'`.
fn letter_end(text: &str, at: usize) -> Option<usize> {
    let rest = &text[at + 1..];
    let length = if rest.starts_with('\\') { 12 } else { 1 };
    let end = rest.char_indices().skip(1).take(length).find(|(_, letter)| *letter == '\'');
    end.map(|(end, _)| at + 1 + end + 1)
}

/// Returns the end of a number. Two dots after a number belong to a range.
fn number_end(text: &str, at: usize) -> usize {
    let whole = at + word_length(&text[at..]);
    let rest = &text[whole..];
    let has_fraction = rest.starts_with('.') && rest[1..].starts_with(|next: char| next.is_ascii_digit());
    if has_fraction { whole + 1 + word_length(&rest[1..]) } else { whole }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<&str> {
        Tokens::of(text).all.iter().map(|token| &text[token.range.clone()]).collect()
    }

    #[test]
    fn a_script_is_split_into_words_texts_and_signs() {
        assert_eq!(
            words("poke(\"node2.w\", 0x0001); // \"no\"\nlet c = 'x'; 1..3 1.5"),
            [
                "poke",
                "(",
                "\"node2.w\"",
                ",",
                "0x0001",
                ")",
                ";",
                "let",
                "c",
                "=",
                "'x'",
                ";",
                "1",
                ".",
                ".",
                "3",
                "1.5"
            ]
        );
        assert_eq!(
            words("a::b `t ${f(\"}\")} u` #\"raw \" \"# /* x /* y */ */ z"),
            ["a", "::", "b", "`t ${", "f", "(", "\"}\"", ")", "} u`", "#\"raw \" \"#", "z"]
        );
    }

    /// Rhai parses the code in `${...}` like any other code: with blocks, comments and texts.
    #[test]
    fn code_in_a_text_is_split_into_tokens() {
        assert_eq!(
            words("`a ${ if b { `c } ${d}` } /* } */ } ${e}{` f}"),
            ["`a ${", "if", "b", "{", "`c } ${", "d", "}`", "}", "} ${", "e", "}{`", "f", "}"]
        );
        assert_eq!(words("`a ${ `f(9)` } b` `${}`"), ["`a ${", "`f(9)`", "} b`", "`${", "}`"]);
    }

    #[test]
    fn an_open_code_ends_with_its_line() {
        let text = "f(`a ${ b`);\ng(`c ${d}`);\n`${ { /* e\n`${h}` `${1} ${\ni";
        let tokens = Tokens::of(text);
        let shown: Vec<_> = tokens.all.iter().map(|token| token.text(text)).collect();
        let first = ["f", "(", "`a ${", "b", "`);", "g", "(", "`c ${", "d", "}`", ")", ";"];
        assert_eq!(shown[..12], first);
        assert_eq!(shown[12..], ["`${", "{", "`${", "h", "}`", "`${", "1", "} ${", "i"]);
        let unclosed: Vec<_> = tokens.unclosed.iter().map(|it| &text[it.clone()]).collect();
        assert_eq!(unclosed, ["${ b`);", "${ { /* e", "${"]);
    }

    #[test]
    fn unfinished_texts_end_with_their_line() {
        assert_eq!(words("poke(\"node2.\nstep(1)"), ["poke", "(", "\"node2.", "step", "(", "1", ")"]);
        assert_eq!(words("print(`never ends ${ ")[2..], ["`never ends ${"]);
        assert_eq!(words("`${ a } never ends"), ["`${", "a", "} never ends"]);
        assert_eq!(words("/* never ends"), [""; 0]);
        assert_eq!(words("' \u{1F980}"), ["'", "\u{1F980}"]);
    }

    #[test]
    fn the_content_of_a_text_is_between_its_quotes() {
        let content = |text: &str| Tokens::of(text).all[0].content(text).map(|range| text[range].to_owned());
        assert_eq!(content("\"a.b\"").as_deref(), Some("a.b"));
        assert_eq!(content("\"a.b").as_deref(), Some("a.b"));
        assert_eq!(content("`x\ny`").as_deref(), Some("x\ny"));
        assert_eq!((content("\"a\\n\""), content("`${x}`"), content("x")), (None, None, None));
    }
}
