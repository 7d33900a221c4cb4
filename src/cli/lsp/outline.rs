//! The parts of a script that the language server uses: calls, functions, imports, variables.

use super::tokens::{Token, TokenKind, Tokens};
use core::ops::Range;
use std::collections::BTreeSet;

/// Keywords of the language that a parenthesis may follow.
const WORDS: [&str; 20] = [
    "as", "catch", "const", "do", "else", "export", "fn", "for", "if", "import", "in", "let", "loop",
    "private", "return", "switch", "this", "throw", "until", "while",
];

/// A call `name(...)` in a script; the closing parenthesis may be missing.
pub(super) struct Call {
    /// Index of the token with the name.
    pub(super) name: usize,
    /// Index of the token with the module before `::`.
    pub(super) module: Option<usize>,
    /// True if the call has the form of a method, `value.name(...)`.
    pub(super) is_method: bool,
    /// True if the closing parenthesis exists.
    pub(super) is_closed: bool,
    /// The bytes between the parentheses.
    pub(super) inner: Range<usize>,
    /// The tokens of each argument.
    pub(super) arguments: Vec<Range<usize>>,
    /// Positions of the commas between the arguments, in bytes.
    pub(super) commas: Vec<usize>,
    /// True if the call is outside of functions.
    pub(super) is_outside: bool,
}

/// A function of the script.
pub(super) struct Function {
    pub(super) name: String,
    /// Range of the name, in bytes.
    pub(super) at: Range<usize>,
    pub(super) parameters: Vec<String>,
    /// The comment above the function.
    pub(super) about: String,
}

/// `import "path" as name`.
pub(super) struct Import {
    /// Range of the path, in bytes.
    pub(super) path: Range<usize>,
    pub(super) alias: Option<String>,
}

/// The known parts of a script.
pub(super) struct Outline {
    pub(super) tokens: Tokens,
    pub(super) calls: Vec<Call>,
    pub(super) functions: Vec<Function>,
    pub(super) imports: Vec<Import>,
    /// Names of variables, constants and parameters anywhere in the script.
    pub(super) variables: BTreeSet<String>,
}

impl Outline {
    /// Parses the parts of any text, even of an invalid script.
    pub(super) fn of(text: &str) -> Self {
        let tokens = Tokens::of(text);
        let all = &tokens.all;
        let functions = functions(text, all);
        let mut variables = variables(text, all);
        variables.extend(functions.iter().flat_map(|function| function.parameters.iter().cloned()));
        let (calls, imports) = (calls(text, all, &tokens.unclosed), imports(text, all));
        Outline { calls, functions, imports, variables, tokens }
    }

    /// Returns the index of the token at a position. If the position is between two tokens, prefers a word or a text.
    pub(super) fn token_at(&self, offset: usize) -> Option<usize> {
        let all = &self.tokens.all;
        let after = all.partition_point(|token| token.range.start <= offset);
        let touches = |index: &usize| {
            let token = &all[*index];
            token.range.start <= offset && offset <= token.range.end
        };
        let near: Vec<_> = (after.saturating_sub(2)..after).filter(touches).collect();
        let is_sign =
            |index: &usize| matches!(all[*index].kind, TokenKind::Sign | TokenKind::Path | TokenKind::Piece);
        near.iter().copied().find(|index| !is_sign(index)).or(near.last().copied())
    }

    /// Returns the innermost call with a position between its parentheses, and the index of the argument at the
    /// position.
    pub(super) fn call_at(&self, offset: usize) -> Option<(&Call, usize)> {
        let within = self.calls.iter().filter(|call| call.inner.start <= offset && offset <= call.inner.end);
        let call = within.max_by_key(|call| call.inner.start)?;
        Some((call, call.commas.iter().filter(|comma| **comma < offset).count()))
    }

    /// Returns the function of this name.
    pub(super) fn function(&self, name: &str) -> Option<&Function> {
        self.functions.iter().find(|function| function.name == name)
    }
}

/// Sign of an open `${`. No sign of a script is a token with this sign.
const CODE: char = '`';

/// A bracket that is open at the present position of the parser.
struct Open {
    sign: char,
    /// Index of the call to which the parenthesis belongs; `None` if it belongs to no call.
    call: Option<usize>,
    /// Index of the first token of the present argument.
    argument: usize,
    /// True if the bracket opens the body of a function.
    is_body: bool,
}

