//! `commram export`: the register map, and the messages of a plant's CAN bus, for other languages and tools. It
//! needs no emulator.

mod blocks;
mod fmu;

use super::device::DeviceArg;
use super::error::CliError;
use super::given;
use super::output;
use super::overwrite::refuse_inputs;
use crate::devices;
use crate::door::TrafficKind;
use crate::export::{self, DissectedBus, Format, Scope, StCompiler, StForm};
use crate::plant::PlantConfig;
use clap::ValueEnum;
use clap::builder::PossibleValue;
use std::path::{Path, PathBuf};

/// Export declarations and documentation of the registers for other languages and tools.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram export c --output commram.h
  commram export python --output commram.py
  commram export st --elementary --block node2
  commram export st --matiec --output commram.st
  commram export st --blocks --output commram.st
  commram export st --blocks --without LED --output commram.st
  commram export st --strucpp --output registers.st
  commram export matiec --main --output main.c
  commram export strucpp --main --output main.cpp
  commram export openplc --main --output hardware_layer.cpp
  commram export md > registers.md
  commram export dbc --plant plant.toml --bus open --output open.dbc
  commram export wireshark --plant plant.toml --output plant.lua
  commram export fmu plant.toml --output plant.fmu

docs/reference/export.md describes the use of each format.")]
pub(crate) struct Args {
    /// Format of the export
    #[arg(value_enum)]
    format: FormatArg,
    /// With `fmu`: the plant file, or a snapshot to start from; the built-in plant if omitted
    #[arg(value_name = "PLANT")]
    model: Option<PathBuf>,
    /// File to write; the standard output if omitted, except for `fmu`
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Only this block, for example `node2`
    #[arg(add = super::complete::areas(), long, value_name = "NAME")]
    block: Option<String>,
    /// With `st`: one elementary variable per register instead of structures
    #[arg(long)]
    elementary: bool,
    /// With `st`: a file that matiec compiles, which includes `program.st` and its configuration
    #[arg(long = "matiec")]
    for_matiec: bool,
    /// With `st`: a configuration that STruC++ compiles together with your program
    #[arg(long = "strucpp", conflicts_with_all = ["for_matiec", "blocks"])]
    for_strucpp: bool,
    /// With `st`: the file for matiec, including the function blocks of the device in Structured Text
    #[arg(long)]
    blocks: bool,
    /// With `st --blocks`: leave out this block, because the program has a variable of its name; can be given several times
    #[arg(long, value_name = "NAME", requires = "blocks")]
    without: Vec<String>,
    /// With `matiec` and `strucpp`: the program around the compiled one instead of the header; with `openplc`: its hardware layer
    #[arg(long)]
    main: bool,
    /// With `dbc` and `wireshark`, which need it: the plant that contains the buses; `commram new DIR` writes one
    #[arg(long, value_name = "FILE")]
    plant: Option<PathBuf>,
    /// With `dbc`: the bus; can be omitted if the plant has only one. With `wireshark`: only this bus
    #[arg(long, value_name = "NAME")]
    bus: Option<String>,
    /// With `fmu`: only these registers become variables, by name or pattern; can be given several times
    #[arg(long, value_name = "NAME", value_parser = given::text(given::BLOCK))]
    registers: Vec<String>,
    /// With `fmu`: the shared object libcommram_fmi.so, if it is not in the directory of the program
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArg,
}

#[derive(Clone, Copy, PartialEq)]
enum FormatArg {
    /// An export of the register map.
    Map(Format),
    /// An export of one bus of a plant.
    Dbc,
    /// An export of the buses of a plant.
    Wireshark,
    /// An export of a whole plant.
    Fmu,
}

/// Short description of `fmu`.
const ABOUT_FMU: &str = "unit for co-simulation by FMI 3.0, for Modelica, Simulink and other simulators";
/// Short description of `dbc`.
const ABOUT_DBC: &str = "CAN database of the messages on a plant's bus, for analysis tools";
/// Short description of `wireshark`.
const ABOUT_WIRESHARK: &str = "dissector in Lua for the buses of a plant, for Wireshark and tshark";

