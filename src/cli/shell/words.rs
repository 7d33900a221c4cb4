//! Analysis of input lines: commands, words, incomplete pieces.

use crate::layout::did_you_mean;
use crate::script;

/// If a line is a command, splits it into words. A line is a command if its first word is the name of a command and it
/// does not continue like a call or an assignment. Returns an error if a quote is open, or if the line begins with the
/// name of this program.
pub(super) fn of_command(line: &str, commands: &clap::Command) -> Option<Result<Vec<String>, &'static str>> {
    if let Some((_, rest)) = after_first_word(line, "commram")
        && is_command(rest, commands)
    {
        return Some(Err("leave out `commram`: the shell needs only the command"));
    }
    is_command(line, commands).then(|| split(line).ok_or("a quote is open"))
}

/// True if the line is a command.
pub(super) fn is_command(line: &str, commands: &clap::Command) -> bool {
    let line = line.trim_start();
    let end = line.find(|sign: char| !sign.is_alphanumeric() && sign != '-').unwrap_or(line.len());
    let (first, rest) = line.split_at(end);
    let next = rest.trim_start().chars().next();
    let is_alone = rest.is_empty() || rest.starts_with(char::is_whitespace);
    is_alone
        && !matches!(next, Some('=' | '('))
        && (first == "help" || commands.find_subcommand(first).is_some())
}

/// If the line asks for help, returns the subject, which may be empty.
pub(super) fn of_help(line: &str) -> Option<&str> {
    let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    match first.strip_prefix('?') {
        Some(subject) => Some(if subject.is_empty() { rest.trim() } else { subject }),
        None => (line == "help").then_some(""),
    }
}

/// Words that end the shell.
const ENOUGH: [&str; 2] = ["exit", "quit"];

/// If the line ends the shell, returns its exit code.
pub(super) fn of_end(line: &str) -> Option<Result<u8, &'static str>> {
    let (_, rest) = ENOUGH.iter().find_map(|word| after_first_word(line, word))?;
    match rest {
        "" => Some(Ok(0)),
        rest if rest.starts_with(['=', '(']) => None,
        code => {
            Some(code.parse().map_err(|_| "write `exit` or `quit`, alone or with an exit code of 0 to 255"))
        }
    }
}

/// If `word` is the first word of the line, returns it and the rest of the line.
fn after_first_word<'a>(line: &'a str, word: &str) -> Option<(&'a str, &'a str)> {
    let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    (first == word).then(|| (first, rest.trim()))
}

/// Words that begin a statement of a scenario.
const STATEMENTS: [&str; 18] = [
    "break", "const", "continue", "do", "else", "export", "fn", "for", "if", "import", "let", "loop",
    "private", "return", "switch", "throw", "try", "while",
];

/// Returns the error for a line that is neither a command nor valid in a scenario but looks like a command: two words
/// without an operator between them.
pub(super) fn no_command(line: &str, commands: &clap::Command) -> Option<String> {
    let (first, rest) = line.split_once(char::is_whitespace)?;
    let begins_word = |sign: char| sign.is_alphanumeric() || matches!(sign, '_' | '%' | '\'' | '"');
    let is_continued = rest.trim_start().starts_with(begins_word) || rest.trim_start().starts_with("--");
    if !is_continued || !is_word(first) {
        return None;
    }
    if script::verbs().iter().any(|verb| verb.name == first) {
        return Some(format!("`{first}` is a verb: write its arguments in parentheses, {first}(...)"));
    }
    Some(format!("there is no command or verb `{first}`{}", meant(line, commands)))
}

/// True if the word can be the name of a command.
fn is_word(first: &str) -> bool {
    first.starts_with(|sign: char| sign.is_ascii_alphabetic())
        && first.chars().all(|sign| sign.is_ascii_alphanumeric() || matches!(sign, '-' | '_'))
        && !STATEMENTS.contains(&first)
}

