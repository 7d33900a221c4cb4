//! `commram shell`: a prompt for commands and for the language of scenarios.

mod edit;
mod history;
mod words;

use super::error::CliError;
use super::exit::Exit;
use super::session::Session;
use super::{Cli, Command, Instance, advice, output, parse};
use crate::input_file::{self, LONGEST_SCRIPT};
use crate::request::Op;
use crate::script::{Bench, Lines, Outcome, with_stack};
use clap::builder::Resettable;
use clap::{ArgAction, FromArgMatches};
use edit::{InputLine, LineReader};
use std::ffi::OsString;
use std::io::{self, BufRead, IsTerminal, Read as _};
use std::path::Path;

/// Limit for the emulated time that a verb may take before the shell stops waiting for its reply: one hour.
const LONGEST_US: u64 = 3_600_000_000;

/// Type commands and verbs of scenarios one after the other.
///
/// A line is a command of this program without the word `commram`, which uses the instance of the shell, or a piece
/// of a scenario: verbs, variables, loops. Tab completes commands, verbs, registers and the names of their values.
/// The arrow keys show earlier lines. Lines that do not come from a terminal are executed until one fails. The
/// shell then prints the number of the line and returns its exit code.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram shell
  echo 'peek node2.w_OPTION_STATUS' | commram shell
  commram shell -i press-1 < bring-up.txt

Lines:
  poke node2.w_CPU_CONTROL=16#0001
  wait(\"node2.w_OPTION_STATUS\", 2, \"10ms\")
  let before = peek(\"node2.a_RD_BMARRAY[1][0]\")")]
pub(crate) struct Args {
    #[command(flatten)]
    instance: Instance,
}

/// Returns the commands and the verbs.
fn help(commands: &clap::Command) -> String {
    let names = |names: Vec<String>| {
        let mut lines = vec![String::new()];
        for name in names {
            match lines.last_mut() {
                Some(line) if line.len() + name.len() < 76 => *line += &format!("  {name}"),
                _ => lines.push(format!("  {name}")),
            }
        }
        lines.join("\n") + "\n"
    };
    let shown = commands.get_subcommands().filter(|inner| !inner.is_hide_set());
    let shown = shown.map(|inner| inner.get_name().to_owned()).collect();
    let verbs = crate::script::verbs().iter().map(crate::script::Verb::signature).collect();
    format!(
        "Commands, described by `help COMMAND`:\n{}\nVerbs of scenarios (docs/reference/scenarios.md):\n{}\n\
         Ends: exit, quit, Ctrl-D\n",
        names(shown).trim_start_matches('\n'),
        names(verbs).trim_start_matches('\n')
    )
}

/// Result of a line.
enum LineResult {
    /// The shell continues with the next line.
    On,
    /// The user ends the shell with this exit code.
    Enough(u8),
    /// The line failed with this exit code.
    Failed(u8),
}

/// Reads lines and executes them.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    // Checks that the instance is running.
    drop(Session::open(&args.instance, 0)?);
    input_file::take_standard_input();
    let read = || {
        let mut shell = Shell { instance: args.instance.clone(), lines: None };
        if io::stdin().is_terminal() { shell.read_terminal() } else { shell.read_pipe() }
    };
    with_stack(read).map_err(|reason| CliError::Process { reason })?
}

/// Ends the shell with this exit code.
fn ended(code: u8) -> Result<(), CliError> {
    if code == Exit::Done.code() { Ok(()) } else { Err(CliError::Ended(code)) }
}

struct Shell {
    instance: Instance,
    /// Executes pieces of scenarios; created when the first verb is used.
    lines: Option<Lines>,
}

impl Shell {
    fn read_pipe(&mut self) -> Result<(), CliError> {
        let commands = command(self.instance.name());
        let (mut piece, mut begin) = (String::new(), 1);
        let mut input = io::stdin().lock();
        for number in 1.. {
            if piece.is_empty() {
                begin = number;
            }
            let left = LONGEST_SCRIPT.saturating_sub(piece.len() as u64);
            let read =
                input.by_ref().take(left + 1).read_line(&mut piece).map_err(|reason| reason.to_string());
            let read = read.and_then(|read| match read as u64 > left {
                true => {
                    Err(format!("a command or piece of a scenario can have at most {LONGEST_SCRIPT} bytes"))
                }
                false => Ok(read),
            });
            let is_last =
                read.map_err(|right| CliError::Argument { text: format!("line {number}"), right })? == 0;
            if !is_last && words::continues(&piece, &commands) {
                continue;
            }
            match self.line(&core::mem::take(&mut piece)) {
                LineResult::On => {}
                LineResult::Enough(code) => return ended(code),
                LineResult::Failed(code) => {
                    output::complain(&format!("line {begin} failed; the lines after it were not executed"));
                    return Err(CliError::Ended(code));
                }
            }
            if is_last {
                break;
            }
        }
        Ok(())
    }

    fn read_terminal(&mut self) -> Result<(), CliError> {
        let mut read = LineReader::new(self.instance.name(), command(self.instance.name()))?;
        loop {
            match read.next(self.now())? {
                InputLine::Line(line) => match self.line(&line) {
                    LineResult::On | LineResult::Failed(_) => {}
                    LineResult::Enough(code) => return ended(code),
                },
                InputLine::Nothing => {}
                InputLine::End => return Ok(()),
            }
        }
    }

