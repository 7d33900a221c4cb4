//! The part of IEC 61131-3 that declares types: `TYPE`, and the constants in lists of variables. Everything else is skipped.

use super::error::{Fault, TextPosition, Wrong};
use super::expression::Expression;
use super::lexer::{Lexer, Token};
use super::{Declarations, MAX_DEPTH, Member, Record, Type, TypeId};
use std::collections::HashMap;

const KEYWORDS: [&str; 18] = [
    "ARRAY",
    "AT",
    "CONSTANT",
    "END_STRUCT",
    "END_TYPE",
    "END_UNION",
    "END_VAR",
    "OF",
    "STRING",
    "STRUCT",
    "TYPE",
    "UNION",
    "VAR",
    "VAR_CONFIG",
    "VAR_EXTERNAL",
    "VAR_GLOBAL",
    "WSTRING",
    "RETAIN",
];
/// Words after `TYPE` and `VAR_GLOBAL` that have no effect on types.
const QUALIFIERS: [&str; 7] =
    ["INTERNAL", "NON_RETAIN", "PERSISTENT", "PRIVATE", "PROTECTED", "PUBLIC", "RETAIN"];
/// Kinds of parts that some tools export without an end; such a part fills a whole file.
const WHOLE_FILES: [&str; 8] =
    ["ACTION", "CLASS", "FUNCTION", "FUNCTION_BLOCK", "INTERFACE", "METHOD", "PROGRAM", "PROPERTY"];

/// Reads all types that `text` declares. `place` is the position of `text` in the current file.
pub(crate) fn parse(text: &str, place: TextPosition, into: &mut Declarations) -> Result<(), Fault> {
    Parser::new(text, place, into)?.file()
}

/// Reads an expression out of an attribute of XML at `place`.
pub(crate) fn expression(text: &str, place: TextPosition) -> Result<Expression, Fault> {
    let mut lexer = Lexer::new(text, place);
    let mut expression = Expression::default();
    loop {
        match lexer.next()?.1 {
            Token::End => return Ok(expression),
            token => expression.push(token),
        }
    }
}

struct Parser<'a, 'd> {
    lexer: Lexer<'a>,
    /// The current token, and the place where it begins.
    next: (TextPosition, Token<'a>),
    into: &'d mut Declarations,
}

impl<'a, 'd> Parser<'a, 'd> {
    fn new(text: &'a str, place: TextPosition, into: &'d mut Declarations) -> Result<Self, Fault> {
        let mut lexer = Lexer::new(text, place);
        let next = lexer.next()?;
        Ok(Self { lexer, next, into })
    }

    fn file(&mut self) -> Result<(), Fault> {
        loop {
            let (at, token) = self.next;
            let word = match token {
                Token::End => return Ok(()),
                Token::Word(word) => word.to_ascii_uppercase(),
                // Some tools write a `;` after END_TYPE and END_VAR.
                Token::Symbol(";") => {
                    self.advance()?;
                    continue;
                }
                _ => return self.unexpected("TYPE or VAR_GLOBAL"),
            };
            match word.as_str() {
                "TYPE" => self.types()?,
                "VAR" | "VAR_GLOBAL" | "VAR_CONFIG" | "VAR_ACCESS" | "VAR_EXTERNAL" => self.variables()?,
                // A namespace contains types, like a file.
                "NAMESPACE" | "USING" => {
                    self.advance()?;
                    self.qualified_name("the name of a namespace")?;
                }
                "END_NAMESPACE" => self.advance()?,
                _ => self.skip_part(at, &word)?,
            }
        }
    }

    /// Skips a program, a function block, or another part that ends with its own word: `TEST ... END_TEST`.
    fn skip_part(&mut self, at: TextPosition, kind: &str) -> Result<(), Fault> {
        self.advance()?;
        let name = match self.next.1 {
            Token::Word(name) => name,
            _ => "",
        };
        let end = format!("END_{kind}");
        if self.is_word(&end) || self.lexer.skip_past(&end)? {
            self.into.skip_part(at, kind, name);
            return self.advance();
        }
        if WHOLE_FILES.contains(&kind) {
            self.into.skip_part(at, kind, name);
            self.next = (at, Token::End);
            return Ok(());
        }
        let found = format!("`{kind}` without {end}");
        Err((at, Wrong::Unexpected { expected: "TYPE or VAR_GLOBAL", found }))
    }

    fn types(&mut self) -> Result<(), Fault> {
        self.advance()?;
        while !self.accept_word("END_TYPE")? {
            self.type_declaration()?;
        }
        Ok(())
    }

