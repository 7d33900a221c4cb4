//! Lines: whether they are commands, their words, whether they go on.

use crate::layout::did_you_mean;

/// The words of a line if it is a command: its first word is the name of one, and it does not go on like a call or an
/// assignment. An error if a quote is open.
pub(super) fn of_command(line: &str, commands: &clap::Command) -> Option<Result<Vec<String>, &'static str>> {
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
pub(super) const ENOUGH: [&str; 2] = ["exit", "quit"];

/// Which command may be meant by a line that is none and makes no sense as a piece of a scenario either; nothing if it does not
/// look like one.
pub(super) fn meant(line: &str, commands: &clap::Command) -> String {
    let (first, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let is_word = first.chars().all(|sign| sign.is_ascii_alphanumeric() || matches!(sign, '-' | '_'));
    if !is_word || rest.trim_start().starts_with(['=', '(']) {
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
        for piece in ["pek(1)", "peak = 1", "1 + 1", "zzzzzzzz 1"] {
            assert_eq!(meant(piece, &commands), "", "{piece}");
        }
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