/// Returns the calls. `unclosed` are the ranges of the code that ends with its line because its `${` is not closed.
fn calls(text: &str, tokens: &[Token], unclosed: &[Range<usize>]) -> Vec<Call> {
    let mut calls: Vec<Call> = Vec::new();
    let mut unclosed = unclosed.iter().peekable();
    let mut open: Vec<Open> = Vec::new();
    // True if the next brace begins the body of a function.
    let mut body = false;
    for (index, token) in tokens.iter().enumerate() {
        if unclosed.next_if(|code| code.end <= token.range.start).is_some() {
            while open.iter().any(|open| open.sign == CODE) {
                close(&mut calls, &mut open, CODE, index, token, false);
            }
        }
        if token.kind == TokenKind::Word && token.text(text) == "fn" {
            body = true;
        }
        if token.ends_code(text) {
            close(&mut calls, &mut open, CODE, index, token, true);
        }
        if token.begins_code(text) {
            open.push(Open { sign: CODE, call: None, argument: index + 1, is_body: false });
        }
        let sign = match token.kind {
            TokenKind::Sign => token.text(text).chars().next().unwrap_or_default(),
            _ => continue,
        };
        match sign {
            '(' => {
                let is_outside = !open.iter().any(|open| open.is_body);
                let call = called(text, tokens, index).map(|(module, is_method)| {
                    let inner = token.range.end..text.len();
                    let (arguments, commas) = (Vec::new(), Vec::new());
                    let name = index - 1;
                    calls.push(Call {
                        name,
                        module,
                        is_method,
                        is_closed: false,
                        inner,
                        arguments,
                        commas,
                        is_outside,
                    });
                    calls.len() - 1
                });
                open.push(Open { sign, call, argument: index + 1, is_body: false });
            }
            '[' | '{' => {
                let is_body = sign == '{' && core::mem::take(&mut body);
                open.push(Open { sign, call: None, argument: index + 1, is_body });
            }
            ',' => {
                if let Some(top) = open.last_mut()
                    && let Some(call) = top.call
                {
                    calls[call].arguments.push(top.argument..index);
                    calls[call].commas.push(token.range.start);
                    top.argument = index + 1;
                }
            }
            ')' | ']' | '}' => close(&mut calls, &mut open, partner(sign), index, token, true),
            // A statement ends at this token. If a parenthesis is still open, its closing parenthesis is missing.
            ';' => {
                while let Some(top) = open.last().filter(|top| !['{', CODE].contains(&top.sign)) {
                    let sign = top.sign;
                    close(&mut calls, &mut open, sign, index, token, false);
                }
            }
            _ => {}
        }
    }
    while let Some(top) = open.pop() {
        if let Some(call) = top.call.filter(|_| top.argument < tokens.len()) {
            calls[call].arguments.push(top.argument..tokens.len());
        }
    }
    calls
}

/// Closes the innermost bracket of the given kind, and those inside it, at a token. A bracket in the code of a text closes
/// no bracket outside of this code.
fn close(calls: &mut [Call], open: &mut Vec<Open>, sign: char, index: usize, token: &Token, is_closed: bool) {
    let Some(depth) = open.iter().rposition(|open| [sign, CODE].contains(&open.sign)) else { return };
    if open[depth].sign != sign {
        return;
    }
    for (at, bracket) in open.drain(depth..).enumerate() {
        let Some(call) = bracket.call.and_then(|call| calls.get_mut(call)) else { continue };
        if bracket.argument < index || !call.commas.is_empty() {
            call.arguments.push(bracket.argument.min(index)..index);
        }
        call.inner.end = token.range.start;
        call.is_closed = is_closed && at == 0;
    }
}

fn partner(sign: char) -> char {
    match sign {
        ')' => '(',
        ']' => '[',
        _ => '{',
    }
}

/// Returns the module token and the kind of the call that has its parenthesis at `index`; `None` if no call begins
/// there.
fn called(text: &str, tokens: &[Token], index: usize) -> Option<(Option<usize>, bool)> {
    let name = index.checked_sub(1)?;
    let token = tokens.get(name).filter(|token| token.kind == TokenKind::Word)?;
    if WORDS.contains(&token.text(text)) {
        return None;
    }
    let before = |steps: usize| name.checked_sub(steps).map(|at| (at, &tokens[at]));
    match before(1) {
        Some((_, before)) if before.is(text, "fn") => None,
        Some((_, path)) if path.kind == TokenKind::Path => Some((before(2).map(|(at, _)| at), false)),
        Some((at, dot)) if dot.is(text, ".") => {
            // `0..f(x)` is a range, and `f` is not a method.
            let is_range = at.checked_sub(1).is_some_and(|at| tokens[at].is(text, "."));
            Some((None, !is_range))
        }
        _ => Some((None, false)),
    }
}

fn functions(text: &str, tokens: &[Token]) -> Vec<Function> {
    let named = tokens
        .windows(2)
        .enumerate()
        .filter(|(_, pair)| pair[0].is(text, "fn") && pair[1].kind == TokenKind::Word);
    let function = |(index, pair): (usize, &[Token])| {
        let rest = tokens.get(index + 2..).unwrap_or_default();
        let inner = rest.iter().take_while(|token| !token.is(text, ")") && !token.is(text, "{"));
        let parameters =
            inner.filter(|token| token.kind == TokenKind::Word).map(|token| token.text(text).to_owned());
        Function {
            name: pair[1].text(text).to_owned(),
            at: pair[1].range.clone(),
            parameters: parameters.collect(),
            about: comment_above(text, pair[0].range.start),
        }
    };
    named.map(function).collect()
}

