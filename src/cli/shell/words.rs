//! Lines: whether they are commands, their words, whether they go on.

use crate::layout::did_you_mean;
use crate::script;

/// The words of a line if it is a command: its first word is the name of one, and it does not go on like a call or an
/// assignment. An error if a quote is open, or if the name of this program stands in front of it.
pub(super) fn of_command(line: &str, commands: &clap::Command) -> Option<Result<Vec<String>, &'static str>> {
    if let Some((_, rest)) = behind(line, "commram")
        && is_command(rest, commands)
    {
        return Some(Err("leave out `commram`: here commands stand without it"));
    }
    is_command(line, commands).then(|| split(line).ok_or("a quote is open"))
}

/// Whether the line is a command.
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

/// Who types one of these has had enough.
const ENOUGH: [&str; 2] = ["exit", "quit"];

/// What the shell is to end with, if a line says that it is to end.
pub(super) fn of_end(line: &str) -> Option<Result<u8, &'static str>> {
    let (_, rest) = ENOUGH.iter().find_map(|word| behind(line, word))?;
    match rest {
        "" => Some(Ok(0)),
        rest if rest.starts_with(['=', '(']) => None,
        code => Some(
            code.parse().map_err(|_| "behind `exit` or `quit` stands an exit code of 0 to 255, or nothing"),
        ),
    }
}

/// The first word of a line and what stands behind it, if it is this one.
fn behind<'a>(line: &'a str, word: &str) -> Option<(&'a str, &'a str)> {
    let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    (first == word).then(|| (first, rest.trim()))
}

/// With these words a statement of a scenario can begin.
const STATEMENTS: [&str; 18] = [
    "break", "const", "continue", "do", "else", "export", "fn", "for", "if", "import", "let", "loop",
    "private", "return", "switch", "throw", "try", "while",
];

/// What is wrong with a line that makes no sense as a piece of a scenario, if it looks like a command and is none: two words
/// stand side by side.
pub(super) fn no_command(line: &str, commands: &clap::Command) -> Option<String> {
    let (first, rest) = line.split_once(char::is_whitespace)?;
    let goes_on = |sign: char| sign.is_alphanumeric() || matches!(sign, '_' | '%' | '\'' | '"');
    let is_told = rest.trim_start().starts_with(goes_on) || rest.trim_start().starts_with("--");
    if !is_told || !is_word(first) {
        return None;
    }
    if script::verbs().iter().any(|verb| verb.name == first) {
        return Some(format!(
            "`{first}` is a verb: what it needs stands in brackets behind it, {first}(...)"
        ));
    }
    Some(format!("there is no command or verb `{first}`{}", meant(line, commands)))
}

/// Whether it can be meant as a command.
fn is_word(first: &str) -> bool {
    first.starts_with(|sign: char| sign.is_ascii_alphabetic())
        && first.chars().all(|sign| sign.is_ascii_alphanumeric() || matches!(sign, '-' | '_'))
        && !STATEMENTS.contains(&first)
}

/// Which command may be meant by a line that is none and makes no sense as a piece of a scenario either; nothing if it does not
/// look like one.
pub(super) fn meant(line: &str, commands: &clap::Command) -> String {
    let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    if !is_word(first) || rest.trim_start().starts_with(['=', '(']) {
        return String::new();
    }
    let names = commands.get_subcommands().filter(|command| !command.is_hide_set());
    did_you_mean(first, names.map(clap::Command::get_name).chain(ENOUGH))
}

/// Words between blanks; quotes hold words together, as in a shell. `None`: a quote is open.
pub(super) fn split(line: &str) -> Option<Vec<String>> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for sign in line.chars() {
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

/// Whether a piece of a scenario goes on in the next line: a bracket is open.
pub(super) fn is_open(text: &str) -> bool {
    let (mut depth, mut quote, mut signs) = (0_i32, None, text.chars().peekable());
    while let Some(sign) = signs.next() {
        match (quote, sign) {
            (Some(_), '\\') => {
                signs.next();
            }
            (Some(open), sign) if sign == open => quote = None,
            // A text between double quotes ends with its line.
            (Some('"'), '\n') => quote = None,
            (Some(_), _) => {}
            (None, '"' | '`') => quote = Some(sign),
            (None, '/') if signs.peek() == Some(&'/') => {
                signs.by_ref().take_while(|sign| *sign != '\n').for_each(drop);
            }
            (None, '(' | '[' | '{') => depth += 1,
            (None, ')' | ']' | '}') => depth -= 1,
            (None, _) => {}
        }
    }
    depth > 0
}

/// The text that is open at the end of a piece, and where it begins.
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
    fn commands_and_pieces_are_told_apart() {
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
    fn a_command_that_is_mistyped_is_guessed() {
        let commands = super::super::command("x");
        assert!(meant("peak node2.w_CPU_CONTROL", &commands).contains("peek"));
        assert!(meant("quti", &commands).contains("quit"));
        for piece in ["pek(1)", "peak = 1", "1 + 1", "zzzzzzzz 1", "for n in 0..3 {"] {
            assert_eq!(meant(piece, &commands), "", "{piece}");
        }
        let told = no_command("peak node2.w_CPU_CONTROL", &commands).unwrap();
        assert!(told.starts_with("there is no command or verb `peak`; did you mean peek"), "{told}");
        assert!(no_command("back_to 1", &commands).unwrap().contains("back_to(...)"));
        for piece in ["peak", "peak = 1", "x + 1", "for n in 0..3 {", "let x = ", "f (1"] {
            assert_eq!(no_command(piece, &commands), None, "{piece}");
        }
    }

    #[test]
    fn the_end_has_an_exit_code() {
        assert_eq!((of_end("exit"), of_end("quit 3"), of_end("exit = 1")), (Some(Ok(0)), Some(Ok(3)), None));
        assert!(of_end("exit 256").unwrap().is_err() && of_end("exits").is_none());
    }

    #[test]
    fn the_name_of_the_program_is_left_out() {
        let commands = super::super::command("x");
        assert!(of_command("commram peek node2.w_CPU_CONTROL", &commands).unwrap().is_err());
        assert_eq!(of_command("commram = 1", &commands), None);
    }

    #[test]
    fn quotes_hold_words_together() {
        assert_eq!(split("poke 'a b'=1  \"\"").unwrap(), ["poke", "a b=1", ""]);
        assert_eq!(split("peek 'a"), None);
    }

    #[test]
    fn a_piece_with_an_open_bracket_goes_on() {
        for open in ["if x {", "expect(", "let a = [1,", "f(\"(\", // )\n"] {
            assert!(is_open(open), "{open}");
        }
        for closed in ["", "step(\"1ms\")", "print(\"{\")", "// (", "f(`(`)"] {
            assert!(!is_open(closed), "{closed}");
        }
    }

    #[test]
    fn the_text_under_the_cursor_is_found() {
        assert_eq!(open_text("peek(\"node2"), Some(6));
        assert_eq!(open_text("peek(\"node2\")"), None);
    }
}
