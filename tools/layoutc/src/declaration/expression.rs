//! Constant expressions: the bounds of arrays, and the constants in them.

use super::error::Wrong;
use super::lexer::Token;
use super::{Constant, Declarations};
use std::collections::HashMap;

/// Maximum number of tokens of an expression.
pub(crate) const MAX_TOKENS: usize = 64;
/// Maximum depth of constants that refer to each other.
const MAX_DEPTH: usize = 32;

/// An expression as written. An expression is evaluated only if its value is needed. So a library may contain invalid
/// expressions that no type needs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Expression(Vec<Part>);

#[derive(Debug, Clone, PartialEq, Eq)]
enum Part {
    Number(String),
    /// A constant, without the names of the lists and namespaces before it.
    Name(String),
    Symbol(&'static str),
    /// A token that cannot be a part of an expression of whole numbers.
    Other(String),
}

impl Expression {
    /// Adds the next token. Tokens after [`MAX_TOKENS`] are dropped, and the expression then has no value.
    pub(crate) fn push(&mut self, token: Token<'_>) {
        if self.0.len() > MAX_TOKENS {
            return;
        }
        let qualifies = matches!(self.0.last(), Some(Part::Symbol("." | "#")));
        let part = match token {
            Token::Word(name) => {
                if qualifies {
                    self.drop_qualifier();
                }
                Part::Name(name.to_owned())
            }
            Token::Number(text) => {
                if qualifies {
                    self.drop_qualifier();
                }
                Part::Number(text.to_owned())
            }
            Token::Symbol(symbol) => Part::Symbol(symbol),
            other => Part::Other(other.description()),
        };
        self.0.push(part);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// True if the expression is the `*` of `ARRAY[*]`.
    pub(crate) fn is_open(&self) -> bool {
        self.0 == [Part::Symbol("*")]
    }

    /// Removes `GVL.` or `UINT#`.
    fn drop_qualifier(&mut self) {
        if let [.., Part::Name(_), Part::Symbol(_)] = self.0[..] {
            self.0.truncate(self.0.len() - 2);
        }
    }

    fn text(&self) -> String {
        let texts = self.0.iter().map(|part| match part {
            Part::Number(text) | Part::Name(text) | Part::Other(text) => text.as_str(),
            Part::Symbol(symbol) => symbol,
        });
        texts.collect()
    }
}

/// State of a constant's value.
#[derive(Clone)]
enum ValueState {
    /// The value is being computed. A reference to the constant at this time is circular.
    Open,
    Known(Result<i64, Wrong>),
}

/// Values of constants, each evaluated once.
pub(crate) struct Values<'a> {
    declarations: &'a Declarations,
    known: HashMap<&'a str, ValueState>,
}

impl<'a> Values<'a> {
    pub(crate) fn new(declarations: &'a Declarations) -> Self {
        Self { declarations, known: HashMap::new() }
    }

    /// Returns the value of an expression, in the range of a DINT.
    pub(crate) fn of(&mut self, expression: &'a Expression) -> Result<i64, Wrong> {
        self.evaluate(expression, 0)
    }

    fn evaluate(&mut self, expression: &'a Expression, depth: usize) -> Result<i64, Wrong> {
        let bad = || Wrong::BadBound(expression.text());
        if expression.is_open() {
            return Err(Wrong::NoSize("an array without bounds".to_owned()));
        }
        if expression.0.len() > MAX_TOKENS {
            return Err(Wrong::LongExpression(MAX_TOKENS));
        }
        let mut rest = Rest { values: self, parts: &expression.0, depth };
        let value = rest.sum()?.filter(|value| i32::try_from(*value).is_ok());
        if rest.parts.is_empty() { value.ok_or_else(bad) } else { Err(bad()) }
    }

    fn constant(&mut self, name: &'a str, depth: usize) -> Result<i64, Wrong> {
        let lower = name.to_ascii_lowercase();
        let Some((key, found)) = self.declarations.constants.get_key_value(&lower) else {
            return Err(Wrong::UnknownConstant(name.to_owned()));
        };
        match self.known.get(key.as_str()) {
            Some(ValueState::Open) => return Err(Wrong::CircularConstant(name.to_owned())),
            Some(ValueState::Known(value)) => return value.clone(),
            None if depth >= MAX_DEPTH => return Err(Wrong::DeepConstant(name.to_owned(), MAX_DEPTH)),
            None => {}
        }
        self.known.insert(key, ValueState::Open);
        let value = match found {
            Constant::Once(expression) => self.evaluate(expression, depth + 1),
            Constant::Several => Err(Wrong::SeveralConstants(name.to_owned())),
        };
        self.known.insert(key, ValueState::Known(value.clone()));
        value
    }
}

/// The rest of an expression during its evaluation. It has at most [`MAX_TOKENS`] tokens, which bounds the recursion.
/// `None` is a value that is no whole number.
struct Rest<'a, 'v> {
    values: &'v mut Values<'a>,
    parts: &'a [Part],
    depth: usize,
}

impl<'a> Rest<'a, '_> {
    fn take(&mut self) -> Option<&'a Part> {
        let (first, rest) = self.parts.split_first()?;
        self.parts = rest;
        Some(first)
    }

    fn accept(&mut self, symbol: &str) -> bool {
        let found = matches!(self.parts.first(), Some(Part::Symbol(next)) if *next == symbol);
        if found {
            self.take();
        }
        found
    }

    fn sum(&mut self) -> Result<Option<i64>, Wrong> {
        let mut value = self.product()?;
        loop {
            if self.accept("+") {
                value = combine(value, self.product()?, i64::checked_add);
            } else if self.accept("-") {
                value = combine(value, self.product()?, i64::checked_sub);
            } else {
                return Ok(value);
            }
        }
    }

    fn product(&mut self) -> Result<Option<i64>, Wrong> {
        let mut value = self.factor()?;
        loop {
            if self.accept("*") {
                value = combine(value, self.factor()?, i64::checked_mul);
            } else if self.accept("/") {
                value = combine(value, self.factor()?, i64::checked_div);
            } else if matches!(self.parts.first(), Some(Part::Name(name)) if name.eq_ignore_ascii_case("MOD"))
            {
                self.take();
                value = combine(value, self.factor()?, i64::checked_rem);
            } else {
                return Ok(value);
            }
        }
    }

    fn factor(&mut self) -> Result<Option<i64>, Wrong> {
        match self.take() {
            Some(Part::Symbol("-")) => Ok(self.factor()?.and_then(i64::checked_neg)),
            Some(Part::Symbol("+")) => self.factor(),
            Some(Part::Symbol("(")) => {
                let value = self.sum()?;
                Ok(value.filter(|_| self.accept(")")))
            }
            Some(Part::Number(text)) => Ok(whole(text)),
            Some(Part::Name(name)) => self.values.constant(name, self.depth).map(Some),
            Some(Part::Symbol(_) | Part::Other(_)) | None => Ok(None),
        }
    }
}

fn combine(left: Option<i64>, right: Option<i64>, with: fn(i64, i64) -> Option<i64>) -> Option<i64> {
    with(left?, right?)
}

/// Returns a whole number that fits a DINT: `31`, `1_000`, `16#1F`.
fn whole(text: &str) -> Option<i64> {
    let (base, digits) = match text.split_once('#') {
        Some((base, digits)) => (base.parse().ok().filter(|base| [2, 8, 16].contains(base))?, digits),
        None => (10, text),
    };
    let digits = digits.replace('_', "");
    i64::from_str_radix(&digits, base).ok().filter(|value| *value <= i64::from(i32::MAX))
}
