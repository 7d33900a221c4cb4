//! Output to the terminal, or to the file or pipe that replaces it.

use super::{error::CliError, style};
use std::io::{self, IsTerminal, Write};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Writes `text` to the standard output and flushes it.
///
/// # Errors
/// [`CliError::BrokenPipe`] if the reader has closed the output, [`CliError::Output`] for other errors.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    write(text.as_bytes())
}

/// Writes `bytes` to the standard output and flushes it.
///
/// # Errors
/// As [`print()`].
pub(crate) fn write(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    out.write_all(bytes).and_then(|()| out.flush()).map_err(|reason| match reason.kind() {
        io::ErrorKind::BrokenPipe => CliError::BrokenPipe,
        _ => CliError::Output { reason },
    })
}

/// Longest word of a message, in characters.
const LONGEST_WORD: usize = 160;
/// Longest message, in characters.
const LONGEST: usize = 8_000;

/// Writes an error message to the standard error output. Very long words, for example from the input, are
/// shortened. Write errors are ignored.
pub(crate) fn complain(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{} {}", style::error("commram:"), shortened(text));
}

/// Copies the error output of another process to the standard error output.
pub(crate) fn relay(text: &[u8]) {
    let _ = io::stderr().lock().write_all(text);
}

/// Writes a note, which is not an error, to the standard error output, unless the user wants none.
pub(crate) fn note(text: &str) {
    if !is_quiet() {
        complain(&format!("note: {text}"));
    }
}

static QUIET: AtomicBool = AtomicBool::new(false);
static VERBOSE: AtomicBool = AtomicBool::new(false);

/// Sets how much this process prints besides results and errors.
pub(crate) fn set_verbosity(is_quiet: bool, is_verbose: bool) {
    QUIET.store(is_quiet, Ordering::Relaxed);
    VERBOSE.store(is_verbose, Ordering::Relaxed);
}

/// True if the user wants no notes and no progress.
pub(crate) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// True if the user wants all messages.
pub(crate) fn is_verbose() -> bool {
    VERBOSE.load(Ordering::Relaxed)
}

/// Prints a text that may be long. On a terminal with fewer lines the user's pager shows it: the program of the
/// variable `PAGER`, `less` without it; none if the variable is empty.
///
/// # Errors
/// As [`print()`].
pub(crate) fn page(text: &str) -> Result<(), CliError> {
    let rows = rustix::termios::tcgetwinsize(io::stdout()).map_or(0, |size| usize::from(size.ws_row));
    if !io::stdout().is_terminal() || rows == 0 || text.lines().count() < rows {
        return print(text);
    }
    let pager = std::env::var("PAGER").unwrap_or_else(|_| "less".to_owned());
    if pager.trim().is_empty() {
        return print(text);
    }
    let mut command = Command::new("sh");
    command.args(["-c", &pager]).stdin(Stdio::piped());
    if std::env::var_os("LESS").is_none() {
        // Colours, no pager for a short text, the text stays on the screen.
        command.env("LESS", "FRX");
    }
    // Ctrl-C belongs to the pager.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGINT, std::sync::Arc::default());
    let Ok(mut child) = command.spawn() else { return print(text) };
    if let Some(mut input) = child.stdin.take() {
        // A user may leave the pager before the end of the text.
        let _ = input.write_all(text.as_bytes());
    }
    match child.wait() {
        // The shell has not found the program.
        Ok(status) if matches!(status.code(), Some(126 | 127)) => print(text),
        Ok(_) => Ok(()),
        Err(reason) => Err(CliError::Process { reason }),
    }
}

/// Prints help to the standard error output after wrong use.
pub(crate) fn print_help(text: &str) {
    let _ = write!(io::stderr().lock(), "{text}");
}

/// Limits the length of words and of the whole text, and removes control characters.
fn shortened(text: &str) -> String {
    let text = &harmless(text);
    let words = text.split_inclusive([' ', '\n']).map(|word| cut(word, LONGEST_WORD));
    cut(&words.collect::<String>(), LONGEST)
}

/// Escapes control characters except line ends and tabs.
pub(crate) fn harmless(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for sign in text.chars() {
        match sign {
            '\n' | '\t' => out.push(sign),
            sign if sign.is_control() => out.extend(sign.escape_default()),
            sign => out.push(sign),
        }
    }
    out
}

/// If the text is longer than `most`, keeps its beginning and its end and names its length.
fn cut(text: &str, most: usize) -> String {
    let count = text.chars().count();
    if count <= most {
        return text.to_owned();
    }
    let part = |from: usize, len: usize| text.chars().skip(from).take(len).collect::<String>();
    let (head, tail) = (most * 3 / 4, most / 8);
    format!("{}... ({count} characters) ...{}", part(0, head), part(count - tail, tail))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_input_in_a_message_is_cut() {
        let long = format!("`{}`: no such register; did you mean x?", "x".repeat(5_000_000));
        let text = shortened(&long);
        assert!(text.len() < 300, "{text}");
        assert!(text.starts_with("`xxx") && text.contains("... (5000004 characters) ..."), "{text}");
        assert!(text.ends_with("xxx`: no such register; did you mean x?"), "{text}");
        assert_eq!(shortened("unknown `w`\n  and more"), "unknown `w`\n  and more");
        assert_eq!(shortened("a\x1b[31mb\r\u{9b}\tc\n"), "a\\u{1b}[31mb\\r\\u{9b}\tc\n");
        assert!(shortened(&"größe ".repeat(1_000_000)).chars().count() < 8_100);
    }
}
