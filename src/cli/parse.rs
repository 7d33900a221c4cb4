//! The command line of this program: its commands in groups, and the positions where options are allowed.

use super::instance::instance_name;
use super::{Cli, CommonOptions, advice, complete, config, file_name};
use crate::devices::folder;
use clap::builder::Resettable;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Args, Command, CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::sync::{Mutex, PoisonError};

/// The commands in the order of the help, grouped by purpose.
const GROUPS: &[(&str, &[&str])] = &[
    ("Emulators", &["run", "with", "list", "status", "stop", "demo"]),
    ("Registers", &["peek", "poke", "force", "unforce", "wait", "watch", "dump", "diff"]),
    ("Time", &["step", "speed", "snapshot", "restore"]),
    ("Plants", &["new", "plant", "bus", "drive", "board", "fault"]),
    ("Analysis", &["view", "web", "shell", "trace", "plot", "check"]),
    ("Tests", &["test", "soak"]),
    ("Register map", &["map", "find", "export", "layout", "device"]),
    ("Setup", &["lsp", "dap", "completions", "man", "help"]),
];

/// Returns the command line of this program.
pub(super) fn command() -> Command {
    let command = Cli::command();
    let template = template(&command);
    adapt(command).help_template(template)
}

/// Returns a command line that has only the command `name`. `None` if there is no such command.
fn command_line_of(name: &str) -> Option<Command> {
    let parser = CommonOptions::augment_args(Command::new("commram"));
    super::Command::augment_only(parser, name).map(adapt)
}

/// Adds the option `-i`, and the defaults from the configuration file.
fn adapt(command: Command) -> Command {
    let instance = Arg::new("instance")
        .short('i')
        .long("instance")
        .value_name("NAME")
        .value_parser(instance_name)
        .add(complete::instances())
        .help("Name of the instance, for every command that uses one");
    folder::search_first(config::get().devices());
    config::get().apply(file_name::restrict(command.arg(instance)))
}

/// Returns the help with the commands in groups.
fn template(command: &Command) -> String {
    let head = *clap::builder::Styles::styled().get_header();
    let name = *clap::builder::Styles::styled().get_literal();
    let mut groups = String::new();
    for (title, names) in GROUPS {
        groups += &format!("{head}{title}:{head:#}\n");
        for own in *names {
            let about = command.find_subcommand(own).and_then(Command::get_about);
            let about = about.map_or_else(|| "Describe a command".to_owned(), ToString::to_string);
            groups += &format!("  {name}{own:<11}{name:#}  {about}\n");
        }
        groups.push('\n');
    }
    format!(
        "{{before-help}}{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{groups}{head}Options:{head:#}\n{{options}}{{after-help}}"
    )
}

/// Parses the words of a command line. The first word is the name of the program.
///
/// # Errors
/// Wrong use, or a request for help. The error contains hints for frequent mistakes.
pub(super) fn parse(words: impl Iterator<Item = OsString>) -> Result<Cli, clap::Error> {
    let words: Vec<_> = words.collect();
    if let Some(cli) = parse_one_command(&words) {
        return Ok(cli);
    }
    let commands = command();
    let words = with_options_after_command(words, 1, &commands);
    let parsed = commands.clone().try_get_matches_from(&words);
    let parsed = parsed.and_then(|matches| Cli::from_arg_matches(&matches));
    parsed.map_err(|error| advice::improve(without_environment_values(error, &words), &commands))
}

/// Parses a command line without a mistake. Creates the parser of the used command only, because the parser of all
/// commands takes half of the instructions of a short command. `None` if the words have a mistake or request the help.
fn parse_one_command(words: &[OsString]) -> Option<Cli> {
    let commands = command_line_of(name_of_command(words)?)?;
    let words = with_options_after_command(words.to_vec(), 1, &commands);
    Cli::from_arg_matches(&commands.try_get_matches_from(words).ok()?).ok()
}

/// Returns the first word that is not an option. `None` if a request for help or the version comes before this word.
fn name_of_command(words: &[OsString]) -> Option<&str> {
    let mut rest = words.iter().skip(1);
    loop {
        let word = rest.next()?.to_str()?;
        match options_length(word) {
            Some(count) => rest.by_ref().take(count - 1).for_each(drop),
            None => return (!word.starts_with('-')).then_some(word),
        }
    }
}

