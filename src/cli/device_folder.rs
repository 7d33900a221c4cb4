//! `commram device`: work on a device in a folder, without an emulator.

use super::error::CliError;
use super::output;
use super::table::{self, FormatArg, Row};
use crate::devices::folder;
use crate::devices::folder::Folder;
use crate::plural::{plural, plural_of};
use clap::Subcommand;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Check a device in a folder.
#[derive(clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  commram device check ./cards/counter
  commram map --device ./cards/counter"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Check(CheckArgs),
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

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Check(args) => check(args),
    }
}

fn check(args: &CheckArgs) -> Result<(), CliError> {
    let dir = folder::find(Path::new(""), &args.dir.display().to_string())?;
    let folder = folder::load(&dir)?;
    let rows: Vec<_> = folder.rows.iter().map(HandshakeRow::of).collect();
    output::note(&summary(folder));
    table::print(args.format.format, &rows, table::aligned)
}

/// `digital-io (Digital I/O card): 2 areas, 8 registers, 6 handshakes, layout 16#...`
fn summary(folder: &Folder) -> String {
    let layout = folder.registered.layout;
    let registers = layout.areas.iter().flat_map(|area| area.structures);
    let registers: usize = registers.map(|placed| placed.structure.registers.len()).sum();
    format!(
        "{} ({}): {}, {}, {}, layout 16#{:016X}",
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
    behaviour: &'static str,
    page: &'static str,
    source: String,
}

impl HandshakeRow {
    fn of(row: &'static folder::Handshake) -> Self {
        let folder::Handshake { kind, register, behaviour, page, source, .. } = row;
        Self { kind, register, behaviour, page, source: source.to_string() }
    }
}

impl Row for HandshakeRow {
    const COLUMNS: &'static [&'static str] = &["kind", "register", "behaviour", "page", "source"];

    fn cells(&self) -> Vec<String> {
        let Self { kind, register, behaviour, page, source } = self;
        [kind, register, behaviour, page, source.as_str()].map(str::to_owned).to_vec()
    }
}
