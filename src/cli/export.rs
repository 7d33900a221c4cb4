//! `commram export`: the register map for other languages and tools; it needs no emulator.

use super::device::DeviceArg;
use super::error::CliError;
use super::output;
use crate::export::{self, Format};
use clap::ValueEnum;
use clap::builder::PossibleValue;
use std::path::PathBuf;

/// Export declarations and documentation of the registers for other languages and tools.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram export c --output commram.h
  commram export python --output commram.py
  commram export st --elementary --block node2
  commram export md > registers.md

docs/export.md tells how each format is used.")]
pub(crate) struct Args {
    /// What to export
    #[arg(value_enum)]
    format: FormatArg,
    /// File to write; the standard output if left out
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Only this block, for example `node2`
    #[arg(long, value_name = "NAME")]
    block: Option<String>,
    /// With `st`: an elementary variable per register instead of structures
    #[arg(long)]
    elementary: bool,
    #[command(flatten)]
    device: DeviceArg,
}

#[derive(Clone, Copy)]
struct FormatArg(Format);

impl ValueEnum for FormatArg {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [FormatArg; Format::ALL.len()] = {
            let mut all = [FormatArg(Format::C); Format::ALL.len()];
            let mut i = 0;
            while i < all.len() {
                all[i] = FormatArg(Format::ALL[i]);
                i += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.0.name()).help(self.0.about()))
    }
}

/// Exports.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let format = match (args.format.0, args.elementary) {
        (format, false) => format,
        (Format::St, true) => Format::StElementary,
        (other, true) => {
            let right = "only `st` has elementary variables".to_owned();
            return Err(CliError::Argument { text: format!("{other} --elementary"), right });
        }
    };
    let text = export::export(args.device.device, format, args.block.as_deref())?;
    let Some(path) = &args.output else {
        return output::print(&text);
    };
    std::fs::write(path, text).map_err(|reason| CliError::File { path: path.clone(), reason })
}