impl ValueEnum for FormatArg {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [FormatArg; Format::ALL.len() + 3] = {
            let mut all = [FormatArg::Dbc; Format::ALL.len() + 3];
            all[Format::ALL.len() + 1] = FormatArg::Wireshark;
            all[Format::ALL.len() + 2] = FormatArg::Fmu;
            let mut i = 0;
            while i < Format::ALL.len() {
                all[i] = FormatArg::Map(Format::ALL[i]);
                i += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            FormatArg::Map(format) => PossibleValue::new(format.name()).help(format.about()),
            FormatArg::Fmu => PossibleValue::new("fmu").help(ABOUT_FMU),
            FormatArg::Dbc => PossibleValue::new("dbc").help(ABOUT_DBC),
            FormatArg::Wireshark => PossibleValue::new("wireshark").help(ABOUT_WIRESHARK),
        })
    }
}

pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let is_fmu = args.format == FormatArg::Fmu;
    if !is_fmu && (args.model.is_some() || !args.registers.is_empty() || args.library.is_some()) {
        return Err(wrong("PLANT --registers --library", "only `fmu` exports a whole plant"));
    }
    let inputs = [&args.model, &args.plant, &args.library];
    refuse_inputs(args.output.as_deref(), inputs.into_iter().filter_map(Option::as_deref))?;
    let text = match args.format {
        FormatArg::Map(format) => of_map(args, format)?,
        FormatArg::Dbc => of_bus(args)?,
        FormatArg::Wireshark => of_buses(args)?,
        FormatArg::Fmu => return of_plant(args),
    };
    match &args.output {
        Some(path) => output::write(path, text.as_bytes()),
        None => output::print(&text),
    }
}

fn wrong(text: impl Into<String>, right: impl Into<String>) -> CliError {
    CliError::Argument { text: text.into(), right: right.into() }
}

fn of_map(args: &Args, format: Format) -> Result<String, CliError> {
    if args.plant.is_some() || args.bus.is_some() {
        return Err(wrong(
            format!("{format} --plant --bus"),
            "only `dbc` and `wireshark` export buses of a plant",
        ));
    }
    if args.blocks {
        return with_blocks(args, format);
    }
    let format = match format {
        Format::St(_) => Format::St(StForm { elementary: args.elementary, compiler: compiler(args) }),
        other if args.elementary => {
            return Err(wrong(format!("{other} --elementary"), "only `st` has elementary variables"));
        }
        other if args.for_matiec => {
            return Err(wrong(format!("{other} --matiec"), "only `st` has a form for matiec"));
        }
        other if args.for_strucpp => {
            return Err(wrong(format!("{other} --strucpp"), "only `st` has a form for STruC++"));
        }
        Format::Matiec if args.main => Format::MatiecMain,
        Format::StruCpp if args.main => Format::StruCppMain,
        Format::OpenPlc if args.main => Format::OpenPlcLayer,
        other => other,
    };
    if args.main && !matches!(format, Format::MatiecMain | Format::StruCppMain | Format::OpenPlcLayer) {
        let right = "only `matiec`, `strucpp` and `openplc` have a program around the compiled one";
        return Err(wrong(format!("{format} --main"), right));
    }
    let scope = Scope::new(args.device.layout(), args.block.as_deref())?;
    if let Some((what, name)) = scope.ambiguous_name() {
        let right = "two cards, or a card and the PLC, have it; export each with --block";
        return Err(wrong(format!("{format} of two {what} `{name}`"), right));
    }
    let folder = args.device.folder().map(str::to_owned);
    Ok(export::export_scope(Scope { folder, ..scope }, format)?)
}

/// Returns the compiler for which the declarations are written.
fn compiler(args: &Args) -> StCompiler {
    match (args.for_matiec, args.for_strucpp) {
        (true, _) => StCompiler::Matiec,
        (_, true) => StCompiler::StruCpp,
        _ => StCompiler::Any,
    }
}

/// Exports the function blocks. They use the structures of several areas.
fn with_blocks(args: &Args, format: Format) -> Result<String, CliError> {
    if !matches!(format, Format::St(_)) || args.main {
        return Err(wrong(format!("{format} --blocks"), "only `st` has function blocks"));
    }
    if args.elementary || args.block.is_some() {
        let right = "function blocks use the structures of all areas; omit --elementary and --block";
        return Err(wrong("st --blocks", right));
    }
    let device = args.device.layout();
    let known = devices::all();
    let Some(found) = known.iter().find(|it| it.layout.name == device.name && !it.st.is_empty()) else {
        let with = known.iter().filter(|it| !it.st.is_empty()).map(|it| it.layout.name).collect::<Vec<_>>();
        let right = format!("devices with function blocks in Structured Text are: {}", with.join(", "));
        return Err(wrong(format!("st --blocks --device {}", device.name), right));
    };
    let parts = found.st.iter().map(|part| part.written_out()).collect::<Vec<_>>();
    let blocks = blocks::without(parts.join("\n") + "\n", &args.without)?;
    Ok(export::st_with_blocks(device, &blocks))
}

