//! `commram map`: the register map, which needs no emulator.

pub(in crate::cli) mod detail;
pub(in crate::cli) mod entry;

use super::complete;
use super::device::DeviceArg;
use super::error::CliError;
use super::given;
use super::output;
use super::place::{NamedLocation, without_twins};
use super::session::Session;
use super::style;
use super::table::{self, Format, FormatArg};
use super::{Instance, instance_name};
use crate::layout::{
    Address, Area, AreaOrRegisters, AreaStructure, DeviceFit, Fit, LayoutError, Role, Width, split_plc,
};
use entry::Entry;

/// Show the register map: types, owners, meanings, and the source of each fact.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram map
  commram map node2
  commram map node2.w_OPTION_STATUS
  commram map 'node2.*STATUS*'
  commram map %MB3.200012
  commram map node2.w_CPU_CONTROL.7        a single bit
  commram map --full --format csv > map.csv
  commram map maxx:slotG -i press-1

Provenance: `manual` means that the manual states the fact; `manual` with a name means that the vendor's library of \
that name states it. For all other facts the map names the decision (D-nn) on which the fact is based. \
Names of blocks (node1, node2, ...) were chosen by this project (D-220).")]
pub(crate) struct Args {
    /// A register, a bit, an array, a pattern ('node2.*STATUS*'), an address or a block [default: everything]
    #[arg(add = complete::blocks(), value_name = "NAME|ADDRESS|BLOCK", value_parser = given::text(given::BLOCK))]
    what: Option<String>,
    /// Also registers that the manual reserves
    #[arg(long = "full", alias = "all")]
    all: bool,
    #[command(flatten)]
    device: DeviceArg,
    /// Use a PLC of this instance with its options: the registers of a slot depend on its module
    #[arg(add = super::complete::instances(), short, long, value_name = "NAME", value_parser = instance_name, conflicts_with = "device")]
    instance: Option<String>,
    #[command(flatten)]
    format: FormatArg,
}

/// Prints the entries of the register map that the arguments select.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let (plc, what) = split_plc(args.what.as_deref().unwrap_or_default());
    let fitted = match &args.instance {
        Some(instance) => {
            let session = Session::open_for_reading(&Instance::starting(instance))?;
            let plc = session.plc(plc, what);
            session.fitted(plc.map_err(|error| match what {
                "" => error.with_command(|plc| format!("commram map {plc}:")),
                _ => error,
            })?)
        }
        // If the user has not named an instance, only the device is known, and not its options.
        None => DeviceFit::unknown(args.device.layout()),
    };
    let device = fitted.device();
    let (entries, single) = entries_of(&fitted, what)?;
    let entries: Vec<_> = entries.into_iter().filter(|entry| args.all || single || !entry.reserved).collect();
    if single && args.format.format == Format::Text {
        return output::print(
            &entries.iter().map(|entry| detail::text(device, entry)).collect::<Vec<_>>().join("\n"),
        );
    }
    table::print(args.format.format, &entries, text)
}

/// Returns the entries that the text names; an empty text names all entries. Also returns true if the text names a
/// single register, address or bit.
///
/// # Errors
/// The device has no such register, block or address.
pub(crate) fn entries_of(fitted: &DeviceFit, what: &str) -> Result<(Vec<Entry>, bool), CliError> {
    let device = fitted.device();
    let of_area = |area| entry::of_area(fitted, area);
    Ok(match what {
        _ if let Some(bit) = bit(fitted, what)? => (vec![bit], true),
        "" => (device.named_areas().flat_map(of_area).collect::<Vec<_>>(), false),
        address if address.starts_with('%') => (at_address(fitted, device.address(address)?)?, true),
        name => match fitted.area_or_registers(name)? {
            AreaOrRegisters::Area(area) => {
                if fitted.area(area) == Fit::Empty {
                    fitted.registers_at(fitted.device().at(Width::Byte, area.first), None)?;
                }
                (of_area(area), false)
            }
            AreaOrRegisters::Registers(registers) => {
                let entries = entry::of_registers(&registers);
                // A reserved register is shown only if the text names exactly this register.
                let single = entries.len() == 1;
                (entries, single)
            }
        },
    })
}

/// Returns the entry of a single bit, if `what` names a bit.
fn bit(fitted: &DeviceFit, what: &str) -> Result<Option<Entry>, CliError> {
    match NamedLocation::parse(fitted, what) {
        Ok(place) => {
            Ok(place.bit_in().map(|(register, bit)| entry::of_bit(&register, bit, &place.address())))
        }
        Err(refusal @ LayoutError::BadBit { .. }) => Err(refusal.into()),
        // The text does not name a register. It may be a block, an array or a pattern, which the caller looks up.
        Err(_) => Ok(None),
    }
}

/// Returns the registers at an address; structures that overlay each other share some of them.
fn at_address(fitted: &DeviceFit, address: Address) -> Result<Vec<Entry>, CliError> {
    let registers = without_twins(fitted.registers_at(address, None)?);
    Ok(registers.iter().map(entry::of_register).collect())
}

/// Formats each block as a heading, with its registers in columns below.
fn text(entries: &[Entry]) -> String {
    let lines: Vec<_> = entries.iter().map(Entry::text_cells).collect();
    let rows = table::rows(&lines);
    let mut text = String::new();
    let mut last: Option<(&Area, &str)> = None;
    for (entry, line) in entries.iter().zip(&rows) {
        let block = (entry.area_ref, entry.structure);
        if last.is_none_or(|(area, structure)| !core::ptr::eq(area, block.0) || structure != block.1) {
            if !text.is_empty() {
                text.push('\n');
            }
            text.push_str(&style::head(&head(block.0, block.1)));
            text.push('\n');
            last = Some(block);
        }
        // Plain RAM has no registers: its heading contains all information.
        if !entry.structure.is_empty() {
            text.push_str(line);
            text.push('\n');
        }
    }
    text
}

fn head(area: &Area, structure: &str) -> String {
    let Area { name, doc, page, .. } = area;
    let placed = area.structures.iter().find(|placed| placed.structure.name == structure);
    let (content, page) = match placed {
        Some(placed) => {
            let role = role(area, placed).map(|role| format!("As {role}: ")).unwrap_or_default();
            (format!("{role}{structure}: {}", placed.structure.doc), placed.structure.page)
        }
        None => ("plain RAM".to_owned(), *page),
    };
    let page = if page.is_empty() { String::new() } else { format!(" (p. {page})") };
    format!("{name}  {}-{}  {doc}. {content}{page}", area.begin(), area.numbers().end())
}

/// Returns the role that uses a structure, if another role uses another structure at the same addresses.
fn role(area: &Area, placed: &AreaStructure) -> Option<Role> {
    let has =
        |role| area.structures.iter().any(|it| it.structure.name == placed.structure.name && it.role == role);
    placed.role.filter(|_| area.structures.iter().any(|other| !has(other.role)))
}