/// Suggests a command for a line that is neither a command nor valid in a scenario. Returns an empty text if the line
/// does not look like a command.
pub(super) fn meant(line: &str, commands: &clap::Command) -> String {
    let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    if !is_word(first) || rest.trim_start().starts_with(['=', '(']) {
        return String::new();
    }
    let names = commands.get_subcommands().filter(|command| !command.is_hide_set());
    did_you_mean(first, names.map(clap::Command::get_name).chain(ENOUGH))
}

/// Splits a line at blanks. Quotes keep words together, as in a shell. A word that begins with `#`, or the word `//`,
/// begins a comment. Returns `None` if a quote is open.
pub(super) fn split(line: &str) -> Option<Vec<String>> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for (at, sign) in line.char_indices() {
        let is_comment = || {
            let rest = &line[at..];
            let after = rest.strip_prefix("//");
            sign == '#' || after.is_some_and(|rest| rest.is_empty() || rest.starts_with(char::is_whitespace))
        };
        if quote.is_none() && word.is_none() && is_comment() {
            break;
        }
        match (quote, sign) {
            (Some(open), sign) if sign == open => quote = None,
            (Some(_), sign) => word.get_or_insert_default().push(sign),
            (None, '\'' | '"') => {
                word.get_or_insert_default();
                quote = Some(sign);
            }
            (None, sign) if sign.is_whitespace() => words.extend(word.take()),
            (None, sign) => word.get_or_insert_default().push(sign),
        }
    }
    words.extend(word);
    quote.is_none().then_some(words)
}

/// True if the input continues in the next line: it is a piece of a scenario in which a bracket, a block comment or a text
/// in backticks is open.
pub(super) fn continues(text: &str, commands: &clap::Command) -> bool {
    !text.trim_start().starts_with('#') && !is_command(text, commands) && is_open(text)
}

fn is_open(text: &str) -> bool {
    let (mut depth, mut quote, mut signs) = (0_i32, None, text.chars().peekable());
    while let Some(sign) = signs.next() {
        match (quote, sign) {
            (Some(_), '\\') => {
                signs.next();
            }
            (Some(open), sign) if sign == open => quote = None,
            // In scripts, a text between double quotes cannot continue in the next line.
            (Some('"'), '\n') => quote = None,
            (Some(_), _) => {}
            (None, '"' | '`') => quote = Some(sign),
            (None, '/') if signs.peek() == Some(&'/') => {
                signs.by_ref().take_while(|sign| *sign != '\n').for_each(drop);
            }
            (None, '/') if signs.peek() == Some(&'*') => {
                if !skip_comment(&mut signs) {
                    return true;
                }
            }
            (None, '(' | '[' | '{') => depth += 1,
            (None, ')' | ']' | '}') => depth -= 1,
            (None, _) => {}
        }
    }
    depth > 0 || quote == Some('`')
}

/// Skips the rest of a block comment after its `/`. Comments can be nested. Returns false if the comment does not end.
fn skip_comment(signs: &mut core::iter::Peekable<core::str::Chars<'_>>) -> bool {
    signs.next();
    let mut depth = 1;
    while let Some(sign) = signs.next() {
        match (sign, signs.peek()) {
            ('/', Some('*')) => depth += 1,
            ('*', Some('/')) => depth -= 1,
            _ => continue,
        }
        signs.next();
        if depth == 0 {
            return true;
        }
    }
    false
}

