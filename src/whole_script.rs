//! Compiles scripts of Rhai, and finds their calls. The engine accepts a script whose last comment does not end, and skips the code in this
//! comment. Here it is an error.

use rhai::{AST, ASTNode, Engine, Expr, FnCallExpr, ParseError, ParseErrorType, Position, Stmt};

/// Maximum number of positions at which an open comment is searched.
const SEARCHED: usize = 16;

/// Maximum number of cases of `switch` in a script. The engine compares each case with all earlier ones, so without a limit
/// a script of some 100 KB takes minutes.
const MOST_CASES: usize = 2_000;

/// Compiles a script.
///
/// # Errors
/// The parser does not accept the text, a block comment does not end, or the script has too many cases.
pub(crate) fn compile(engine: &Engine, text: &str) -> Result<AST, ParseError> {
    // An arrow in a text or comment counts, too.
    if let Some((at, _)) = text.match_indices("=>").nth(MOST_CASES) {
        let what = "Number of cases (`=>`) in a script".to_owned();
        let reason = ParseErrorType::LiteralTooLarge(what, MOST_CASES);
        return Err(ParseError(Box::new(reason), position(text.get(..at).unwrap_or_default())));
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
    fn the_number_of_cases_is_limited() {
        let engine = Engine::new();
        let script = |count: usize| {
            let cases: String = (0..count).map(|case| format!("{case}=>1,\n")).collect();
            format!("switch 1 {{\n{cases}}}")
        };
        assert!(compile(&engine, &script(MOST_CASES)).is_ok());
        let error = compile(&engine, &script(MOST_CASES + 1)).unwrap_err();
        assert_eq!(error.1, Position::new(2002, 5));
        let text = error.0.to_string();
        assert_eq!(text, "Number of cases (`=>`) in a script exceeds the maximum limit (2000)");
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