    fn type_declaration(&mut self) -> Result<(), Fault> {
        let pack = self.lexer.pack.take();
        let mut at = self.next.0;
        let mut name = self.name("the name of a type or END_TYPE")?;
        if QUALIFIERS.iter().any(|word| word.eq_ignore_ascii_case(name))
            && matches!(self.next.1, Token::Word(_))
        {
            at = self.next.0;
            name = self.name("the name of a type")?;
        }
        let base = if self.accept_word("EXTENDS")? {
            Some(self.qualified_name("the name of a structure")?)
        } else {
            None
        };
        self.expect(":", "`:` after the name of the type")?;
        let ty = self.specification(0)?;
        if let Type::Record(record) = &mut self.into.types[ty.0].ty {
            record.base = base.or(record.base.take());
            record.pack = pack;
        }
        self.into.declare(name, at, ty)?;
        self.end_of_declaration(ty)
    }

    /// Reads a list of variables. Only its constants are used.
    fn variables(&mut self) -> Result<(), Fault> {
        let begin = self.next.0;
        self.advance()?;
        let mut is_constant = false;
        while let Token::Word(word) = self.next.1 {
            let is_it = word.eq_ignore_ascii_case("CONSTANT");
            if !is_it && !QUALIFIERS.iter().any(|known| known.eq_ignore_ascii_case(word)) {
                break;
            }
            is_constant |= is_it;
            self.advance()?;
        }
        if is_constant {
            while !self.accept_word("END_VAR")? {
                self.constant()?;
            }
            return Ok(());
        }
        if !self.is_word("END_VAR") && !self.lexer.skip_past("END_VAR")? {
            return Err((begin, Wrong::Unfinished("list of variables")));
        }
        self.advance()
    }

    /// Reads a constant: `N : INT := 5;`.
    fn constant(&mut self) -> Result<(), Fault> {
        let name = match self.next.1 {
            Token::Word(name) => name,
            _ => return self.unexpected("the name of a constant or END_VAR"),
        };
        let mut value: Option<Expression> = None;
        loop {
            match self.next.1 {
                Token::Symbol(";") => break,
                Token::End => return self.unexpected("`;`"),
                Token::Word(_) if self.is_word("END_VAR") => return self.unexpected("`;`"),
                Token::Symbol(":=") if value.is_none() => value = Some(Expression::default()),
                token => {
                    if let Some(value) = &mut value {
                        value.push(token);
                    }
                }
            }
            self.advance()?;
        }
        if let Some(value) = value {
            self.into.declare_constant(name, value);
        }
        self.advance()
    }

    fn specification(&mut self, depth: usize) -> Result<TypeId, Fault> {
        let at = self.next.0;
        if depth > MAX_DEPTH {
            return Err((at, Wrong::TooDeep(MAX_DEPTH)));
        }
        let ty = self.ty(depth)?;
        Ok(self.into.add_type(at, ty))
    }

    fn ty(&mut self, depth: usize) -> Result<Type, Fault> {
        for (begin, end) in [("STRUCT", "END_STRUCT"), ("UNION", "END_UNION")] {
            if self.accept_word(begin)? {
                let base = match self.accept_word("EXTENDS")? {
                    true => Some(self.qualified_name("the name of a structure")?),
                    false => None,
                };
                let record = self.members(end, depth)?;
                return Ok(Type::Record(Record { base, is_union: begin == "UNION", ..record }));
            }
        }
        if self.accept_word("ARRAY")? {
            return self.array(depth);
        }
        if self.next.1 == Token::Symbol("(") {
            return self.enumeration();
        }
        for what in ["STRING", "WSTRING"] {
            if self.accept_word(what)? {
                if matches!(self.next.1, Token::Symbol("[" | "(")) {
                    self.group()?;
                }
                return Ok(Type::Unsized(what));
            }
        }
        for (word, behind) in [("POINTER", Some("TO")), ("REFERENCE", Some("TO")), ("REF_TO", None)] {
            if self.accept_word(word)? {
                if behind.is_some_and(|behind| !self.is_word(behind)) {
                    return self.unexpected("TO");
                }
                if behind.is_some() {
                    self.advance()?;
                }
                self.specification(depth + 1)?;
                return Ok(Type::Unsized("a pointer"));
            }
        }
        let name = self.qualified_name("a type")?;
        // A subrange is as large as its type, so the parser skips its bounds. The arguments of a function block have
        // the form of bounds.
        while matches!(self.next.1, Token::Symbol("(" | "[")) {
            self.group()?;
        }
        Ok(Type::Named(name))
    }

    /// Reads an enumeration: `(RED, GREEN)`, or with the elementary type of the values, `(RED, GREEN) UINT`.
    fn enumeration(&mut self) -> Result<Type, Fault> {
        self.group()?;
        match self.next.1 {
            Token::Word(word) if !is_keyword(word) => Ok(Type::Named(self.qualified_name("a type")?)),
            _ => Ok(Type::Unsized("an enumeration")),
        }
    }