/// Returns the number of words of an option that may precede a command. `None` for a command, and for a word at which the
/// search for options ends, because the parser handles it.
fn options_length(word: &str) -> Option<usize> {
    match word {
        "-i" | "--instance" | "--color" => Some(2),
        "-h" | "--help" | "-V" | "--version" | "--" => None,
        word => word.starts_with('-').then_some(1),
    }
}

/// Moves options before a command to the place after it. `-i NAME` is an option of the command; the other options are allowed in both
/// positions. The words of the command begin at index `begin`.
pub(super) fn with_options_after_command(
    words: Vec<OsString>,
    begin: usize,
    commands: &Command,
) -> Vec<OsString> {
    let (mut kept, mut moved) = (Vec::with_capacity(words.len()), Vec::new());
    let mut command = commands;
    let mut rest = words.into_iter();
    kept.extend(rest.by_ref().take(begin));
    let mut rest = rest.peekable();
    while let Some(word) = rest.peek().and_then(|word| word.to_str()).map(str::to_owned) {
        match (options_length(&word), command.find_subcommand(&word)) {
            (Some(count), _) => moved.extend(rest.by_ref().take(count)),
            (None, Some(inner)) => {
                command = inner;
                kept.extend(rest.next());
            }
            (None, None) => break,
        }
    }
    // Without one of its own subcommands, a command such as `board` has no option `-i`. The parser is to report the missing
    // or wrong subcommand, not the option.
    if command.is_subcommand_required_set()
        && !command.get_arguments().any(|arg| arg.get_short() == Some('i'))
    {
        match rest.peek().and_then(|word| word.to_str()) {
            Some(word) if !word.starts_with('-') => kept.extend(rest.next()),
            _ => return without_instance(kept, moved).chain(rest).collect(),
        }
    }
    kept.into_iter().chain(moved).chain(rest).collect()
}

/// Returns the words of a command and the options moved to it, without `-i NAME`.
fn without_instance(kept: Vec<OsString>, moved: Vec<OsString>) -> impl Iterator<Item = OsString> {
    let mut is_value = false;
    let moved = moved.into_iter().filter(move |word| {
        let word = word.to_string_lossy();
        let is_option = word.starts_with("-i") || word.starts_with("--instance");
        let is_of_instance = is_option || is_value;
        is_value = matches!(&*word, "-i" | "--instance");
        !is_of_instance
    });
    kept.into_iter().chain(moved)
}

/// The words of the command in the present line of the shell, from its name on.
static LINE_OF_SHELL: Mutex<Option<Vec<OsString>>> = Mutex::new(None);

/// Notes the words of the command that a line of the shell contains.
pub(super) fn set_line_of_shell(words: &[OsString]) {
    *LINE_OF_SHELL.lock().unwrap_or_else(PoisonError::into_inner) = Some(words.to_vec());
}

/// Returns the arguments of the present command, of this process or of a line of the shell, including the options that were before
/// the command.
pub(super) fn arguments_of_command() -> impl Iterator<Item = OsString> {
    let line = LINE_OF_SHELL.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let (words, begin) = line.map_or_else(
        || {
            let words: Vec<_> = std::env::args_os().collect();
            let commands = name_of_command(&words).and_then(command_line_of).unwrap_or_else(command);
            (with_options_after_command(words, 1, &commands), 2)
        },
        |line| (line, 1),
    );
    words.into_iter().skip(begin)
}

/// Returns `error` without the options that environment variables set: the usage text would show such options as
/// required.
fn without_environment_values(error: clap::Error, words: &[OsString]) -> clap::Error {
    fn bare(command: Command) -> Command {
        command.mut_args(|arg| arg.env(Resettable::Reset)).mut_subcommands(bare)
    }
    if !error.use_stderr() || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return error;
    }
    // If the mistake is in an environment variable, this second attempt succeeds, because it ignores the environment.
    // The function then returns the original error, which names the variable.
    let other = bare(command()).try_get_matches_from(words).err();
    other.filter(|other| other.kind() == error.kind()).unwrap_or_else(|| with_variable(error))
}

