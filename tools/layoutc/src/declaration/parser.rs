//! The part of IEC 61131-3 that declares types: `TYPE`, and `VAR_GLOBAL`, with variables that are ignored here.

use super::error::{Fault, TextPosition, Wrong};
use super::lexer::{Lexer, Token};
use super::{Member, Type, TypeId, Types};
use std::collections::HashMap;

/// Maximum depth of nested type definitions. Types that refer to others by name do not count.
const MAX_DEPTH: usize = 16;
const MAX_ELEMENTS: i64 = 1 << 24;
const KEYWORDS: [&str; 16] = [
    "ARRAY",
    "AT",
    "CONSTANT",
    "END_STRUCT",
    "END_TYPE",
    "END_VAR",
    "OF",
    "STRING",
    "STRUCT",
    "TYPE",
    "VAR",
    "VAR_CONFIG",
    "VAR_EXTERNAL",
    "VAR_GLOBAL",
    "WSTRING",
    "RETAIN",
];

/// Reads all types that `text` declares.
pub(crate) fn parse(text: &str) -> Result<Types, Fault> {
    let mut lexer = Lexer::new(text);
    let next = lexer.next()?;
    let mut parser = Parser { lexer, next, names: HashMap::new(), types: Types::default() };
    parser.file()?;
    Ok(parser.types)
}

struct Parser<'a> {
    lexer: Lexer<'a>,
    /// The current token, and the place where it begins.
    next: (TextPosition, Token<'a>),
    /// Names of the types so far, in lower case.
    names: HashMap<String, TextPosition>,
    types: Types,
}

impl<'a> Parser<'a> {
    fn file(&mut self) -> Result<(), Fault> {
        loop {
            if self.accept_word("TYPE")? {
                while !self.accept_word("END_TYPE")? {
                    self.type_declaration()?;
                }
                self.accept(";")?;
            } else if self.accept_word("VAR_GLOBAL")? {
                for qualifier in ["CONSTANT", "RETAIN"] {
                    self.accept_word(qualifier)?;
                }
                while !self.accept_word("END_VAR")? {
                    self.variables()?;
                }
                self.accept(";")?;
            } else if self.next.1 == Token::End {
                return Ok(());
            } else {
                return self.unexpected("TYPE or VAR_GLOBAL");
            }
        }
    }

    fn type_declaration(&mut self) -> Result<(), Fault> {
        let at = self.next.0;
        let name = self.name("the name of a type or END_TYPE")?;
        add(&mut self.names, name, at)?;
        self.expect(":", "`:` behind the name of the type")?;
        let ty = self.specification(0)?;
        self.types.declare(name, ty);
        self.end_of_declaration(ty)
    }

    /// `a, b AT %MB3.5 : BYTE := 1;`
    fn variables(&mut self) -> Result<(), Fault> {
        self.name("the name of a variable or END_VAR")?;
        while self.accept(",")? {
            self.name("the name of a variable")?;
        }
        if self.accept_word("AT")? {
            if self.next.1 != Token::Direct {
                return self.unexpected("an address such as %MB3.200000");
            }
            self.advance()?;
        }
        self.expect(":", "`:` behind the name of the variable")?;
        let ty = self.specification(0)?;
        self.end_of_declaration(ty)
    }

    fn specification(&mut self, depth: usize) -> Result<TypeId, Fault> {
        let at = self.next.0;
        if depth > MAX_DEPTH {
            return Err((at, Wrong::TooDeep(MAX_DEPTH)));
        }
        let ty = self.ty(depth)?;
        Ok(self.types.add(at, ty))
    }

    fn ty(&mut self, depth: usize) -> Result<Type, Fault> {
        if self.accept_word("STRUCT")? {
            return self.members(depth);
        }
        if self.accept_word("ARRAY")? {
            return self.array(depth);
        }
        if self.next.1 == Token::Symbol("(") {
            self.group()?;
            return Ok(Type::Unsized("an enumeration"));
        }
        for what in ["STRING", "WSTRING"] {
            if self.accept_word(what)? {
                if matches!(self.next.1, Token::Symbol("[" | "(")) {
                    self.group()?;
                }
                return Ok(Type::Unsized(what));
            }
        }
        let name = self.name("a type")?;
        // A subrange is as large as its type.
        if self.next.1 == Token::Symbol("(") {
            self.group()?;
        }
        Ok(Type::Named(name.to_owned()))
    }

    fn members(&mut self, depth: usize) -> Result<Type, Fault> {
        let mut names = HashMap::new();
        let mut members = Vec::new();
        while !self.accept_word("END_STRUCT")? {
            let mut group = Vec::new();
            loop {
                let at = self.next.0;
                let name = self.name("the name of a member or END_STRUCT")?;
                add(&mut names, name, at)?;
                group.push((name, at));
                if !self.accept(",")? {
                    break;
                }
            }
            self.expect(":", "`:` behind the name of the member")?;
            let ty = self.specification(depth + 1)?;
            self.end_of_declaration(ty)?;
            members.extend(group.into_iter().map(|(name, at)| Member { name: name.to_owned(), at, ty }));
        }
        Ok(Type::Struct(members))
    }

