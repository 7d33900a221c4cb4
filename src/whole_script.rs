//! Compiles scripts of Rhai, and finds their calls. The engine accepts a script whose last comment does not end, and skips the code in this
//! comment. Here it is an error.

use rhai::{AST, ASTNode, Engine, Expr, FnCallExpr, ParseError, ParseErrorType, Position, Stmt};

/// Maximum number of positions at which an open comment is searched.
const SEARCHED: usize = 16;

/// Signs of which a script has a limited number, with their meaning and the largest number. The engine compares each case and
/// each block with all earlier ones, so without a limit a script of some 100 KB takes minutes.
pub(crate) const LIMITED: [(&str, &str, usize); 2] = [("=>", "cases", 5_000), ("{", "blocks", 6_000)];

/// Compiles a script.
///
/// # Errors
/// The parser does not accept the text, a block comment does not end, or the script has too many cases or blocks.
pub(crate) fn compile(engine: &Engine, text: &str) -> Result<AST, ParseError> {
    for (sign, what, most) in LIMITED {
        // A sign in a text or comment counts, too.
        if let Some((at, _)) = text.match_indices(sign).nth(most) {
            let reason =
                ParseErrorType::LiteralTooLarge(format!("Number of {what} (`{sign}`) in a script"), most);
            return Err(ParseError(Box::new(reason), position(text.get(..at).unwrap_or_default())));
        }
    }
    let script = engine.compile(text)?;
    if !ends_in_comment(engine, text) {
        return Ok(script);
    }
    let begin = text.rmatch_indices("/*").take(SEARCHED).find(|(at, _)| {
        // Inside a comment, `text[..at]` ends in this comment, too.
        !ends_in_comment(engine, text.get(..*at).unwrap_or_default())
    });
    let position = begin.map_or(Position::NONE, |(at, _)| position(text.get(..at).unwrap_or_default()));
    let missing = ParseErrorType::MissingToken("*/".to_owned(), "to end this comment".to_owned());
    Err(ParseError(Box::new(missing), position))
}

/// Returns the call of a function or method that a node of the syntax tree is.
pub(crate) fn call_of<'a>(node: &ASTNode<'a>) -> Option<&'a FnCallExpr> {
    match node {
        ASTNode::Expr(Expr::FnCall(call, _) | Expr::MethodCall(call, _))
        | ASTNode::Stmt(Stmt::FnCall(call, _)) => Some(call),
        _ => None,
    }
}

/// True if a comment is open at the end of a text that the engine accepts: `*/` is an error outside of comments.
fn ends_in_comment(engine: &Engine, text: &str) -> bool {
    text.contains("/*") && engine.compile(format!("{text}\n*/")).is_ok()
}

/// Returns the position after a text, or no position if the script is too long for one.
fn position(before: &str) -> Position {
    let lines = before.bytes().filter(|byte| *byte == b'\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    match (u16::try_from(lines), u16::try_from(column)) {
        (Ok(line), Ok(column)) => Position::new(line, column),
        _ => Position::NONE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_of_cases_and_blocks_are_limited() {
        let engine = Engine::new();
        let script = |count: usize| {
            let cases: String = (0..count).map(|case| format!("{case}=>1,\n")).collect();
            format!("switch 1 {{\n{cases}}}")
        };
        assert!(compile(&engine, &script(5_000)).is_ok());
        let error = compile(&engine, &script(5_001)).unwrap_err();
        assert_eq!(error.1, Position::new(5002, 5));
        let text = error.0.to_string();
        assert_eq!(text, "Number of cases (`=>`) in a script exceeds the maximum limit (5000)");
        assert!(compile(&engine, &"{}".repeat(6_000)).is_ok());
        let error = compile(&engine, &"{}".repeat(6_001)).unwrap_err();
        assert!(error.0.to_string().starts_with("Number of blocks (`{`) in a script exceeds"), "{}", error.0);
    }

    #[test]
    fn a_comment_must_end() {
        let engine = Engine::new();
        for whole in [
            "1 /* a */",
            "/* a /* b */ c */ 1",
            "\"/*\"",
            "1 // /*",
            "`/* ${ 1 /* a */ }`",
            "",
            "let x = `/*`;",
        ] {
            assert!(compile(&engine, whole).is_ok(), "{whole}");
        }
        for (open, line, column) in [
            ("/* a", 1, 1),
            ("1; /* a */\n  /* b", 2, 3),
            ("1;\n/* a /* b */", 2, 1),
            ("fn f() { 1 }\n\"/*\"; /* /* /*", 2, 7),
        ] {
            let error = compile(&engine, open).unwrap_err();
            assert_eq!(error.1, Position::new(line, column), "{open}");
            assert!(error.0.to_string().contains("'*/' to end this comment"), "{}", error.0);
        }
        assert!(compile(&engine, "let x = ").is_err());
    }
}
