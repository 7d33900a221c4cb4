//! The `commram` command line: one file per subcommand. These files only parse arguments and print results.

mod advice;
mod board;
mod bus;
mod change;
mod check;
mod complete;
mod completions;
mod config;
mod dap;
mod demo;
mod descriptors;
mod detach;
mod device;
mod device_folder;
mod diff;
mod drive;
mod dump;
mod editor_messages;
mod error;
mod exit;
mod export;
mod fault;
mod federate;
mod file_name;
mod find;
mod force;
mod given;
mod instance;
mod layout;
mod list;
mod log;
mod lsp;
mod man;
mod map;
mod new;
mod number;
mod output;
mod overwrite;
mod parse;
mod pause;
mod peek;
mod plant;
mod plant_check;
mod plot;
mod poke;
mod progress;
mod run;
mod session;
mod shell;
mod signals;
mod snapshot;
mod soak;
mod speed;
mod start;
mod status;
mod step;
mod stop;
mod style;
mod table;
mod test;
mod trace;
mod version;
mod view;
mod wait;
mod watch;
mod web;
mod with;
mod writes;

use crate::layout::place;
use crate::memory::limits;
use crate::time;
use clap::{ColorChoice, Parser, Subcommand};
use error::CliError;
use exit::Exit;
use instance::{Instance, InstanceName, instance_name};
use std::process::ExitCode;

/// Emulates the communication RAM of drive and fieldbus controllers, register by register.
///
/// An emulator is an instance with a name. `commram run` starts one; the other commands communicate with it. The
/// RAM of each of its PLCs is the file /dev/shm/commram.INSTANCE.PLC. The first page of the file contains the
/// addresses of its areas.
#[derive(Parser)]
#[command(name = "commram", version, long_version = version::long(), color = ColorChoice::Never, max_term_width = 100, after_help = after_help())]
struct Cli {
    #[command(flatten)]
    common: CommonOptions,
    #[command(subcommand)]
    command: Command,
}

/// Options of all commands.
#[derive(clap::Args)]
struct CommonOptions {
    /// Colours: on a terminal (unless NO_COLOR is set), always, never
    #[arg(long, global = true, value_enum, value_name = "WHEN", default_value_t = style::ColourMode::Auto, hide_possible_values = true)]
    color: style::ColourMode,
    /// Print no notes and no progress, only results and errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print more: all messages of an emulator, the configuration that a command uses
    #[arg(short, long, global = true)]
    verbose: bool,
}

/// Returns the part of the help that all commands share.
fn after_help() -> String {
    let codes = Exit::ALL.map(|exit| format!("  {:<3}  {}\n", exit.code(), exit.meaning()));
    format!("{REGISTERS}\nExit codes:\n{}\n{EXAMPLES}", codes.concat())
}

const REGISTERS: &str = "\
Registers:
  node2.w_CPU_CONTROL          by name: block, register
  w_COMMAND_REG                without the block, if only one block has this register
  VARIABLE.w_CPU_CONTROL       with the name of the variable in the manual
  'node2.a_RD_BMARRAY[3][0]'   an element of an array; the quotes are for the shell
  node2.w_CPU_CONTROL.7        one bit
  'node2.*STATUS*', 'node2.a_STAT_SL[0..3]'   several, for commands that read
  %MW3.200000                  by address: %MB3, %MW3, %MD3, %MX3 (one bit)
  line2:node2.w_CPU_CONTROL    with the PLC, if the instance has several
  maxx:slotG.w_CPU_CONTROL     register of a module in a slot of a modular PLC
";

const EXAMPLES: &str = "\
Examples:
  commram demo
  commram run --clock stepped --detach
  commram poke node2.w_CPU_CONTROL=16#0001
  commram step 1ms
  commram peek node2.w_OPTION_STATUS
  commram stop";

/// Declares the commands: the name and the aliases of each one, its variant with its arguments, its function, and the word
/// `hidden` if the help does not list the command.
macro_rules! commands {
    ($($name:literal $(| $alias:literal)* => $variant:ident($args:path), $run:path $(, $hidden:ident)?;)+) => {
        #[derive(Subcommand)]
        enum Command {
            $(
                #[command(name = $name, aliases = [$($alias),*] as [&str; _], hide = is_hidden!($($hidden)?))]
                $variant($args),
            )+
        }

        impl Command {
            /// Adds the command with this name or alias to `parser`, and no other command. `None` if there is no such
            /// command.
            fn augment_only(parser: clap::Command, name: &str) -> Option<clap::Command> {
                match name {
                    $($name $(| $alias)* => {
                        let command = <$args as clap::Args>::augment_args(clap::Command::new($name));
                        let command = command.aliases([$($alias),*] as [&str; _]);
                        Some(parser.subcommand(command.hide(is_hidden!($($hidden)?))))
                    })+
                    _ => None,
                }
            }

            fn call(&self) -> Result<(), CliError> {
                match self {
                    $(Command::$variant(args) => $run(args),)+
                }
            }
        }
    };
}

/// True if a command of the table has the word `hidden`.
macro_rules! is_hidden {
    () => {
        false
    };
    (hidden) => {
        true
    };
}

