//! Output to the terminal, or to the file or pipe that replaces it.

mod bounded;

use super::{error::CliError, style};
use crate::input_file;
use crate::output_file;
use crate::plain_text::is_interpreted;
pub(crate) use bounded::give_up_after;
use serde::Serialize;
use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// Writes `text` to the standard output and flushes it. If the reader has closed the output, the text is dropped and the
/// command continues: its exit code does not depend on the reader.
///
/// # Errors
/// [`CliError::Output`]: the output cannot be written. [`CliError::Interrupted`]: the output is not read, and a signal
/// that this process handles has arrived.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    print_bytes(text.as_bytes())
}

/// Does the same as [`print()`], for any bytes.
pub(super) fn print_bytes(bytes: &[u8]) -> Result<(), CliError> {
    match print_while_read(bytes) {
        Err(CliError::BrokenPipe) => Ok(()),
        other => other,
    }
}

/// Checks that the standard output is stored, for the end of a command. Some file systems report only at `close` that a disk is
/// full.
///
/// # Errors
/// [`CliError::Output`]: the output cannot be stored.
pub(super) fn check_stored() -> Result<(), CliError> {
    // Without a free descriptor this cannot be checked.
    let Ok(copy) = io::stdout().as_fd().try_clone_to_owned() else { return Ok(()) };
    output_file::close(copy).map_err(|reason| CliError::Output { reason })
}

/// Writes the output to the file that the user has named; `-` is the standard output.
///
/// # Errors
/// [`CliError::File`]: the file cannot be written. For the standard output, returns the errors of [`print()`].
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    if input_file::is_standard(path) {
        return print_bytes(bytes);
    }
    output_file::write(path, bytes).map_err(|reason| CliError::File { path: path.to_owned(), reason })
}

/// Writes `bytes` to the standard output and flushes it. For commands that end when the reader closes the output.
///
/// # Errors
/// [`CliError::BrokenPipe`]: the reader has closed the output. Otherwise returns the errors of [`print()`].
pub(crate) fn print_while_read(bytes: &[u8]) -> Result<(), CliError> {
    bounded::write(|| io::stdout().lock(), bytes).map_err(|reason| match reason.kind() {
        io::ErrorKind::BrokenPipe => CliError::BrokenPipe,
        io::ErrorKind::Interrupted => CliError::Interrupted,
        _ => CliError::Output { reason },
    })
}

/// True if the standard output is a terminal that was closed.
pub(crate) fn is_closed_terminal() -> bool {
    rustix::termios::tcgetattr(io::stdout()).is_err_and(|error| error == rustix::io::Errno::IO)
}

/// Formats a value as JSON in several lines. Characters that a terminal interprets are escaped.
///
/// # Errors
/// [`CliError::Output`]: JSON cannot represent the value.
pub(crate) fn json(value: &impl Serialize) -> Result<String, CliError> {
    let text =
        serde_json::to_string_pretty(value).map_err(|error| CliError::Output { reason: error.into() })?;
    Ok(json_escaped(&text) + "\n")
}

/// Formats a value as JSON in one line, with its line end.
///
/// # Errors
/// Returns the errors of [`json()`].
pub(crate) fn json_line(value: &impl Serialize) -> Result<String, CliError> {
    let text = serde_json::to_string(value).map_err(|error| CliError::Output { reason: error.into() })?;
    Ok(json_escaped(&text) + "\n")
}

/// Escapes all characters in a JSON text that a terminal interprets; the meaning of the text stays the same. Outside of
/// strings, JSON contains no control characters except line ends.
fn json_escaped(text: &str) -> String {
    escaped(text, &['\n'], |sign| format!("\\u{:04x}", u32::from(sign)))
}

/// Escapes all characters in an XML text that a terminal interprets; the meaning of the text stays the same. The text
/// must not have comments or CDATA sections.
pub(crate) fn xml_escaped(text: &str) -> String {
    escaped(text, &['\n', '\t'], |sign| format!("&#x{:x};", u32::from(sign)))
}

/// Replaces each character that a terminal interprets by its spelling, except the characters `kept`.
fn escaped(text: &str, kept: &[char], spelling: impl Fn(char) -> String) -> String {
    let mut out = String::with_capacity(text.len());
    for sign in text.chars() {
        match is_interpreted(sign) && !kept.contains(&sign) {
            true => out.push_str(&spelling(sign)),
            false => out.push(sign),
        }
    }
    out
}