fn of_plant(args: &Args) -> Result<(), CliError> {
    let of_others = args.plant.is_some() || args.bus.is_some() || args.block.is_some();
    if of_others || args.elementary || args.for_matiec || args.for_strucpp || args.blocks || args.main {
        let right = "write the plant file after it; the options are --output, --registers and --library";
        return Err(wrong(
            "fmu --plant --bus --block --elementary --matiec --strucpp --blocks --main",
            right,
        ));
    }
    let to = args.output.as_deref().ok_or_else(|| wrong("fmu", "give the file, --output plant.fmu"))?;
    fmu::run(args.model.as_deref(), &args.registers, args.library.as_deref(), to)
}

/// Loads the plant of an export of buses; `noun` names the export in a message.
fn plant_of<'a>(args: &'a Args, format: &str, noun: &str) -> Result<(&'a Path, PlantConfig), CliError> {
    if args.elementary
        || args.for_matiec
        || args.for_strucpp
        || args.blocks
        || args.main
        || args.block.is_some()
    {
        return Err(wrong(
            format!("{format} --block --elementary --matiec --strucpp --blocks --main"),
            format!("{noun} has no registers"),
        ));
    }
    let path = args.plant.as_deref().ok_or_else(|| wrong(format, "give the plant that contains the buses, --plant plant.toml; `commram new DIR` writes a plant file"))?;
    Ok((path, PlantConfig::load(path)?))
}

/// Returns the bus of this name; `None` if the user gave no name.
fn wanted<'a>(args: &'a Args, plant: &PlantConfig) -> Result<Option<&'a str>, CliError> {
    let Some(name) = args.bus.as_deref() else { return Ok(None) };
    let buses = plant.buses.iter().map(|bus| bus.name()).collect::<Vec<_>>();
    if buses.contains(&name) {
        return Ok(Some(name));
    }
    Err(wrong(format!("--bus {name}"), format!("its buses are: {}", buses.join(", "))))
}

fn of_buses(args: &Args) -> Result<String, CliError> {
    let (path, plant) = plant_of(args, "wireshark", "a dissector")?;
    let wanted = wanted(args, &plant)?;
    let buses = plant.messages_of_buses(|bus| wanted.is_none_or(|name| name == bus));
    let buses = buses.map(|(bus, messages)| DissectedBus {
        name: bus.name(),
        kind: bus.family(),
        is_can: devices::BUS_KINDS
            .iter()
            .any(|it| it.name == bus.family() && it.traffic_kind == TrafficKind::Frames),
        messages,
    });
    let file = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
    let about = format!("Wireshark's dissector of the buses of {file}; made by commram export wireshark");
    Ok(export::wireshark(buses, &devices::dissectors(), &about))
}

fn of_bus(args: &Args) -> Result<String, CliError> {
    let (path, plant) = plant_of(args, "dbc", "a CAN database")?;
    let buses = plant.buses.iter().map(|bus| bus.name()).collect::<Vec<_>>();
    let bus = match (wanted(args, &plant)?, &buses[..]) {
        (Some(bus), _) => bus,
        (None, [bus]) => bus,
        (None, _) => return Err(wrong("dbc", format!("give one of its buses, --bus: {}", buses.join(", ")))),
    };
    let messages = plant.messages(bus);
    if messages.is_empty() {
        let right = "no device on this bus knows its messages before it runs; docs/reference/export.md lists the devices that do";
        return Err(wrong(format!("--bus {bus}"), right));
    }
    Ok(export::dbc(&messages, &head(bus, path)))
}

fn head(bus: &str, path: &Path) -> String {
    let file = path.file_name().map(|name| output::harmless(&name.to_string_lossy())).unwrap_or_default();
    format!(
        "Messages of bus {bus} of {file}, with the identifiers that its devices begin with; made by commram export dbc"
    )
}
