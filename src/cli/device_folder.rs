//! `commram device`: work on a device in a folder, without an emulator.

use super::error::CliError;
use super::output;
use super::table::{self, FormatArg, Row};
use super::test::LimitArgs;
use crate::devices::folder;
use crate::devices::folder::Folder;
use crate::plural::{plural, plural_of};
use clap::Subcommand;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Check or test a device in a folder.
#[derive(clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  commram device check ./cards/counter
  commram device test ./cards/counter
  commram map --device ./cards/counter"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Check(CheckArgs),
    Test(TestArgs),
}

/// Check the files of a device in a folder, and list its handshakes.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram device check ./cards/counter
  commram device check ./cards/counter --format json

Exit codes:
  0  the folder is a device
  2  a file is wrong; the message has its line")]
struct CheckArgs {
    /// Folder with a device.toml
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    #[command(flatten)]
    format: FormatArg,
}

/// Run the scenarios of a device in a folder.
///
/// The scenarios are the .rhai files in the directory tests of the folder. A scenario that names no plant gets one with the
/// device alone.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram device test ./cards/counter
  commram device test ./cards/counter ./cards/counter/tests/start.rhai

Exit codes:
  0    all scenarios passed
  1    an expectation failed, or a scenario has no expectation, throws, does not end or crashes
  2    wrong use: the folder is no device, or a script does not compile or uses a verb wrongly
  130  ended by Ctrl-C or a signal")]
struct TestArgs {
    /// Folder with a device.toml
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Scripts or directories in place of the directory tests of the folder
    #[arg(add = super::complete::files(&["rhai"]), value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
    #[command(flatten)]
    format: FormatArg,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Check(args) => check(args),
        Command::Test(args) => test(args),
    }
}

fn check(args: &CheckArgs) -> Result<(), CliError> {
    let dir = folder::find(Path::new(""), &args.dir.display().to_string())?;
    let folder = folder::load(&dir)?;
    let faults = folder.faults.iter().map(HandshakeRow::of_fault);
    let rows: Vec<_> = folder.rows.iter().map(HandshakeRow::of).chain(faults).collect();
    output::note(&summary(folder));
    for name in folder.unread_files(&dir)? {
        output::note(&format!("{}: the device does not read this file", args.dir.join(name).display()));
    }
    table::print(args.format.format, &rows, table::aligned)
}

fn test(args: &TestArgs) -> Result<(), CliError> {
    let dir = folder::find(Path::new(""), &args.dir.display().to_string())?;
    folder::load(&dir)?;
    let own = [args.dir.join("tests")];
    let files = if args.files.is_empty() { &own[..] } else { &args.files };
    super::test::run_for_device(&dir, files, args.limits, args.format.format)
}

/// Formats a summary: `digital-io (Digital I/O card): 2 areas, 8 registers, 6 handshakes, layout 16#...`.
fn summary(folder: &Folder) -> String {
    let layout = folder.registered.layout;
    let registers = layout.areas.iter().flat_map(|area| area.structures);
    let registers: usize = registers.map(|placed| placed.structure.registers.len()).sum();
    let faults = match &folder.faults[..] {
        [] => String::new(),
        faults => format!(", {}", plural_of(faults, "fault")),
    };
    let script = match folder.has_script() {
        true => format!(", script with {}", plural_of(&folder.hooks(), "hook")),
        false => String::new(),
    };
    format!(
        "{} ({}): {}, {}, {}{faults}{script}, layout 16#{:016X}",
        layout.name,
        layout.title,
        plural_of(layout.areas, "area"),
        plural(registers as u64, "register"),
        plural_of(&folder.rows, "handshake"),
        layout.layout_hash
    )
}

/// A handshake of the folder.
#[derive(Serialize)]
struct HandshakeRow {
    kind: &'static str,
    register: &'static str,
    behaviour: String,
    page: &'static str,
    source: String,
}

impl HandshakeRow {
    fn of(row: &'static folder::Handshake) -> Self {
        let folder::Handshake { kind, register, behaviour, page, source, .. } = row;
        Self { kind, register, behaviour: behaviour.clone(), page, source: source.to_string() }
    }

    /// Returns the row of a fault that the device declares: its name, its text and its fields.
    fn of_fault(fault: &'static folder::OwnFault) -> Self {
        let folder::OwnFault { name, text, fields, page, .. } = fault;
        let field = |field: &folder::OwnField| {
            let folder::OwnField { name, from, to, default, .. } = field;
            let default = default.map(|default| format!(" (default {default})")).unwrap_or_default();
            format!("; {name} {from} to {to}{default}")
        };
        let behaviour = text.clone() + &fields.iter().map(field).collect::<String>();
        Self { kind: "fault", register: name, behaviour, page, source: String::new() }
    }
}

impl Row for HandshakeRow {
    const COLUMNS: &'static [&'static str] = &["kind", "register", "behaviour", "page", "source"];

    fn cells(&self) -> Vec<String> {
        let Self { kind, register, behaviour, page, source } = self;
        [kind, register, behaviour.as_str(), page, source.as_str()].map(str::to_owned).to_vec()
    }
}