/// Returns the error about the value of an option with the environment variable that the value is from.
fn with_variable(mut error: clap::Error) -> clap::Error {
    fn variable(command: &Command, option: &str) -> Option<String> {
        let named = command.get_arguments().find(|arg| arg.to_string() == option);
        let own = named.and_then(Arg::get_env).map(|name| name.to_string_lossy().into_owned());
        own.or_else(|| command.get_subcommands().find_map(|inner| variable(inner, option)))
    }
    let mut commands = command();
    // An option that was not built has no text.
    commands.build();
    if let Some(ContextValue::String(option)) = error.get(ContextKind::InvalidArg)
        && let Some(variable) = variable(&commands, option)
    {
        error.insert(ContextKind::InvalidArg, ContextValue::String(format!("{variable} ({option})")));
    }
    error
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_is_in_one_group() {
        let mut grouped: Vec<_> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        grouped.sort_unstable();
        let command = command();
        let shown = command.get_subcommands().filter(|inner| !inner.is_hide_set()).map(Command::get_name);
        let mut shown: Vec<_> = shown.chain(["help"]).collect();
        shown.sort_unstable();
        assert_eq!(grouped, shown);
    }

    #[test]
    fn the_parser_of_one_command_equals_its_part_of_the_parser_of_all() {
        let all = command();
        // The order in the help depends on the other commands. The parser of one command shows no help.
        let shown = |command: &Command| format!("{:?}", command.clone().display_order(0));
        let options = |command: &Command| {
            let options =
                command.get_arguments().map(|option| format!("{:?}", option.clone().display_order(0)));
            options.collect::<Vec<_>>()
        };
        for inner in all.get_subcommands() {
            for name in [inner.get_name()].into_iter().chain(inner.get_all_aliases()) {
                let one = command_line_of(name).unwrap();
                assert_eq!(shown(one.find_subcommand(name).unwrap()), shown(inner));
                assert_eq!(one.get_subcommands().count(), 1, "{name}");
                assert_eq!(options(&one), options(&all), "{name}");
            }
        }
    }

    #[test]
    fn only_a_mistake_or_a_request_for_help_needs_the_parser_of_all_commands() {
        let parsed = |line: &str| {
            let words: Vec<_> = line.split(' ').map(OsString::from).collect();
            parse_one_command(&words).map(|cli| (cli.common.quiet, cli.command))
        };
        assert!(matches!(parsed("commram peek x"), Some((false, super::super::Command::Peek(_)))));
        let read = parsed("commram -q --color never -i a read x");
        assert!(matches!(read, Some((true, super::super::Command::Peek(_)))));
        let of_bus = parsed("commram -i a bus list");
        assert!(matches!(of_bus, Some((false, super::super::Command::Bus(_)))));
        for other in
            ["commram", "commram peek", "commram -h peek x", "commram peek -h", "commram -V", "commram p x"]
        {
            assert!(parsed(other).is_none(), "{other}");
        }
    }

    #[test]
    fn the_instance_moves_after_its_command() {
        let moved = |line: &str| {
            let words = line.split(' ').map(OsString::from).collect();
            let words = with_options_after_command(words, 1, &command());
            words.iter().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
        };
        for (line, expected) in [
            ("commram -i a peek x", "commram peek -i a x"),
            (
                "commram --color never --instance=a fault list",
                "commram fault list --color never --instance=a",
            ),
            ("commram fault -ia clear 1", "commram fault clear -ia 1"),
            ("commram peek x -i a", "commram peek x -i a"),
            ("commram with -i a -- peek -i b", "commram with -i a -- peek -i b"),
            ("commram -i", "commram -i"),
            ("commram -i a board start cold", "commram board start -i a cold"),
            ("commram -i a --color never board", "commram board --color never"),
            ("commram -ia --instance=b board --help", "commram board --help"),
            ("commram -i a board get line", "commram board get -i a line"),
            ("commram -i a nothing", "commram -i a nothing"),
            ("commram test --definitions .", "commram test --definitions ."),
        ] {
            assert_eq!(moved(line), expected);
        }
    }
}
