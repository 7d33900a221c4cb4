//! `commram plant`: what is needed to write a plant file, which needs no emulator.

use super::error::CliError;
use super::output;
use crate::devices;
use clap::Subcommand;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// The schema's file, beside the plants.
const SCHEMA: &str = "plant.schema.json";

/// Begin a plant file, or print the schema of plant files.
#[derive(clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  commram plant new plant.toml
  commram plant new --device DEVICE
  commram plant schema > plant.schema.json"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    New(NewArgs),
    /// Print the JSON schema of plant files, for editors and validators
    #[command(after_help = "Examples:\n  commram plant schema > plant.schema.json")]
    Schema,
}

/// Write a plant to begin with: all keys of a device, with what they mean.
///
/// The first line of the plant names its schema, which is written beside it: editors with a TOML language server complete
/// keys and underline mistakes then.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram plant new plant.toml && commram run --check plant.toml
  commram plant new --device DEVICE")]
struct NewArgs {
    /// The file, which must not be there yet; without one the plant is printed
    #[arg(value_name = "PLANT.toml")]
    file: Option<PathBuf>,
    /// The device
    #[arg(long, value_name = "DEVICE", value_parser = with_template(), default_value = devices::default().layout.name)]
    device: &'static str,
}

/// Takes the names of devices that have a template, and gives it.
fn with_template() -> impl TypedValueParser<Value = &'static str> {
    let names = devices::all().iter().filter(|known| known.template.is_some());
    let names = names.map(|known| PossibleValue::new(known.layout.name).help(known.layout.title));
    PossibleValuesParser::new(names).try_map(|name| {
        devices::find(&name).and_then(|known| known.template).ok_or("no template for a device of this name")
    })
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
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
    std::fs::write(&beside, schema()).map_err(|reason| CliError::File { path: beside.clone(), reason })?;
    output::print(&format!("{}\n{}\n", file.display(), beside.display()))
}

/// Writes a file that is not there yet.
fn write_new(path: &Path, text: &str) -> Result<(), CliError> {
    let file = OpenOptions::new().write(true).create_new(true).open(path);
    let written = file.and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|reason| match reason.kind() {
        ErrorKind::AlreadyExists => CliError::Argument {
            text: path.display().to_string(),
            right: "this file is there already, and nothing is overwritten; name another".to_owned(),
        },
        _ => CliError::File { path: path.to_owned(), reason },
    })
}
