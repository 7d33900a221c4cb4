//! `commram peek`: what registers hold.

use super::device::of_any_device_but_told_by;
use super::error::CliError;
use super::place::{Place, live_by};
use super::session::{Read, Session};
use super::table::{self, FormatArg, Row};
use super::{Instance, output};
use crate::layout::Live;
use serde::Serialize;

/// Read registers and say what they mean.
///
/// All registers are read at one moment of emulated time. Reading changes nothing.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram peek node2.w_OPTION_STATUS
  commram peek 'node2.a_STAT_SL[1]' 'node2.a_STAT_SL[2]' 'node2.a_STAT_SL[3]'
  commram peek --raw %MW3.200002
  commram peek line2:node1.w_OPTION_STATUS --format json")]
pub(crate) struct Args {
    /// Registers by name or address
    #[arg(value_name = "REG", required = true)]
    registers: Vec<String>,
    /// Print nothing but the numbers, one per line
    #[arg(long, conflicts_with = "format")]
    raw: bool,
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// A register and what it holds.
#[derive(Serialize)]
pub(crate) struct Holding {
    /// Emulated time, in microseconds.
    pub time_us: u64,
    /// The PLC.
    pub plc: String,
    /// Name of the register with the PLC if need be, else the address.
    pub register: String,
    /// The address.
    pub address: String,
    /// The data type.
    #[serde(rename = "type")]
    pub ty: &'static str,
    /// The number it stands for.
    pub value: i64,
    /// The bit pattern in IEC notation.
    pub hex: String,
    /// The meaning.
    pub meaning: String,
    /// Whether the register is forced.
    pub forced: bool,
}

impl Holding {
    /// The meaning, with a mark if the register is forced.
    pub(crate) fn marked_meaning(&self) -> String {
        let mark = if self.forced { "[forced] " } else { "" };
        format!("{mark}{}", self.meaning)
    }
}

impl Row for Holding {
    const COLUMNS: &'static [&'static str] =
        &["time_us", "plc", "register", "address", "type", "value", "hex", "meaning", "forced"];

    fn cells(&self) -> Vec<String> {
        vec![
            self.time_us.to_string(),
            self.plc.clone(),
            self.register.clone(),
            self.address.clone(),
            self.ty.to_owned(),
            self.value.to_string(),
            self.hex.clone(),
            self.meaning.clone(),
            self.forced.to_string(),
        ]
    }
}

/// Reads the registers and prints them.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let check = of_any_device_but_told_by(&args.instance);
    args.registers.iter().try_for_each(|text| check(text).map(drop))?;
    let session = Session::open_for_reading(&args.instance)?;
    let places = args.registers.iter().map(|text| session.place(text)).collect::<Result<Vec<_>, _>>()?;
    let holdings = read(&session, &places)?;
    if args.raw {
        return output::print(
            &holdings.iter().map(|holding| format!("{}\n", holding.hex)).collect::<String>(),
        );
    }
    table::print(args.format.format, &holdings, |holdings| holdings.iter().map(line).collect())
}

/// What the places hold, all at one moment.
///
/// # Errors
/// A PLC that does not exist or is missing, or the emulator has gone.
pub(crate) fn read(session: &Session, places: &[Place]) -> Result<Vec<Holding>, CliError> {
    let plcs = places.iter().map(|place| session.plc_of(place)).collect::<Result<Vec<_>, _>>()?;
    let mut reads: Vec<_> = places.iter().zip(&plcs).map(|(place, &plc)| Read::place(plc, place)).collect();
    // Which of two overlaid structures is live follows from a register, read at the same moment.
    let statuses = places.iter().zip(&plcs).map(|(place, &plc)| {
        place.status().map(|status| {
            reads.push(Read::register(plc, &status));
            reads.len() - 1
        })
    });
    let statuses: Vec<_> = statuses.collect();
    let snapshot = session.read(&reads)?;
    let value = |index: usize| snapshot.data.get(index).map_or(0, |bytes| number(bytes));
    let holdings =
        places.iter().zip(plcs).zip(statuses).enumerate().map(|(index, ((place, plc), status))| {
            let live = status.map_or(Live::Cyclic, |index| live_by(value(index)));
            let forced = snapshot.is_forced(plc, place.offset(), place.width().bytes());
            Holding { forced, ..holding(session, place, plc, live, value(index), snapshot.time_us) }
        });
    Ok(holdings.collect())
}

/// What a place of PLC `plc` holds, in phase `live`, at an emulated time.
pub(crate) fn holding(
    session: &Session,
    place: &Place,
    plc: u16,
    live: Live,
    value: u32,
    time_us: u64,
) -> Holding {
    let ty = place.ty(live);
    let bit = place.bit();
    Holding {
        time_us,
        plc: session.plcs().get(usize::from(plc)).cloned().unwrap_or_default(),
        register: session.prefix(plc) + &place.name(live),
        address: place.address().to_string(),
        ty: if bit.is_some() { "BOOL" } else { ty.name() },
        value: bit.map_or(ty.number(value), |bit| i64::from(value >> bit & 1)),
        hex: place.format(live, value),
        meaning: place.meaning(live, value),
        forced: false,
    }
}

/// `node2.w_OPTION_STATUS = 16#0043  synchronous operation of the master is being set up`
pub(crate) fn line(holding: &Holding) -> String {
    let Holding { register, hex, .. } = holding;
    let line = format!("{register} = {hex}  {}", holding.marked_meaning());
    format!("{}\n", line.trim_end())
}

/// The number in little-endian bytes.
pub(crate) fn number(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |number, &byte| number << 8 | u32::from(byte))
}