/// Longest word of a message, in characters.
const LONGEST_WORD: usize = 160;
/// Longest message, in characters.
const LONGEST: usize = 8_000;

/// Writes an error message to the standard error output. Very long words, for example from the input, are
/// shortened. Write errors are ignored.
pub(crate) fn complain(text: &str) {
    relay(format!("{} {}\n", style::error("commram:"), shortened(text)).as_bytes());
}

/// Copies bytes, such as the error output of another process, to the standard error output. Write errors are ignored.
pub(crate) fn relay(text: &[u8]) {
    let _ = bounded::write(|| io::stderr().lock(), text);
}

/// Writes a note, which is not an error, to the standard error output, unless the user gave `--quiet`.
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

/// True if the user gave `--quiet`: no notes and no progress.
pub(crate) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// True if the user gave `--verbose`: all messages.
pub(crate) fn is_verbose() -> bool {
    VERBOSE.load(Ordering::Relaxed)
}

/// Prints a text that may be long. If the terminal has fewer lines, a pager shows the text: the program in the variable
/// `PAGER`, or `less` if the variable is not set. If the variable is empty, no pager is used.
///
/// # Errors
/// Returns the errors of [`print()`].
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
        // Default options of `less`: F ends at once if the text is short, R shows colours, X leaves the text on the
        // screen.
        command.env("LESS", "FRX");
    }
    // Ctrl-C is for the pager. This process catches the signal, so that it does not end before the pager.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGINT, std::sync::Arc::default());
    let Ok(mut child) = command.spawn() else { return print(text) };
    if let Some(mut input) = child.stdin.take() {
        // An error is ignored: writing fails if the user leaves the pager before it has read the whole text.
        let _ = input.write_all(text.as_bytes());
    }
    match child.wait() {
        // The shell could not start the pager.
        Ok(status) if matches!(status.code(), Some(126 | 127)) => print(text),
        Ok(_) => Ok(()),
        Err(reason) => Err(CliError::Process { reason }),
    }
}

/// Prints help to the standard error output after wrong use.
pub(crate) fn print_help(text: &str) {
    relay(text.as_bytes());
}

/// Limits the length of words and of the whole text, and removes control characters.
fn shortened(text: &str) -> String {
    let text = &harmless(text);
    let words = text.split_inclusive([' ', '\n']).map(|word| cut(word, LONGEST_WORD));
    cut(&words.collect::<String>(), LONGEST)
}

/// Escapes control characters except line ends and tabs, and characters that change the direction of the text.
pub(crate) fn harmless(text: &str) -> String {
    escaped(text, &['\n', '\t'], |sign| sign.escape_default().to_string())
}

/// Escapes all characters that a terminal interprets, also line ends, in a text of the user that is part of a message.
pub(crate) fn in_one_line(text: &str) -> String {
    escaped(text, &[], |sign| sign.escape_default().to_string())
}

/// If the text is longer than `most`, keeps its beginning and its end, and inserts its length.
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
    fn json_and_xml_keep_their_meaning_without_characters_for_a_terminal() {
        let text = "\u{1b}[2J\u{7f}\u{9b}31m \u{202e}\u{200f} größe\t\n";
        let json = json(&text).unwrap() + &json_line(&[text]).unwrap();
        assert!(!json.chars().any(|sign| sign != '\n' && is_interpreted(sign)), "{json:?}");
        let back: Vec<String> = serde_json::from_str(json.lines().last().unwrap()).unwrap();
        assert_eq!(back, [text]);
        assert_eq!(xml_escaped("a\u{9b}<b/>\n\u{202e}"), "a&#x9b;<b/>\n&#x202e;");
    }

    #[test]
    fn long_input_in_a_message_is_cut() {
        let long = format!("`{}`: no such register; did you mean x?", "x".repeat(5_000_000));
        let text = shortened(&long);
        assert!(text.len() < 300, "{text}");
        assert!(text.starts_with("`xxx") && text.contains("... (5000004 characters) ..."), "{text}");
        assert!(text.ends_with("xxx`: no such register; did you mean x?"), "{text}");
        assert_eq!(shortened("unknown `w`\n  and more"), "unknown `w`\n  and more");
        assert_eq!(shortened("a\x1b[31mb\r\u{9b}\tc\n"), "a\\u{1b}[31mb\\r\\u{9b}\tc\n");
        assert_eq!(shortened("a\u{202e}b\u{2066}"), "a\\u{202e}b\\u{2066}");
        assert!(shortened(&"größe ".repeat(1_000_000)).chars().count() < 8_100);
    }
}