commands! {
    "run" | "start" => Run(run::Args), run::run;
    "with" => With(with::Args), with::run;
    "list" | "ps" | "ls" => List(list::Args), list::run;
    "status" => Status(status::Args), status::run;
    "stop" | "kill" => Stop(stop::Args), stop::run;
    "map" => Map(map::Args), map::run;
    "find" => Find(find::Args), find::run;
    "export" => Export(export::Args), export::run;
    "device" => Device(device_folder::Args), device_folder::run;
    "layout" => Layout(layout::Args), layout::run;
    "lsp" => Lsp(lsp::Args), lsp::run;
    "new" => New(new::Args), new::run;
    "plant" => Plant(plant::Args), plant::run;
    "plot" => Plot(plot::Args), plot::run;
    "peek" | "get" | "read" => Peek(peek::Args), peek::run;
    "poke" | "set" | "write" => Poke(poke::Args), poke::run;
    "force" => Force(force::Args), force::run;
    "unforce" => Unforce(force::UnforceArgs), force::unforce;
    "wait" => Wait(wait::Args), wait::run;
    "step" => Step(step::Args), step::run;
    "speed" => Speed(speed::Args), speed::run;
    "snapshot" => Snapshot(snapshot::Args), snapshot::run;
    "restore" => Restore(snapshot::RestoreArgs), snapshot::restore;
    "dump" => Dump(dump::Args), dump::run;
    "diff" => Diff(diff::Args), diff::run;
    "watch" => Watch(watch::Args), watch::run;
    "view" => View(view::Args), view::run;
    "web" => Web(web::Args), web::run;
    "shell" => Shell(shell::Args), shell::run;
    "fault" => Fault(fault::Args), fault::run;
    "trace" | "log" | "journal" => Trace(trace::Args), trace::run;
    "test" => Test(test::Args), test::run;
    "test-scenario" => TestScenario(test::scenario::Args), test::scenario::run, hidden;
    "soak" => Soak(soak::Args), soak::run;
    "check" => Check(check::Args), check::run;
    "demo" => Demo(demo::Args), demo::run;
    "dap" => Dap(dap::Args), dap::run;
    "demo-plc" => DemoPlc(demo::plc::Args), demo::plc::run, hidden;
    "board" => Board(board::Args), board::run;
    "bus" => Bus(bus::Args), bus::run;
    "drive" => Drive(drive::Args), drive::run;
    "completions" => Completions(completions::Args), completions::run;
    "man" => Man(man::Args), man::run;
}

/// Parses the command line, runs the command and returns the exit code of the process. A program with devices of its
/// own calls [`devices::register`](crate::devices::register) before this function.
pub fn main() -> ExitCode {
    signals::unblock();
    let allowed = limits::of_command::allow_stack()
        .and_then(|()| limits::space::allow_memory(limits::of_command::OF_A_COMMAND));
    match allowed {
        Ok(()) => answer_command_line(),
        Err(limit) => finish(Err(CliError::LimitedMemory { limit })),
    }
}

/// Does the work of [`main`]. Not inlined, so that `main` itself needs little stack.
#[inline(never)]
fn answer_command_line() -> ExitCode {
    completions::answer();
    style::set(std::env::args_os());
    let result = match parse::parse(std::env::args_os()) {
        Ok(cli) => {
            output::set_verbosity(cli.common.quiet, cli.common.verbose);
            config::notes().iter().for_each(|note| output::note(note));
            if cli.common.verbose {
                output::note(&format!("configuration: {}", config::get()));
            }
            cli.command.run()
        }
        Err(error) => return refuse(&error),
    };
    finish(result)
}

impl Command {
    fn run(self) -> Result<(), CliError> {
        let damaged = Exit::NotThere.code();
        crate::memory::end_on_shortened_files(damaged)
            .and_then(|()| survive_file_size_limit())
            .map_err(|reason| CliError::Signals { reason })?;
        self.call()
    }
}

/// Makes writes beyond the limit of `ulimit -f` return an error. Without this function, the signal SIGXFSZ would end
/// the process. The signal is caught instead of ignored, because the command of `commram with` would inherit an ignored
/// signal.
fn survive_file_size_limit() -> std::io::Result<()> {
    signal_hook::flag::register(libc::SIGXFSZ, std::sync::Arc::default()).map(drop)
}

/// Shows requested help or version, and prints command line errors in the format of all other errors.
fn refuse(error: &clap::Error) -> ExitCode {
    let shown = |stream_has_colours: bool| {
        let text = error.render();
        if stream_has_colours { text.ansi().to_string() } else { text.to_string() }
    };
    if error.kind() == clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        output::print_help(&shown(style::is_on(&std::io::stderr())));
        return ExitCode::from(Exit::WrongUse.code());
    }
    if error.use_stderr() {
        output::complain(&advice::text(error));
        return ExitCode::from(Exit::WrongUse.code());
    }
    finish(output::print(&shown(style::is_on(&std::io::stdout()))))
}

/// Prints an error unless it was printed before, and returns the exit code.
fn finish(result: Result<(), CliError>) -> ExitCode {
    let code = match result.and_then(|()| output::check_stored()) {
        Ok(()) => Exit::Done.code(),
        Err(error) => {
            if !error.is_reported() {
                output::complain(&error.to_string());
            }
            error.exit_code()
        }
    };
    crate::helics::end_process_if_loaded(code);
    ExitCode::from(code)
}

#[cfg(test)]
mod operations_tests;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        parse::command().debug_assert();
    }

    /// On a narrow terminal clap wraps long lines. A manual line break inside a paragraph would then leave a very short
    /// line.
    #[test]
    fn no_paragraph_below_the_help_is_broken_by_hand() {
        let mut commands = vec![parse::command()];
        while let Some(command) = commands.pop() {
            let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            for (line, next) in text.lines().zip(text.lines().skip(1)) {
                let is_text = |line: &str| !line.is_empty() && !line.starts_with(' ') && !line.ends_with(':');
                let name = command.get_name();
                assert!(line.len() < 60 || !is_text(line) || !is_text(next), "{name}: {line}");
            }
            commands.extend(command.get_subcommands().cloned());
        }
    }

    #[test]
    fn every_command_has_examples() {
        for command in parse::command().get_subcommands() {
            let examples = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            let name = command.get_name();
            assert!(examples.contains(&format!("commram {name}")), "{name}");
        }
    }
}