/// Returns the position where an unclosed text at the end of a piece begins.
pub(super) fn open_text(piece: &str) -> Option<usize> {
    let mut begin = None;
    for (at, sign) in piece.char_indices().filter(|(_, sign)| *sign == '"') {
        begin = if begin.is_some() { None } else { Some(at + sign.len_utf8()) };
    }
    begin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_and_pieces_of_scenarios_are_distinguished() {
        let commands = super::super::command("x");
        for command in ["peek node2.w_CPU_CONTROL", "list", "step 1ms", "help", "help peek", "test a.rhai"] {
            assert!(is_command(command, &commands), "{command}");
        }
        for piece in [
            "peek(\"node2.w_CPU_CONTROL\")",
            "step = 1",
            "let x = 1",
            "peeks x",
            "now()",
            "1 + 1",
            "wait (1)",
        ] {
            assert!(!is_command(piece, &commands), "{piece}");
        }
    }

    #[test]
    fn a_command_is_suggested_for_a_mistyped_one() {
        let commands = super::super::command("x");
        assert!(meant("peak node2.w_CPU_CONTROL", &commands).contains("peek"));
        assert!(meant("quti", &commands).contains("quit"));
        for piece in ["pek(1)", "peak = 1", "1 + 1", "zzzzzzzz 1", "for n in 0..3 {"] {
            assert_eq!(meant(piece, &commands), "", "{piece}");
        }
        let message = no_command("peak node2.w_CPU_CONTROL", &commands).unwrap();
        assert!(message.starts_with("there is no command or verb `peak`; did you mean peek"), "{message}");
        assert!(no_command("back_to 1", &commands).unwrap().contains("back_to(...)"));
        for piece in ["peak", "peak = 1", "x + 1", "for n in 0..3 {", "let x = ", "f (1"] {
            assert_eq!(no_command(piece, &commands), None, "{piece}");
        }
    }

    #[test]
    fn a_question_mark_asks_for_help() {
        assert_eq!((of_help("?"), of_help("help"), of_help("? peek")), (Some(""), Some(""), Some("peek")));
        assert_eq!((of_help("?peek"), of_help("help peek"), of_help("peek x")), (Some("peek"), None, None));
    }

    #[test]
    fn the_end_has_an_exit_code() {
        assert_eq!((of_end("exit"), of_end("quit 3"), of_end("exit = 1")), (Some(Ok(0)), Some(Ok(3)), None));
        assert!(of_end("exit 256").unwrap().is_err() && of_end("exits").is_none());
    }

    #[test]
    fn the_name_of_the_program_is_refused() {
        let commands = super::super::command("x");
        assert!(of_command("commram peek node2.w_CPU_CONTROL", &commands).unwrap().is_err());
        assert_eq!(of_command("commram = 1", &commands), None);
    }

    #[test]
    fn a_comment_ends_a_command() {
        for line in ["step 1us # c", "step 1us // c 'd", "step 1us #c", "step 1us //"] {
            assert_eq!(split(line).unwrap(), ["step", "1us"], "{line}");
        }
        assert_eq!(
            split("poke a=16#0001 'b # c' http://d").unwrap(),
            ["poke", "a=16#0001", "b # c", "http://d"]
        );
    }

    #[test]
    fn quotes_hold_words_together() {
        assert_eq!(split("poke 'a b'=1  \"\"").unwrap(), ["poke", "a b=1", ""]);
        assert_eq!(split("peek 'a"), None);
    }

    #[test]
    fn a_piece_with_an_open_bracket_continues() {
        let commands = super::super::command("x");
        for open in [
            "if x {",
            "expect(",
            "let a = [1,",
            "f(\"(\", // )\n",
            "/* a",
            "/* a /* b */\nc",
            "1 /* )",
            "let a = `b",
        ] {
            assert!(continues(open, &commands), "{open}");
        }
        for closed in [
            "",
            "step(\"1ms\")",
            "print(\"{\")",
            "// (",
            "f(`(`)",
            "/* ( /* [ */ */",
            "\"/*\"",
            "# a (/*",
            "test scenarios/*.rhai",
            "/**/",
        ] {
            assert!(!continues(closed, &commands), "{closed}");
        }
    }

    #[test]
    fn the_text_under_the_cursor_is_found() {
        assert_eq!(open_text("peek(\"node2"), Some(6));
        assert_eq!(open_text("peek(\"node2\")"), None);
    }
}
