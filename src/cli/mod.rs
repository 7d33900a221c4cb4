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
    /// Colours: on a terminal (unless NO_COLOR is set), always, never
    #[arg(long, global = true, value_enum, value_name = "WHEN", default_value_t = style::ColourMode::Auto, hide_possible_values = true)]
    color: style::ColourMode,
    /// Print no notes and no progress, only results and errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print more: all messages of an emulator, the configuration that a command uses
    #[arg(short, long, global = true)]
    verbose: bool,
    #[command(subcommand)]
    command: Command,
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

#[derive(Subcommand)]
enum Command {
    #[command(alias = "start")]
    Run(run::Args),
    With(with::Args),
    #[command(aliases = ["ps", "ls"])]
    List(list::Args),
    Status(status::Args),
    #[command(alias = "kill")]
    Stop(stop::Args),
    Map(map::Args),
    Find(find::Args),
    Export(export::Args),
    Device(device_folder::Args),
    Layout(layout::Args),
    Lsp(lsp::Args),
    New(new::Args),
    Plant(plant::Args),
    Plot(plot::Args),
    #[command(aliases = ["get", "read"])]
    Peek(peek::Args),
    #[command(aliases = ["set", "write"])]
    Poke(poke::Args),
    Force(force::Args),
    Unforce(force::UnforceArgs),
    Wait(wait::Args),
    Step(step::Args),
    Speed(speed::Args),
    Snapshot(snapshot::Args),
    Restore(snapshot::RestoreArgs),
    Dump(dump::Args),
    Diff(diff::Args),
    Watch(watch::Args),
    View(view::Args),
    Web(web::Args),
    Shell(shell::Args),
    Fault(fault::Args),
    #[command(aliases = ["log", "journal"])]
    Trace(trace::Args),
    Test(test::Args),
    #[command(hide = true)]
    TestScenario(test::scenario::Args),
    Soak(soak::Args),
    Check(check::Args),
    Demo(demo::Args),
    Dap(dap::Args),
    #[command(hide = true)]
    DemoPlc(demo::plc::Args),
    Board(board::Args),
    Bus(bus::Args),
    Drive(drive::Args),
    Completions(completions::Args),
    Man(man::Args),
}

/// Parses the command line, runs the command and returns the exit code of the process. A program with devices of its
/// own calls [`devices::register`](crate::devices::register) before this function.
pub fn main() -> ExitCode {
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
            output::set_verbosity(cli.quiet, cli.verbose);
            config::notes().iter().for_each(|note| output::note(note));
            if cli.verbose {
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
        match self {
            Command::Run(args) => run::run(&args),
            Command::With(args) => with::run(&args),
            Command::List(args) => list::run(&args),
            Command::Status(args) => status::run(&args),
            Command::Stop(args) => stop::run(&args),
            Command::Map(args) => map::run(&args),
            Command::Find(args) => find::run(&args),
            Command::Export(args) => export::run(&args),
            Command::Device(args) => device_folder::run(&args),
            Command::Layout(args) => layout::run(&args),
            Command::Lsp(args) => lsp::run(&args),
            Command::New(args) => new::run(&args),
            Command::Plant(args) => plant::run(&args),
            Command::Plot(args) => plot::run(&args),
            Command::Peek(args) => peek::run(&args),
            Command::Poke(args) => poke::run(&args),
            Command::Force(args) => force::run(&args),
            Command::Unforce(args) => force::unforce(&args),
            Command::Wait(args) => wait::run(&args),
            Command::Step(args) => step::run(&args),
            Command::Speed(args) => speed::run(&args),
            Command::Snapshot(args) => snapshot::run(&args),
            Command::Restore(args) => snapshot::restore(&args),
            Command::Dump(args) => dump::run(&args),
            Command::Diff(args) => diff::run(&args),
            Command::Watch(args) => watch::run(&args),
            Command::View(args) => view::run(&args),
            Command::Web(args) => web::run(&args),
            Command::Shell(args) => shell::run(&args),
            Command::Fault(args) => fault::run(&args),
            Command::Trace(args) => trace::run(&args),
            Command::Test(args) => test::run(&args),
            Command::TestScenario(args) => test::scenario::run(&args),
            Command::Soak(args) => soak::run(&args),
            Command::Check(args) => check::run(&args),
            Command::Demo(args) => demo::run(&args),
            Command::Dap(args) => dap::run(&args),
            Command::DemoPlc(args) => demo::plc::run(&args),
            Command::Board(args) => board::run(&args),
            Command::Bus(args) => bus::run(&args),
            Command::Drive(args) => drive::run(&args),
            Command::Completions(args) => completions::run(&args),
            Command::Man(args) => man::run(&args),
        }
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
    let Err(error) = result else { return ExitCode::from(Exit::Done.code()) };
    if !error.is_reported() {
        output::complain(&error.to_string());
    }
    ExitCode::from(error.exit_code())
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