    fn members(&mut self, end: &'static str, depth: usize) -> Result<Record, Fault> {
        let mut names = HashMap::new();
        let mut record = Record::default();
        while !self.is_word(end) {
            let mut group = Vec::new();
            loop {
                let at = self.next.0;
                let name = self.member_name(end)?;
                add(&mut names, name, at)?;
                group.push((name, at));
                if !self.accept(",")? {
                    break;
                }
            }
            if self.is_word("AT") {
                record.located.get_or_insert(self.next.0);
                self.advance()?;
                if self.next.1 != Token::Direct {
                    return self.unexpected("an address such as %B0");
                }
                self.advance()?;
            }
            self.expect(":", "`:` after the name of the member")?;
            let ty = self.specification(depth + 1)?;
            self.end_of_declaration(ty)?;
            record.members.extend(group.into_iter().map(|(name, at)| Member {
                name: name.to_owned(),
                at,
                ty,
            }));
        }
        // The attribute `pack_mode` has no meaning at a member. It is dropped, so that it does not apply to the next
        // structure.
        self.lexer.pack = None;
        self.advance()?;
        Ok(record)
    }

    /// Reads the name of a member. Some tools export members with the names of keywords: `type : USINT;`.
    fn member_name(&mut self, end: &'static str) -> Result<&'a str, Fault> {
        let expected = match end {
            "END_STRUCT" => "the name of a member or END_STRUCT",
            _ => "the name of a member or END_UNION",
        };
        match self.next.1 {
            Token::Word(word)
                if is_keyword(word)
                    && matches!(self.lexer.clone().next(), Ok((_, Token::Symbol(":" | ",")))) =>
            {
                self.advance()?;
                Ok(word)
            }
            _ => self.name(expected),
        }
    }

    fn array(&mut self, depth: usize) -> Result<Type, Fault> {
        self.expect("[", "`[` behind ARRAY")?;
        let mut bounds = Vec::new();
        loop {
            let place = self.next.0;
            let first = self.bound()?;
            let is_open = self.next.1 != Token::Symbol("..");
            let last = if is_open { first.clone() } else { self.upper_bound()? };
            if is_open && !first.is_open() {
                return self.unexpected("`..` after the lower bound");
            }
            bounds.push((place, first, last));
            if bounds.len() > MAX_DEPTH {
                return Err((place, Wrong::TooDeep(MAX_DEPTH)));
            }
            if !self.accept(",")? {
                break;
            }
        }
        self.expect("]", "`]` after the bounds")?;
        if !self.accept_word("OF")? {
            return self.unexpected("OF");
        }
        Ok(Type::Array { bounds, of: self.specification(depth + 1)? })
    }

    fn upper_bound(&mut self) -> Result<Expression, Fault> {
        self.advance()?;
        self.bound()
    }

    /// Reads an expression up to `..`, `,` or `]`.
    fn bound(&mut self) -> Result<Expression, Fault> {
        let mut bound = Expression::default();
        let mut open = 0;
        loop {
            match self.next.1 {
                Token::Symbol(".." | "," | "]") if open == 0 => break,
                Token::Symbol("(") => open += 1,
                Token::Symbol(")") if open > 0 => open -= 1,
                Token::Symbol(";" | ")" | "]") | Token::End => break,
                Token::Word(word) if is_keyword(word) => break,
                _ => {}
            }
            bound.push(self.next.1);
            self.advance()?;
        }
        if bound.is_empty() { self.unexpected("a number as array bound") } else { Ok(bound) }
    }

    /// Skips a value. Values do not influence offsets, and only the target's compiler checks their form.
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
                    return self.unexpected("`;` after the initial value");
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

    /// Skips an initial value, and the `;`. Some tools omit the `;` after END_STRUCT.
    fn end_of_declaration(&mut self, ty: TypeId) -> Result<(), Fault> {
        self.initial_value()?;
        if self.accept(";")? || self.into.record(ty).is_some() {
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

    /// Reads a name with namespaces: `N.S.T`.
    fn qualified_name(&mut self, expected: &'static str) -> Result<String, Fault> {
        let mut name = self.name(expected)?.to_owned();
        while self.accept(".")? {
            name.push('.');
            name.push_str(self.name(expected)?);
        }
        Ok(name)
    }

    fn is_word(&self, keyword: &str) -> bool {
        matches!(self.next.1, Token::Word(word) if word.eq_ignore_ascii_case(keyword))
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
        let found = self.is_word(keyword);
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
        Some(first) => Err((at, Wrong::Duplicate(name.to_owned(), first.to_string()))),
    }
}

fn is_keyword(word: &str) -> bool {
    KEYWORDS.iter().any(|keyword| keyword.eq_ignore_ascii_case(word))
}