    /// Returns the emulated time in microseconds; `None` if the emulator does not answer.
    fn now(&self) -> Option<u64> {
        let session = Session::open(&Instance::running(self.instance.name()), 0).ok()?;
        session.ask(Op::Info).ok()?.info().ok().map(|info| info.time_us)
    }

    /// Executes a line and prints its errors.
    fn line(&mut self, line: &str) -> LineResult {
        let line = line.trim();
        if line.is_empty() || line.starts_with("//") || line.starts_with('#') {
            return LineResult::On;
        }
        if let Some(rest) = words::of_help(line) {
            let shown = match rest {
                "" => output::print(&help(&command(self.instance.name()))),
                rest => return self.command(vec!["help".to_owned(), rest.to_owned()]),
            };
            return shown.map_or_else(|error| LineResult::Failed(error.exit_code()), |()| LineResult::On);
        }
        match words::of_end(line) {
            Some(Ok(code)) => return LineResult::Enough(code),
            Some(Err(why)) => {
                output::complain(why);
                return LineResult::Failed(Exit::WrongUse.code());
            }
            None => {}
        }
        match words::of_command(line, &command(self.instance.name())) {
            Some(Ok(words)) => self.command(words),
            Some(Err(why)) => {
                output::complain(why);
                LineResult::Failed(Exit::WrongUse.code())
            }
            None => self.piece(line),
        }
    }

    fn command(&mut self, words: Vec<String>) -> LineResult {
        let commands = command(self.instance.name());
        let words = words.into_iter().map(OsString::from).collect();
        let words = parse::with_options_after_command(words, 0, &commands);
        parse::set_line_of_shell(&words);
        let parsed = commands.clone().try_get_matches_from(words);
        let parsed = parsed.and_then(|matches| Cli::from_arg_matches(&matches));
        let outcome = match parsed {
            Ok(Cli { command: Command::Shell(_), .. }) => {
                output::complain("this already is a shell");
                return LineResult::Failed(Exit::WrongUse.code());
            }
            Ok(cli) => cli.command.run(),
            Err(error) if error.use_stderr() => {
                output::complain(&advice::text(&advice::improve(error, &commands)));
                return LineResult::Failed(Exit::WrongUse.code());
            }
            Err(help) => output::print(&help.render().to_string()),
        };
        match outcome {
            Ok(()) => LineResult::On,
            Err(error) => {
                if !error.is_reported() {
                    output::complain(&error.to_string());
                }
                LineResult::Failed(error.exit_code())
            }
        }
    }

    /// Executes a piece of a scenario.
    fn piece(&mut self, text: &str) -> LineResult {
        let outcome = match self.lines() {
            Ok(lines) => lines.run(text),
            Err(error) => {
                output::complain(&error.to_string());
                return LineResult::Failed(error.exit_code());
            }
        };
        let (why, exit) = match outcome {
            Ok(None) => return LineResult::On,
            Ok(Some(value)) => match output::print(&(output::harmless(&value) + "\n")) {
                Ok(()) => return LineResult::On,
                Err(error) => return LineResult::Failed(error.exit_code()),
            },
            Err(outcome) => match *outcome {
                Outcome::Failed(failure) => (failure.to_string(), Exit::Failed),
                Outcome::Broken(mistake) => {
                    let commands = command(self.instance.name());
                    let why = words::no_command(text, &commands)
                        .unwrap_or_else(|| mistake.what + &words::meant(text, &commands));
                    (why, Exit::WrongUse)
                }
                other => (other.name().to_owned(), Exit::Failed),
            },
        };
        output::complain(&why);
        // The shell is connected to one emulator. If that emulator has ended or was replaced, the connection and the
        // variables of the shell are lost.
        if self.lines.take_if(|lines| !lines.is_there()).is_some() {
            return LineResult::Failed(Exit::NotThere.code());
        }
        LineResult::Failed(exit.code())
    }

    fn lines(&mut self) -> Result<&mut Lines, CliError> {
        let lines = match self.lines.take() {
            Some(lines) => lines,
            None => {
                let client = Session::open(&self.instance, LONGEST_US)?.into_client()?;
                Lines::new(Bench::attach(client)?, Path::new("."), |line| {
                    // An error is ignored: if the output has no reader, the next print reports it.
                    let _ = output::print(&output::harmless(line));
                })
            }
        };
        Ok(self.lines.insert(lines))
    }
}

/// Returns the command line of this program, without the program name, for this instance.
fn command(instance: &str) -> clap::Command {
    fn about(command: clap::Command, instance: &str) -> clap::Command {
        let command = command.mut_args(|arg| {
            let is_instance = arg.get_long() == Some("instance") && !arg.get_default_values().is_empty();
            if is_instance { arg.default_value(instance.to_owned()).env(Resettable::Reset) } else { arg }
        });
        command.mut_subcommands(|command| about(command, instance))
    }
    // The option `--color` was evaluated when the shell started.
    about(parse::command(), instance).no_binary_name(true).mut_args(|arg| match arg.get_action() {
        ArgAction::Version => arg.hide(true),
        _ => arg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_use_the_instance_of_the_shell() {
        let parse = |words: &[&str]| command("press-1").try_get_matches_from(words).unwrap();
        let instance = |words: &[&str]| {
            let matches = parse(words);
            matches.subcommand().and_then(|(_, own)| own.get_one::<String>("name").cloned())
        };
        assert_eq!(instance(&["peek", "node2.w_CPU_CONTROL"]).as_deref(), Some("press-1"));
        assert_eq!(instance(&["peek", "node2.w_CPU_CONTROL", "-i", "other"]).as_deref(), Some("other"));
    }
}