    fn array(&mut self, depth: usize) -> Result<Type, Fault> {
        self.expect("[", "`[` behind ARRAY")?;
        let mut counts = Vec::new();
        loop {
            let place = self.next.0;
            let first = self.bound()?;
            self.expect("..", "`..` behind the lower bound")?;
            let last = self.bound()?;
            let count = last - first + 1;
            if !(1..=MAX_ELEMENTS).contains(&count) {
                return Err((place, Wrong::Bounds { first, last }));
            }
            counts.push(count as u32);
            if counts.len() > MAX_DEPTH {
                return Err((place, Wrong::TooDeep(MAX_DEPTH)));
            }
            if !self.accept(",")? {
                break;
            }
        }
        self.expect("]", "`]` behind the bounds")?;
        if !self.accept_word("OF")? {
            return self.unexpected("OF");
        }
        Ok(Type::Array { counts, of: self.specification(depth + 1)? })
    }

    fn bound(&mut self) -> Result<i64, Fault> {
        let negative = self.accept("-")?;
        if !negative {
            self.accept("+")?;
        }
        let (place, Token::Number(text)) = self.next else {
            return self.unexpected("a number as array bound");
        };
        let value = whole(text).ok_or_else(|| (place, Wrong::BadBound(text.to_owned())))?;
        self.advance()?;
        Ok(if negative { -value } else { value })
    }

    /// Skips a value: values move no member, and only the target's compiler checks their form.
    fn initial_value(&mut self) -> Result<(), Fault> {
        if !self.accept(":=")? {
            return Ok(());
        }
        let mut empty = true;
        loop {
            match self.next.1 {
                Token::Symbol(";") if !empty => return Ok(()),
                Token::Symbol("(" | "[") => self.group()?,
                Token::Symbol(";" | ")" | "]") | Token::End => return self.unexpected("an initial value"),
                Token::Word(word) if is_keyword(word) => {
                    return self.unexpected("`;` behind the initial value");
                }
                _ => self.advance()?,
            }
            empty = false;
        }
    }

    /// Skips the text in brackets, including nested brackets.
    fn group(&mut self) -> Result<(), Fault> {
        let mut open = Vec::new();
        loop {
            match self.next.1 {
                Token::Symbol("(") => open.push(")"),
                Token::Symbol("[") => open.push("]"),
                Token::Symbol(symbol @ (")" | "]")) if open.last() == Some(&symbol) => {
                    open.pop();
                }
                Token::Symbol(";" | ")" | "]") | Token::End => {
                    return self.unexpected(if open.last() == Some(&")") { "`)`" } else { "`]`" });
                }
                _ => {}
            }
            self.advance()?;
            if open.is_empty() {
                return Ok(());
            }
        }
    }

    /// Skips an initial value, and the `;`, which some tools leave out after END_STRUCT.
    fn end_of_declaration(&mut self, ty: TypeId) -> Result<(), Fault> {
        self.initial_value()?;
        if self.accept(";")? || matches!(self.types.of(ty).1, Type::Struct(_)) {
            return Ok(());
        }
        self.unexpected("`;`")
    }

    fn name(&mut self, expected: &'static str) -> Result<&'a str, Fault> {
        match self.next {
            (place, Token::Word(word)) if is_keyword(word) => {
                Err((place, Wrong::Unexpected { expected, found: format!("the keyword `{word}`") }))
            }
            (_, Token::Word(word)) => {
                self.advance()?;
                Ok(word)
            }
            _ => self.unexpected(expected),
        }
    }

    fn advance(&mut self) -> Result<(), Fault> {
        self.next = self.lexer.next()?;
        Ok(())
    }

    fn accept(&mut self, symbol: &str) -> Result<bool, Fault> {
        let found = matches!(self.next.1, Token::Symbol(next) if next == symbol);
        if found {
            self.advance()?;
        }
        Ok(found)
    }

    fn accept_word(&mut self, keyword: &str) -> Result<bool, Fault> {
        let found = matches!(self.next.1, Token::Word(word) if word.eq_ignore_ascii_case(keyword));
        if found {
            self.advance()?;
        }
        Ok(found)
    }

    fn expect(&mut self, symbol: &str, expected: &'static str) -> Result<(), Fault> {
        if self.accept(symbol)? { Ok(()) } else { self.unexpected(expected) }
    }

    fn unexpected<T>(&self, expected: &'static str) -> Result<T, Fault> {
        let (place, token) = self.next;
        Err((place, Wrong::Unexpected { expected, found: token.description() }))
    }
}

fn add(names: &mut HashMap<String, TextPosition>, name: &str, at: TextPosition) -> Result<(), Fault> {
    match names.insert(name.to_ascii_lowercase(), at) {
        None => Ok(()),
        Some(first) => Err((at, Wrong::Duplicate(name.to_owned(), first))),
    }
}

fn is_keyword(word: &str) -> bool {
    KEYWORDS.iter().any(|keyword| keyword.eq_ignore_ascii_case(word))
}

/// A whole number that fits a DINT: `31`, `1_000`, `16#1F`.
fn whole(text: &str) -> Option<i64> {
    let (base, digits) = match text.split_once('#') {
        Some((base, digits)) => (base.parse().ok().filter(|base| [2, 8, 16].contains(base))?, digits),
        None => (10, text),
    };
    let digits = digits.replace('_', "");
    i64::from_str_radix(&digits, base).ok().filter(|value| *value <= i64::from(i32::MAX))
}
