//! `commram plant`: check and schema of plant files, without an emulator.

use super::error::CliError;
use super::table::FormatArg;
use super::{output, plant_check};
use clap::Subcommand;
use std::path::{Path, PathBuf};

/// Name of the schema file in the directory of the plants.
pub(super) const SCHEMA: &str = "plant.schema.json";

/// Name of the plant file that `check` reads if the user names none.
const HERE: &str = "plant.toml";

/// Check a plant file, or print the schema of plant files.
#[derive(clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  commram plant check plant.toml
  commram plant schema > plant.schema.json"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Check(CheckArgs),
    /// Print the JSON schema of plant files, for editors and validators
    #[command(after_help = "Examples:\n  commram plant schema > plant.schema.json")]
    Schema,
}

/// Check a plant file without starting an emulator.
///
/// Reports errors, and entries that are allowed but probably not intended, each with its line.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram plant check
  commram plant check press.toml --format json")]
struct CheckArgs {
    /// The plant file [default: plant.toml of the working directory, else the built-in plant]
    #[arg(add = super::complete::files(&["toml"]), value_name = "PLANT.toml")]
    file: Option<PathBuf>,
    #[command(flatten)]
    format: FormatArg,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Check(args) => {
            let here = Path::new(HERE);
            let file = args.file.as_deref().or_else(|| here.is_file().then_some(here));
            plant_check::run(file, args.format.format, |_| Ok(()))
        }
        Command::Schema => output::print(&schema()),
    }
}

/// Returns the schema of plant files.
pub(super) fn schema() -> String {
    format!("{:#}\n", crate::plant::schema())
}

/// Adds a first line with the name of the schema to a plant. Editors with a TOML language server then complete keys and
/// underline mistakes.
pub(super) fn with_schema(plant: &str) -> String {
    format!("#:schema ./{SCHEMA}\n{plant}")
}
