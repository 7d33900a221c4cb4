//! Hints for mistakes in the command line: words and options of other programs, and missing arguments.

use super::output;
use crate::devices;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, Error};

/// Entries: a command, an invalid word that users write after this command, and the correct command line.
const WORDS: &[(&str, &str, &str)] = &[
    ("", "back", "commram step --back TIME"),
    ("", "undo", "commram step --back TIME"),
    ("", "advance", "commram step TIME"),
    ("", "pause", "commram speed 0"),
    ("", "resume", "commram speed 1"),
    ("", "load", "commram restore FILE"),
    ("", "save", "commram snapshot FILE"),
    ("", "validate", "commram plant check PLANT.toml"),
    ("", "monitor", "commram watch"),
    ("", "ui", "commram view"),
    ("", "exec", "commram with -- COMMAND"),
    ("", "registers", "commram map"),
    ("", "faults", "commram fault list"),
    ("", "buses", "commram bus list"),
    ("", "drives", "commram drive list"),
    ("", "version", "commram --version"),
    ("fault", "remove", "commram fault clear NUMBER"),
    ("fault", "delete", "commram fault clear NUMBER"),
    ("fault", "kinds", "commram fault add --help"),
    ("", "init", "commram new DIR"),
    ("", "create", "commram new DIR"),
    ("plant", "new", "commram new DIR"),
    ("plant", "validate", "commram plant check PLANT.toml"),
    ("drive", "get", "commram drive show NAME"),
    ("board", "start", "commram board set start=cold"),
    ("board", "power", "commram board set power=off"),
    ("board", "stop", "commram board set switch=stop"),
];

/// Entries: an option of another program, an option by which the affected commands are recognized, and the correct
/// option.
const OPTIONS: &[(&str, &str, &str)] = &[
    ("--json", "format", "--format json"),
    ("--jsonl", "format", "--format jsonl"),
    ("--csv", "format", "--format csv"),
    ("--markdown", "format", "--format md"),
    ("--name", "instance", "-i NAME"),
    ("--timeout", "within", "--within TIME"),
    ("--timeout", "connect-timeout", "--connect-timeout TIME"),
    ("--timeout", "max-real-time", "--max-real-time TIME"),
    ("--daemon", "detach", "--detach"),
    ("--background", "detach", "--detach"),
    ("--stepped", "clock", "--clock stepped"),
    ("--realtime", "clock", "--clock realtime"),
];

/// Entries: an option of another program that commram does not need, an option by which the affected commands are
/// recognized, and the reason.
const NEEDLESS: &[(&str, &str, &str)] = &[
    ("--retries", "shard", SAME_RESULT),
    ("--reruns", "shard", SAME_RESULT),
    ("--seed", "shard", SAME_RESULT),
];

const SAME_RESULT: &str = "omit it: a scenario gives the same result in every run";

/// Replaces the suggestions of the parser. The parser recommends passing unknown options as values, and suggests words
/// that are not similar.
pub(super) fn improve(mut error: Error, commands: &clap::Command) -> Error {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    let path = path(&error, commands);
    let word = text(ContextKind::InvalidSubcommand);
    let option =
        text(ContextKind::InvalidArg).filter(|_| error.kind() == clap::error::ErrorKind::UnknownArgument);
    let tip = match (&word, &option) {
        (Some(word), _) => of_word(&path, word).map(|right| format!("write `{right}`")),
        (None, Some(option)) => of_option(OPTIONS, &path, option, commands)
            .map(|right| format!("write `{right}`"))
            .or_else(|| of_option(NEEDLESS, &path, option, commands).map(str::to_owned)),
        (None, None) => missing(&error, &path),
    };
    if option.is_some() {
        error.insert(ContextKind::Suggested, ContextValue::None);
    }
    let Some(tip) = tip else { return error };
    for kind in [ContextKind::SuggestedSubcommand, ContextKind::SuggestedArg] {
        if error.get(kind).is_some() {
            error.insert(kind, ContextValue::None);
        }
    }
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(tip)]));
    error
}

/// Returns the text of an error as this program prints it, without the empty lines of removed suggestions.
pub(super) fn text(error: &Error) -> String {
    let text = with_escaped_values(error.render().to_string(), error);
    let text = text.strip_prefix("error: ").unwrap_or(&text).trim_end();
    text.replace("\n  tip:\n", "\n").replace("\n\n\n", "\n\n")
}

/// Escapes line ends in the words of the user, and in the reason why a value is wrong. The parser prints them as they are.
fn with_escaped_values(mut text: String, error: &Error) -> String {
    let escape = |text: String, part: &str| text.replace(part, &output::in_one_line(part));
    let mut has_line_end = false;
    for (_, value) in error.context() {
        let parts = match value {
            ContextValue::String(part) => core::slice::from_ref(part),
            ContextValue::Strings(parts) => parts.as_slice(),
            _ => &[],
        };
        for part in parts.iter().filter(|part| part.contains('\n')) {
            has_line_end = true;
            text = escape(text, part);
        }
    }
    let reason = core::error::Error::source(error).map(ToString::to_string);
    match reason.filter(|_| has_line_end) {
        Some(reason) => escape(text, &reason),
        None => text,
    }
}

/// Returns the command in which the error occurred, without the name of the program: `fault add`.
fn path(error: &Error, commands: &clap::Command) -> String {
    let Some(ContextValue::StyledStr(usage)) = error.get(ContextKind::Usage) else { return String::new() };
    let usage = usage.to_string();
    let words = usage.trim_start_matches("Usage:").split_ascii_whitespace();
    let mut words = words.skip_while(|word| *word == commands.get_name());
    let (mut command, mut path) = (commands, Vec::new());
    while let Some(inner) = words.next().and_then(|word| command.find_subcommand(word)) {
        path.push(inner.get_name());
        command = inner;
    }
    path.join(" ")
}

fn of_word(path: &str, word: &str) -> Option<&'static str> {
    WORDS.iter().find(|(below, known, _)| (*below, *known) == (path, word)).map(|(.., right)| *right)
}

fn of_option(
    table: &'static [(&str, &str, &str)],
    path: &str,
    option: &str,
    commands: &clap::Command,
) -> Option<&'static str> {
    let own = path.split(' ').try_fold(commands, |command, word| command.find_subcommand(word))?;
    let has = |long: &str| own.get_arguments().any(|arg| arg.get_long() == Some(long));
    table.iter().find(|(known, needed, _)| *known == option && has(needed)).map(|(.., right)| *right)
}

/// If an argument is missing, returns the options that the user can give instead.
fn missing(error: &Error, path: &str) -> Option<String> {
    if error.kind() != clap::error::ErrorKind::MissingRequiredArgument {
        return None;
    }
    match path {
        "step" => Some("`--to-sync` advances to the next SYNC, `--back TIME` goes back".to_owned()),
        "unforce" => Some("`--all` means all forced registers".to_owned()),
        "fault clear" => {
            Some("`--all` means all faults, `commram fault list` shows their numbers".to_owned())
        }
        "fault add" => {
            let kinds: Vec<_> = devices::fault_kinds().iter().map(|kind| kind.name()).collect();
            Some(format!("the kinds are {}", kinds.join(", ")))
        }
        _ => None,
    }
}
