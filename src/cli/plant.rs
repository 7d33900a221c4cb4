//! `commram plant`: templates, check and schema for plant files, without an emulator.

use super::error::CliError;
use super::table::FormatArg;
use super::{output, plant_check};
use crate::devices;
use crate::output_file;
use clap::Subcommand;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Name of the schema file in the directory of the plants.
const SCHEMA: &str = "plant.schema.json";

/// Create or check a plant file, or print the schema of plant files.
#[derive(clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  commram plant new plant.toml
  commram plant check plant.toml
  commram plant new --device DEVICE
  commram plant schema > plant.schema.json"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Check(CheckArgs),
    New(NewArgs),
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
  commram plant check plant.toml
  commram plant check plant.toml --format json")]
struct CheckArgs {
    /// The plant file [default: the built-in plant]
    #[arg(add = super::complete::files(&["toml"]), value_name = "PLANT.toml")]
    file: Option<PathBuf>,
    #[command(flatten)]
    format: FormatArg,
}

/// Write a plant template: all keys of a device, with their meaning.
///
/// The first line of the plant names its schema, which is written to the same directory. Editors with a TOML
/// language server then complete keys and underline mistakes.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram plant new plant.toml && commram plant check plant.toml
  commram plant new --device DEVICE")]
struct NewArgs {
    /// The file, which must not exist; without it the plant is printed
    #[arg(value_name = "PLANT.toml")]
    file: Option<PathBuf>,
    /// Type of the device
    #[arg(long, value_name = "DEVICE", value_parser = with_template(), default_value = devices::default().layout.name)]
    device: &'static str,
}

/// Accepts the names of devices that have a template, and returns the template.
fn with_template() -> impl TypedValueParser<Value = &'static str> {
    let names = devices::all().iter().filter(|known| known.emulation.template.is_some());
    let names = names.map(|known| PossibleValue::new(known.layout.name).help(known.layout.title));
    PossibleValuesParser::new(names).try_map(|name| {
        devices::find(&name)
            .and_then(|known| known.emulation.template)
            .ok_or("no template for a device of this name")
    })
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Check(args) => plant_check::run(args.file.as_deref(), args.format.format),
        Command::New(args) => new(args),
        Command::Schema => output::print(&schema()),
    }
}

fn schema() -> String {
    format!("{:#}\n", crate::plant::schema())
}

fn new(args: &NewArgs) -> Result<(), CliError> {
    let plant = format!("#:schema ./{SCHEMA}\n{}", args.device);
    let Some(file) = &args.file else { return output::print(&plant) };
    write_new(file, &plant)?;
    let beside = file.with_file_name(SCHEMA);
    output_file::write(&beside, schema().as_bytes()).map_err(|reason| {
        // This command has just created the plant; without its schema, the next try would find it in the way.
        let _ = std::fs::remove_file(file);
        CliError::File { path: beside.clone(), reason }
    })?;
    output::print(&output::harmless(&format!("{}\n{}\n", file.display(), beside.display())))
}

/// Writes a new file; fails if it exists.
fn write_new(path: &Path, text: &str) -> Result<(), CliError> {
    output_file::write_new(path, text.as_bytes()).map_err(|reason| match reason.kind() {
        ErrorKind::AlreadyExists => CliError::Argument {
            text: path.display().to_string(),
            right: "this file exists and is not overwritten; choose another name".to_owned(),
        },
        _ => CliError::File { path: path.to_owned(), reason },
    })
}
