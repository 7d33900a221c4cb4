//! `commram force` and `commram unforce`: registers with a fixed value.

use super::Instance;
use super::complete;
use super::device::NameChecks;
use super::error::CliError;
use super::place::{NamedLocation, status_of};
use super::table::FormatArg;
use crate::identity::DeviceIndex;
use crate::layout::{DeviceFit, RegisterRef};

/// Force registers to a value, or list the forced registers.
///
/// A forced register keeps its value until it is unforced, even if firmware or PLC write it. All tables mark forced
/// registers. The firmware always reads the forced value. A PLC with mapped RAM reads back its own write until the
/// next event of the bus or processor cycle, when the forced value is restored. A single bit forces its register:
/// the other bits keep the values of this moment.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram force node2.w_OPTION_STATUS=16#0080
  commram force 'node2.a_RD_BMARRAY[1][0]=-1000'
  commram force %IX1.8=1
  commram force                                      list all forced registers
  commram force --format json")]
pub(crate) struct Args {
    /// Registers by name or address, and the values to force; without arguments the forced registers are listed
    #[arg(add = complete::writes(), value_name = "REG=VALUE")]
    writes: Vec<String>,
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// Stop forcing registers.
///
/// A register keeps its value until firmware or PLC writes it.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram unforce node2.w_OPTION_STATUS
  commram unforce --all")]
pub(crate) struct UnforceArgs {
    /// Registers by name or address
    #[arg(add = complete::registers(), value_name = "REG", required_unless_present = "all")]
    registers: Vec<String>,
    /// All forced registers
    #[arg(long, conflicts_with = "registers")]
    all: bool,
    #[command(flatten)]
    instance: Instance,
}

/// Forces registers, or lists them.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    use super::writes::RegisterWrite;
    use super::{poke, session::Session};

    if args.writes.is_empty() {
        return list(args);
    }
    poke::check(&args.instance, &args.writes)?;
    let session = Session::open(&args.instance, 0)?;
    let parse = |text: &String| poke::parse(text, |name| session.place(name));
    let writes = args.writes.iter().map(parse).collect::<Result<Vec<_>, _>>()?;
    let ops: Vec<_> = RegisterWrite::of(&session, &writes)?.iter().map(RegisterWrite::force).collect();
    session.request(&ops)?;
    for (place, _) in &writes {
        if let Some((register, _)) = place.bit_in() {
            let text =
                format!("{} is forced as a whole: its other bits keep their present values", register.name());
            super::output::note(&text);
        }
    }
    Ok(())
}

fn list(args: &Args) -> Result<(), CliError> {
    use super::peek::{RegisterReading, holding, number};
    use super::session::{Read, Session};
    use super::table;

    let session = Session::open(&args.instance, 0)?;
    // If structures overlay each other, a status register shows which one is valid. The emulator chooses the forced
    // registers only during the request, so the request reads all status registers.
    let statuses: Vec<_> = DeviceIndex::enumerate(session.all_fitted()).flat_map(statuses_of).collect();
    let reads: Vec<_> = statuses.iter().map(|(plc, status)| Read::register(*plc, status)).collect();
    let snapshot = session.read(&reads)?;
    let forces = &snapshot.forces;
    let place = |forced: &crate::plant::Forced| {
        let fitted = session.fitted(forced.plc);
        let address = fitted.device().at(forced.width, forced.offset);
        NamedLocation::parse(&fitted, &address.to_string())
    };
    let places = forces.iter().map(place).collect::<Result<Vec<_>, _>>()?;
    let row = |(forced, place): (&crate::plant::Forced, &NamedLocation)| {
        let is_status = |(plc, status): &(DeviceIndex, RegisterRef)| {
            *plc == forced.plc && place.status().is_some_and(|own| own.offset() == status.offset())
        };
        let status = statuses.iter().position(is_status).and_then(|index| snapshot.data.get(index));
        let live = place.phase(status.map(|bytes| number(bytes)));
        let row = holding(&session, place, forced.plc, live, forced.value, snapshot.time_us);
        RegisterReading { forced: true, ..row }
    };
    let rows: Vec<_> = forces.iter().zip(&places).map(row).collect();
    table::print(args.format.format, &rows, |rows| {
        let cells = |row: &RegisterReading| {
            [&row.register, &row.address, &row.hex, &row.meaning].map(Clone::clone).to_vec()
        };
        match rows {
            [] => "no register is forced\n".to_owned(),
            rows => table::columns(&rows.iter().map(cells).collect::<Vec<_>>()),
        }
    })
}

/// Returns the registers of a PLC that show which one of overlaid structures is valid.
fn statuses_of((plc, fitted): (DeviceIndex, &DeviceFit)) -> Vec<(DeviceIndex, RegisterRef)> {
    fitted.device().areas.iter().filter_map(status_of).map(|status| (plc, status)).collect()
}

/// Unforces registers.
pub(crate) fn unforce(args: &UnforceArgs) -> Result<(), CliError> {
    use super::session::Session;
    use crate::request::Op;

    let checks = NameChecks::new(&args.instance);
    args.registers.iter().try_for_each(|text| checks.place(text).map(drop))?;
    drop(checks);
    let session = Session::open(&args.instance, 0)?;
    let ops = if args.all {
        let forces = session.read(&[])?.forces;
        forces.iter().map(|f| Op::Unforce { plc: f.plc, offset: f.offset, width: f.width }).collect()
    } else {
        let op = |text: &String| {
            let place = session.place(text)?;
            let (offset, width) = place.whole();
            Ok(Op::Unforce { plc: session.plc_of(&place)?, offset, width })
        };
        args.registers.iter().map(op).collect::<Result<Vec<_>, CliError>>()?
    };
    session.request(&ops).map(drop)
}
