//! Input lines at a terminal: editing, completion, history.

use super::{history, words};
use crate::cli::complete;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::script;
use crate::time::seconds;
use clap_complete::engine;
use rustyline::completion::{Completer, Pair};
use rustyline::error::ReadlineError;
use rustyline::highlight::Highlighter;
use rustyline::hint::Hinter;
use rustyline::history::FileHistory;
use rustyline::validate::{ValidationContext, ValidationResult, Validator};
use rustyline::{CompletionType, Config, Context, Editor, Helper};
use std::ffi::OsString;
use std::io;
use std::path::PathBuf;

pub(super) enum InputLine {
    /// A line, or several lines that together form a piece of a scenario.
    Line(String),
    /// The user discarded the line.
    Nothing,
    /// End of the input.
    End,
}

/// Reads lines from the terminal.
pub(super) struct LineReader {
    editor: Editor<LineHelper, FileHistory>,
    instance: String,
    history: Option<PathBuf>,
}

impl LineReader {
    /// Creates a reader for an instance. `command` is the command line that Tab completes.
    pub(super) fn new(instance: &str, command: clap::Command) -> Result<Self, CliError> {
        let config = Config::builder().completion_type(CompletionType::List).auto_add_history(false).build();
        let mut editor = Editor::with_config(config).map_err(failed)?;
        editor.set_helper(Some(LineHelper { instance: instance.to_owned(), command }));
        let history = history::file();
        if let Some(file) = &history {
            // Without a history file the shell starts with an empty history.
            let _ = editor.load_history(file);
        }
        Ok(Self { editor, instance: instance.to_owned(), history })
    }

    /// Reads the next line. The prompt shows the emulated time, if it is known.
    pub(super) fn next(&mut self, time_us: Option<u64>) -> Result<InputLine, CliError> {
        let time = time_us.map_or_else(String::new, |us| format!(" {}", seconds(us)));
        match self.editor.readline(&format!("{}{time}> ", self.instance)) {
            Ok(line) => {
                if self.editor.add_history_entry(&line).unwrap_or(false)
                    && let Some(file) = &self.history
                {
                    // If the file cannot be written, the line stays in the history until the shell ends.
                    let _ = self.editor.append_history(file);
                }
                Ok(InputLine::Line(line))
            }
            Err(ReadlineError::Interrupted) => Ok(InputLine::Nothing),
            Err(ReadlineError::Eof) => Ok(InputLine::End),
            Err(ReadlineError::Io(reason)) if reason.kind() == io::ErrorKind::InvalidData => {
                // The terminal may still hold the rest of the line. It is discarded; otherwise it would be read as
                // another line.
                let _ = rustix::termios::tcflush(io::stdin(), rustix::termios::QueueSelector::IFlush);
                output::complain("this line is no text in UTF-8; it was not executed");
                Ok(InputLine::Nothing)
            }
            Err(error) => Err(failed(error)),
        }
    }
}

fn failed(error: ReadlineError) -> CliError {
    CliError::Output { reason: io::Error::other(error) }
}

struct LineHelper {
    instance: String,
    command: clap::Command,
}

impl Helper for LineHelper {}

impl Hinter for LineHelper {
    type Hint = String;
}

impl Highlighter for LineHelper {}

impl Validator for LineHelper {
    fn validate(&self, context: &mut ValidationContext<'_>) -> rustyline::Result<ValidationResult> {
        let text = context.input();
        let is_incomplete = words::continues(text, &self.command);
        Ok(if is_incomplete { ValidationResult::Incomplete } else { ValidationResult::Valid(None) })
    }
}

impl Completer for LineHelper {
    type Candidate = Pair;

    fn complete(&self, line: &str, at: usize, _: &Context<'_>) -> rustyline::Result<(usize, Vec<Pair>)> {
        let before = line.get(..at).unwrap_or(line);
        let (begin, names) = completed(before, &self.instance, &self.command);
        let pair = |name: String| Pair { display: name.clone(), replacement: name };
        Ok((begin, names.into_iter().map(pair).collect()))
    }
}

/// Returns the candidates for the end of a line, and the position where the word to complete begins.
fn completed(before: &str, instance: &str, command: &clap::Command) -> (usize, Vec<String>) {
    let about = |mut words: Vec<String>| {
        words.splice(0..0, ["commram", "-i", instance].map(str::to_owned));
        words
    };
    if words::is_command(before, command) && before.contains(char::is_whitespace) {
        let begin = complete::start_of_word(before);
        let (Some(mut words), word) = (words::split(&before[..begin]), &before[begin..]) else {
            return (begin, Vec::new());
        };
        let quote = word.starts_with(['\'', '"']);
        words.push(word.trim_start_matches(['\'', '"']).to_owned());
        let arguments: Vec<_> = words.iter().map(OsString::from).collect();
        let index = arguments.len().saturating_sub(1);
        let find = || engine::complete(&mut command.clone(), arguments, index, None);
        let found = complete::within(&about(words), find).unwrap_or_default();
        let names = found.iter().map(|candidate| candidate.get_value().to_string_lossy().into_owned());
        return (begin + usize::from(quote), names.collect());
    }
    if let Some(begin) = words::open_text(before) {
        let word = &before[begin..];
        let names = complete::within(&about(vec![word.to_owned()]), || complete::register_names(word));
        return (begin, names);
    }
    let begin = before
        .rfind(|sign: char| !sign.is_alphanumeric() && !matches!(sign, '_' | '-'))
        .map_or(0, |at| at + 1);
    let word = before.get(begin..).unwrap_or_default();
    let commands = command.get_subcommands().filter(|command| begin == 0 && !command.is_hide_set());
    let commands = commands.map(|command| command.get_name().to_owned());
    let verbs = script::verbs().into_iter().map(|verb| format!("{}(", verb.name));
    let mut names: Vec<_> = commands.chain(verbs).filter(|name| name.starts_with(word)).collect();
    names.sort();
    names.dedup();
    (begin, names)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complete(before: &str) -> (usize, Vec<String>) {
        completed(before, "no-such-instance", &super::super::command("no-such-instance"))
    }

    #[test]
    fn commands_and_verbs_are_completed_where_they_are_valid() {
        assert_eq!(complete("pee"), (0, vec!["peek".to_owned(), "peek(".to_owned()]));
        assert_eq!(complete("let x = pee"), (8, vec!["peek(".to_owned()]));
    }

    #[test]
    fn registers_and_values_are_completed_in_commands_and_in_texts() {
        assert_eq!(complete("peek node2.w_OPTION_S"), (5, vec!["node2.w_OPTION_STATUS".to_owned()]));
        assert_eq!(complete("peek(\"node2.w_OPTION_S"), (6, vec!["node2.w_OPTION_STATUS".to_owned()]));
        assert_eq!(
            complete("poke node2.w_CPU_CONTROL=hand"),
            (5, vec!["node2.w_CPU_CONTROL=handshake".to_owned()])
        );
        // A no-break space has two bytes.
        assert_eq!(complete("peek\u{A0}node2.w_OPTION_S").0, "peek\u{A0}".len());
        assert_eq!(complete("peek --ra"), (5, vec!["--raw".to_owned()]));
    }
}
