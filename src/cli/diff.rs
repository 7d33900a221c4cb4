//! `commram diff`: registers that differ from an earlier dump.

use super::Instance;
use super::change::{self, Change, RegisterValue, RegisterValues};
use super::device::{NameChecks, on_any_device};
use super::dump::{self, Blocks, see};
use super::error::CliError;
use super::output;
use super::session::Session;
use super::table::{self, FormatArg};
use crate::identity::DeviceIndex;
use crate::input_file;
use crate::layout::{Area, DeviceLayout, LayoutError};
use crate::plural::plural_of;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Compare two dumps, or a dump with the current values of the registers.
///
/// Dumps are files written by `commram dump --format json`. A plain dump contains only registers that differ from
/// their reset value. A register that is missing in a file is shown as `-`, since the file does not contain its
/// value. A dump made with `dump --full` contains all registers. With one file, the blocks that occur in it are
/// compared with the running instance (all blocks, if the file is empty). Registers that are no longer live are
/// only counted. A dump that contradicts itself is refused.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram dump --full --format json >before.json
  commram step 10ms && commram diff before.json
  commram diff before.json after.json --format md

Exit codes:
  0  no differences
  1  there are differences
  2  wrong use, or a file cannot be read
  3  the emulator is not running")]
pub(crate) struct Args {
    /// A dump in JSON
    #[arg(value_name = "BEFORE")]
    before: PathBuf,
    /// A later dump [default: the running instance]
    #[arg(value_name = "AFTER")]
    after: Option<PathBuf>,
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// Prints the differences between two dumps, or between a dump and the instance.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let before = read(&args.before)?;
    let known = RegisterValues::new(before.iter().cloned());
    let changes = match &args.after {
        Some(path) => {
            let after = read(path)?;
            let mut changes = known.changed(&after);
            changes.extend(RegisterValues::new(after).missing(&before));
            changes
        }
        None => {
            let Now { session, registers, phase_register } = now(&args.instance, &before, &known)?;
            let changes = known.changed(&registers);
            let mut absent = BTreeMap::<_, Vec<_>>::new();
            for gone in RegisterValues::new(registers).missing(&before) {
                absent.entry(Absence::of(&session, &gone)?).or_default().push(gone);
            }
            for (reason, registers) in absent {
                let count = plural_of(&registers, "register");
                let reason = reason.text(&session, phase_register);
                output::note(&format!("{count} of {} {reason}", args.before.display()));
            }
            changes
        }
    };
    table::print(args.format.format, &changes, |changes| match changes {
        [] => "no differences\n".to_owned(),
        changes => change::text(changes),
    })?;
    if changes.is_empty() { Ok(()) } else { Err(CliError::Reported) }
}

fn read(path: &Path) -> Result<Vec<RegisterValue>, CliError> {
    let name = path.display().to_string();
    let text = input_file::read(path, input_file::LONGEST)
        .map_err(|error| CliError::Argument { text: name.clone(), right: error.to_string() })?;
    change::parse(&name, &text)
}

/// What the instance has in the blocks of a dump.
struct Now {
    session: Session,
    registers: Vec<RegisterValue>,
    /// The register that shows which structure is valid.
    phase_register: Option<&'static str>,
}

/// The reason why the instance has no value of a register of the dump.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Absence {
    /// The instance has no PLC of this name.
    Plc(String),
    /// The PLC of this name has fewer retain flags.
    RetainFlag(String),
    /// Another structure is valid at the address.
    Structure,
}

impl Absence {
    fn of(session: &Session, gone: &Change) -> Result<Self, CliError> {
        let Some(plc) = position(session, &gone.plc) else { return Ok(Self::Plc(gone.plc.clone())) };
        let is_retain = is_beyond_the_flags(session, plc, &gone.address)?;
        Ok(if is_retain { Self::RetainFlag(gone.plc.clone()) } else { Self::Structure })
    }

