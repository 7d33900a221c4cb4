//! `commram layout`: work on the layout files of a checkout, without an emulator.

use super::device::DeviceArg;
use super::error::CliError;
use super::output;
use super::table::{self, FormatArg, Row};
use crate::devices;
use crate::input_file;
use crate::output_file;
use clap::{Subcommand, ValueEnum};
use commram_layoutc::declaration::{Alignment, Declarations, MAX_BYTES};
use commram_layoutc::import::{Import, ImportError, NamePairs, Row as ImportRow, Verdict};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Check layout files, and import register offsets from the vendor's declarations.
#[derive(clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  commram layout check
  commram layout import BM_TYPES.st --check
  commram layout import BM_TYPES.st && cargo build --release
  commram layout schema > layout.schema.json"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Check(CheckArgs),
    Import(ImportArgs),
    /// Print the JSON schema of layout files, for editors and validators
    #[command(after_help = "Examples:\n  commram layout schema > layout.schema.json")]
    Schema,
}

/// Check layouts in the same way as the build.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram layout check
  commram layout check layouts/DEVICE --format json

Verdicts:
  built in  this commram was built from this layout
  other     a valid layout, but commram must be rebuilt to use it
  wrong     a build would stop with the printed message

Exit codes:
  0  all layouts are valid
  2  a layout is wrong")]
struct CheckArgs {
    /// Directories with a device.toml [default: those in `layouts`]
    #[arg(value_name = "DIR")]
    layouts: Vec<PathBuf>,
    #[command(flatten)]
    format: FormatArg,
}