/// Returns the comment in the lines directly above a position.
fn comment_above(text: &str, at: usize) -> String {
    let before = text[..at].rfind('\n').map_or("", |end| &text[..end]);
    let lines = before.lines().rev().map(str::trim).take_while(|line| line.starts_with("//"));
    let mut lines: Vec<_> = lines.map(|line| line.trim_start_matches('/').trim()).collect();
    lines.reverse();
    lines.join(" ")
}

fn imports(text: &str, tokens: &[Token]) -> Vec<Import> {
    let found = tokens.windows(2).enumerate().filter(|(_, pair)| pair[0].is(text, "import"));
    let import = |(index, pair): (usize, &[Token])| {
        let alias = tokens.get(index + 2).filter(|token| token.is(text, "as")).and(tokens.get(index + 3));
        let alias =
            alias.filter(|token| token.kind == TokenKind::Word).map(|token| token.text(text).to_owned());
        Some(Import { path: pair[1].content(text)?, alias })
    };
    found.filter_map(import).collect()
}

fn variables(text: &str, tokens: &[Token]) -> BTreeSet<String> {
    let declared = tokens.windows(2).filter(|pair| {
        ["let", "const", "for", "as"].iter().any(|word| pair[0].is(text, word))
            && pair[1].kind == TokenKind::Word
    });
    let mut names: BTreeSet<_> = declared.map(|pair| pair[1].text(text).to_owned()).collect();
    // Finds the variables of `for (item, index) in` and `catch (error)`, and the parameters of closures, `|a, b|`.
    let mut bars = false;
    for (index, token) in tokens.iter().enumerate() {
        bars ^= token.is(text, "|");
        let before = index.checked_sub(1).map(|before| &tokens[before]);
        let next = tokens.get(index + 1);
        let is_listed = |token: Option<&Token>| {
            token.is_some_and(|it| ["(", ",", "|", ")"].iter().any(|sign| it.is(text, sign)))
        };
        if token.kind == TokenKind::Word
            && is_listed(before)
            && is_listed(next)
            && !next.is_some_and(|next| next.is(text, "("))
        {
            let is_parameter = bars || before.is_some_and(|before| !before.is(text, "|"));
            if is_parameter {
                names.insert(token.text(text).to_owned());
            }
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &str) -> Vec<String> {
        let outline = Outline::of(text);
        let all = &outline.tokens.all;
        let argument = |range: &Range<usize>| {
            all[range.clone()].iter().map(|token| token.text(text)).collect::<Vec<_>>().join(" ")
        };
        let call = |call: &Call| {
            let arguments: Vec<_> = call.arguments.iter().map(argument).collect();
            let end = if call.is_closed { ")" } else { "..." };
            format!("{}({}{end}", all[call.name].text(text), arguments.join("; "))
        };
        outline.calls.iter().map(call).collect()
    }

    #[test]
    fn calls_have_their_arguments() {
        assert_eq!(
            shown("wait(\"a\", [1, 2], f(3)); if (x) { m::g() }"),
            ["wait(\"a\"; [ 1 , 2 ]; f ( 3 ))", "f(3)", "g()"]
        );
        assert_eq!(shown("fn own(a, b) { own(1, 2) }"), ["own(1; 2)"]);
    }

    #[test]
    fn a_half_typed_call_ends_with_its_statement() {
        assert_eq!(
            shown("poke(\"a\", \nstep(1);\nnow();"),
            ["poke(\"a\"; step ( 1 )...", "step(1)", "now()"]
        );
        assert_eq!(shown("f(1, [2"), ["f(1; [ 2..."]);
        assert_eq!(shown(")]}(("), [""; 0]);
        assert_eq!(shown("f(`${ g(1 } ${ h()) }`, 2)"), ["f(`${ g ( 1 } ${ h ( ) ) }`; 2)", "g(1...", "h()"]);
    }

    #[test]
    fn functions_imports_and_variables_are_listed() {
        let text = "// Starts\n// the master.\nprivate fn start(plc, us) {}\nimport \"common/a\" as a;\nlet x = |p, q| p;";
        let outline = Outline::of(text);
        let start = outline.function("start").unwrap();
        assert_eq!(
            (start.parameters.join(" "), start.about.as_str()),
            ("plc us".to_owned(), "Starts the master.")
        );
        let import = &outline.imports[0];
        assert_eq!((&text[import.path.clone()], import.alias.as_deref()), ("common/a", Some("a")));
        for name in ["x", "p", "q", "plc", "us", "a"] {
            assert!(outline.variables.contains(name), "{name}");
        }
    }

    #[test]
    fn the_innermost_call_contains_the_cursor() {
        let text = "expect(peek(\"a\"), 2);";
        let outline = Outline::of(text);
        let at = |offset| {
            let (call, argument) = outline.call_at(offset).unwrap();
            (outline.tokens.all[call.name].text(text), argument)
        };
        assert_eq!((at(8), at(13), at(18)), (("expect", 0), ("peek", 0), ("expect", 1)));
        assert!(outline.call_at(21).is_none());
    }
}