    fn text(&self, session: &Session, phase_register: Option<&str>) -> String {
        match self {
            Self::Plc(plc) => {
                let (instance, plcs) = (session.instance(), session.plcs().join(", "));
                format!("not compared: instance '{instance}' has no PLC '{plc}'; its PLCs are: {plcs}")
            }
            Self::RetainFlag(plc) => {
                format!(
                    "not compared: PLC '{plc}' has fewer retain flags; `retain_bytes` in the plant file gives it more"
                )
            }
            Self::Structure => {
                format!(
                    "not compared: another structure is valid at their addresses now{}",
                    see(phase_register)
                )
            }
        }
    }
}

fn position(session: &Session, plc: &str) -> Option<DeviceIndex> {
    session.plcs().iter().position(|name| name == plc).map(DeviceIndex::at)
}

/// True if the address is that of a retain flag which the PLC does not have.
fn is_beyond_the_flags(session: &Session, plc: DeviceIndex, address: &str) -> Result<bool, CliError> {
    let device = session.device(plc);
    let address = device.address(address)?;
    let area = device.area_at(address)?;
    let end = address.offset() + address.width().bytes() - area.first;
    Ok(device.is_retain(area.first) && end > session.retain_bytes(plc)?)
}

/// Reads the registers of the blocks in `before`: those that `before` contains, and those that differ from their reset
/// values.
fn now(instance: &Instance, before: &[RegisterValue], known: &RegisterValues) -> Result<Now, CliError> {
    let refused = |held| on_any_device(|fitted| area(fitted.device(), held).map(drop)).err();
    if let Some(refusal) = before.iter().find_map(refused) {
        // The register may belong to a device in a folder. Only a running instance knows the registers of such a
        // device.
        NameChecks::new(instance).answer(refusal, |_| Ok(()), |_| Ok(()))?;
    }
    let session = Session::open_for_reading(instance)?;
    let first = |held: &RegisterValue| {
        let plc = position(&session, &held.plc).unwrap_or(DeviceIndex(0));
        Ok::<_, CliError>((held.plc.clone(), area(session.device(plc), held)?.first))
    };
    let meant = before.iter().map(first).collect::<Result<BTreeSet<_>, _>>()?;
    let plain = plain_ram(&session, before)?;
    let names = match plain.as_slice() {
        [] => plain,
        _ => session.plcs().iter().map(|plc| format!("{plc}:")).chain(plain).collect(),
    };
    let dump = Blocks::find(&session, &names)?.read(&session)?;
    let (mut registers, phase_register) = (Vec::new(), dump.phase_register);
    for row in dump.rows {
        let differs = row.differs;
        let held = RegisterValue::from(row.holding);
        let is_meant = meant.is_empty() || meant.contains(&first(&held)?);
        if known.has(&held) || is_meant && differs {
            registers.push(held);
        }
    }
    Ok(Now { session, registers, phase_register })
}

/// Returns the names of the plain RAM in `before`: a dump of all blocks contains no plain RAM. If `before` can be the
/// dump of a whole area, the area is read. If it has other addresses, only these addresses are read.
fn plain_ram(session: &Session, before: &[RegisterValue]) -> Result<Vec<String>, CliError> {
    let mut areas = BTreeMap::<_, (&Area, Vec<&RegisterValue>, bool)>::new();
    for held in before {
        let Some(plc) = position(session, &held.plc) else { continue };
        let device = session.device(plc);
        let address = device.address(&held.address)?;
        let area = device.area_at(address)?;
        if area.structures.is_empty() {
            let is_row = dump::is_row_of_plain_ram(area, address);
            let (_, of_area, are_rows) = areas.entry((plc, area.first)).or_insert((area, Vec::new(), true));
            of_area.push(held);
            *are_rows &= is_row;
        }
    }
    let mut names = Vec::new();
    for ((plc, _), (area, of_area, are_rows)) in areas {
        if let (true, [one, ..]) = (are_rows, &*of_area) {
            names.push(format!("{}:{}", one.plc, area.name));
            continue;
        }
        for held in of_area {
            if !is_beyond_the_flags(session, plc, &held.address)? {
                names.push(format!("{}:{}", held.plc, held.address));
            }
        }
    }
    Ok(names)
}

fn area(device: &'static DeviceLayout, held: &RegisterValue) -> Result<&'static Area, LayoutError> {
    device.area_at(device.address(&held.address)?)
}