/// Import offsets from declarations of IEC 61131-3 that were exported from the vendor's library.
///
/// Structures are identified by their names, registers by their names and the names of the sub-structures that contain them. The type names of
/// sub-structures are ignored. Several files are read as one file: each can use types and constants of the others. Programs, function blocks and
/// variables in the files are skipped. A structure stays unchanged if one of its registers is missing or has another width or other array bounds.
/// Bytes of members that the layout does not contain become padding. Afterwards commram must be rebuilt.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram layout import BM_TYPES.st --check
  commram layout import BM_TYPES.st --align 2 --format json
  commram layout import BM_TYPES.st --called STRUCTURE.a_RD_BMARRAY=a_RD_VALUE
  commram layout import DUTs/*.TcDUT GVLs/*.TcGVL --check

Verdicts:
  moved       at another offset; a structure: with another size
  type        with another elementary type of the same width; the layout keeps its type
  new         only in the declarations
  missing     only in the layout
  unlike      with another width, with other array bounds, or a structure in only one of the two
  left        a structure with missing or unlike registers; its file stays unchanged
  undeclared  a structure that the file does not declare

An export of commram itself is compared but never imported: it proves nothing about the device. An export has the head of \
commram, or a filler that is named after its offset, such as padding_12.

Exit codes:
  0  all declared structures were imported; with --check: no change is needed
  1  a structure stays unchanged, the offsets give no valid layout, the vendor has no library for the device, or the
     library of another device has confirmed other offsets; with --check: changes are needed
  2  wrong use, or a file does not parse")]
struct ImportArgs {
    /// The declarations: TYPE ... STRUCT ... END_STRUCT; END_TYPE, PLCopen XML, or objects of TwinCAT
    #[arg(value_name = "DECLARATIONS", required = true)]
    declarations: Vec<PathBuf>,
    /// The layout to change [default: that of the device in `layouts`]
    #[arg(long, value_name = "DIR")]
    layout: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArg,
    /// Largest alignment of members that the compiler of the library uses
    #[arg(long, value_enum, default_value_t = AlignArg::Natural)]
    align: AlignArg,
    /// Name of a structure, or of a register of a structure, in the declarations, if it differs from the layout's
    /// name
    #[arg(long, value_name = "OURS=THEIRS", value_parser = pair)]
    called: Vec<(String, String)>,
    /// Compare only, change no file
    #[arg(long)]
    check: bool,
    /// Also list registers without a difference
    #[arg(long = "full", alias = "all")]
    all: bool,
    #[command(flatten)]
    format: FormatArg,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum AlignArg {
    /// No alignment: members follow without a gap
    #[value(name = "1")]
    One,
    /// Even addresses
    #[value(name = "2")]
    Two,
    /// Addresses divisible by 4
    #[value(name = "4")]
    Four,
    /// The alignment of each type
    Natural,
}

impl From<AlignArg> for Alignment {
    fn from(align: AlignArg) -> Self {
        match align {
            AlignArg::One => Alignment::Packed,
            AlignArg::Two => Alignment::Two,
            AlignArg::Four => Alignment::Four,
            AlignArg::Natural => Alignment::Natural,
        }
    }
}

fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((ours, theirs)) if !ours.is_empty() && !theirs.is_empty() => {
            Ok((ours.to_owned(), theirs.to_owned()))
        }
        _ => Err("write the layout's name, `=` and the declaration's name".to_owned()),
    }
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Check(args) => check(args),
        Command::Import(args) => import(args),
        Command::Schema => output::print(commram_layoutc::SCHEMA),
    }
}

fn check(args: &CheckArgs) -> Result<(), CliError> {
    let all = if args.layouts.is_empty() { layouts_here()? } else { args.layouts.clone() };
    let rows: Vec<_> = all.iter().map(|dir| LayoutVerdict::of(dir)).collect();
    table::print(args.format.format, &rows, table::aligned)?;
    let is_wrong = rows.iter().any(|row| row.verdict == "wrong");
    if is_wrong { Err(CliError::ReportedWrongUse) } else { Ok(()) }
}

/// Finds the layouts of devices in a checkout.
fn layouts_here() -> Result<Vec<PathBuf>, CliError> {
    let wrong = |right: String| CliError::Argument { text: "layouts".to_owned(), right };
    let entries = Path::new("layouts").read_dir().map_err(|reason| {
        wrong(format!("{reason}; go to a checkout of commram, or name directories with layouts"))
    })?;
    let mut all: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    all.retain(|dir| dir.join("device.toml").is_file());
    all.sort();
    if all.is_empty() { Err(wrong("no directory contains a device.toml".to_owned())) } else { Ok(all) }
}

/// Result of the check of a layout.
#[derive(Serialize)]
struct LayoutVerdict {
    layout: String,
    verdict: &'static str,
    /// Hash of the register map.
    register_map: Option<String>,
    message: Option<String>,
}

impl LayoutVerdict {
    fn of(dir: &Path) -> Self {
        let layout = dir.display().to_string();
        match commram_layoutc::read(dir) {
            Ok(read) => {
                let known = devices::of_hash(read.layout_hash).is_some();
                let verdict = if known { "built in" } else { "other" };
                let register_map = Some(format!("16#{:016X}", read.layout_hash));
                Self { layout, verdict, register_map, message: None }
            }
            Err(error) => {
                Self { layout, verdict: "wrong", register_map: None, message: Some(error.to_string()) }
            }
        }
    }
}

impl Row for LayoutVerdict {
    const COLUMNS: &'static [&'static str] = &["layout", "verdict", "register_map", "message"];

    fn cells(&self) -> Vec<String> {
        let Self { layout, verdict, register_map, message } = self;
        let [register_map, message] = [register_map, message].map(|text| text.clone().unwrap_or_default());
        vec![layout.clone(), (*verdict).to_owned(), register_map, message]
    }
}

fn import(args: &ImportArgs) -> Result<(), CliError> {
    let declarations = read(&args.declarations)?;
    let called = NamePairs::new(args.called.iter().cloned())?;
    let of_device = || Path::new("layouts").join(args.device.layout().name);
    let layout = args.layout.clone().unwrap_or_else(of_device);
    let import = Import::plan(&layout, &declarations, args.align.into(), &called)?;
    if !args.check {
        output_file::write_together(import.files())
            .map_err(|(path, reason)| CliError::File { path, reason })?;
    }
    let rows = import.rows.iter().filter(|row| args.all || row.verdict != Verdict::Same);
    let rows: Vec<_> = rows.cloned().map(ImportTableRow).collect();
    table::print(args.format.format, &rows, |rows| match rows {
        [] => "all registers have the declared offsets\n".to_owned(),
        rows => table::aligned(rows),
    })?;
    report(args, &declarations, &import);
    let is_done = import.is_whole() && (!args.check || import.changes_nothing());
    if is_done { Ok(()) } else { Err(CliError::Reported) }
}

/// Reads the declarations of all files, and reports the parts of them that were skipped.
fn read(paths: &[PathBuf]) -> Result<Declarations, ImportError> {
    let mut declarations = Declarations::default();
    for path in paths {
        declarations.add(path, input_file::read_bytes(path, MAX_BYTES))?;
    }
    declarations.notes().iter().for_each(|note| output::note(note));
    Ok(declarations)
}

/// Reports the changed files, and whether the register map of this program is still up to date.
fn report(args: &ImportArgs, declarations: &Declarations, import: &Import) {
    if import.is_own_export {
        let file = declarations.title();
        output::note(&format!(
            "{file} is an export of commram, which proves nothing about the device: nothing is changed; import the \
             declarations of the vendor's library"
        ));
    }
    let verb = if args.check { "would be changed" } else { "changed" };
    for (path, _) in import.files() {
        output::note(&format!("{} {verb}", path.display()));
    }
    for device in &import.also_moved {
        output::note(&format!("the registers of {device} move, too: it uses the same structures"));
    }
    let hash = if args.check { import.hash_before } else { import.hash_after };
    let built = args.device.layout().layout_hash;
    if hash != built {
        output::note(&format!(
            "the layout has register map 16#{hash:016X}, this commram was built with 16#{built:016X}; \
             build it again with `cargo build --release`"
        ));
    }
}

#[derive(Serialize)]
struct ImportTableRow(ImportRow);

impl Row for ImportTableRow {
    const COLUMNS: &'static [&'static str] = &["structure", "member", "verdict", "before", "after", "remark"];

    fn cells(&self) -> Vec<String> {
        let ImportTableRow(row) = self;
        let number = |value: Option<u32>| value.map_or("-".to_owned(), |value| value.to_string());
        let (before, after) = (number(row.before), number(row.after));
        vec![
            row.structure.clone(),
            row.member.clone(),
            row.verdict.to_string(),
            before,
            after,
            row.remark.clone(),
        ]
    }
}
