//! `commram peek`: values of registers.

use super::complete;
use super::device::NameChecks;
use super::dump::{self, Blocks};
use super::error::CliError;
use super::place::NamedLocation;
use super::session::{Read, Session, Snapshot};
use super::table::{self, FormatArg, Row};
use super::{Instance, output};
use crate::identity::DeviceIndex;
use crate::layout::{RegisterPhase, is_pattern};
use serde::Serialize;

/// Read registers and show their meaning.
///
/// All registers are read at one moment of emulated time. Reading changes nothing. If a pattern matches registers
/// of structures that overlay each other, only the registers of the live structure are shown, if it has any.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram peek node2.w_OPTION_STATUS
  commram peek 'node2.a_STAT_SL[1]' 'node2.a_STAT_SL[2]' 'node2.a_STAT_SL[3]'
  commram peek 'node2.a_STAT_SL[1..3]' 'node2.*STATUS*'
  commram peek node2.w_CPU_CONTROL.7               a single bit
  commram peek --raw %MW3.200002
  commram peek line2:node1.w_OPTION_STATUS --format json")]
pub(crate) struct Args {
    /// Registers by name or address, or patterns: * for any text, `[0..3]` for a range, `[*]` for all
    #[arg(add = complete::registers(), value_name = "REG", required = true)]
    registers: Vec<String>,
    /// Print only the numbers, one per line
    #[arg(long, conflicts_with = "format")]
    raw: bool,
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// A register and its value.
#[derive(Serialize)]
pub(crate) struct RegisterReading {
    /// Emulated time, in microseconds.
    pub time_us: u64,
    pub plc: String,
    /// Name of the register, with the PLC if the instance has several; the address if no register is at this place.
    pub register: String,
    pub address: String,
    #[serde(rename = "type")]
    pub ty: &'static str,
    /// Value of the register as a number; signed for signed types.
    pub value: i64,
    /// The bit pattern in IEC notation.
    pub hex: String,
    pub meaning: String,
    /// True if the register is forced.
    pub forced: bool,
    /// Memory range of the register: index of the PLC, first byte in the image, number of bytes.
    #[serde(skip)]
    pub stretch: (DeviceIndex, u32, u32),
}

impl RegisterReading {
    /// Returns the meaning, with a mark if the register is forced.
    pub(crate) fn marked_meaning(&self) -> String {
        let mark = if self.forced { "[forced] " } else { "" };
        format!("{mark}{}", self.meaning)
    }
}

impl Row for RegisterReading {
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
    let checks = NameChecks::new(&args.instance);
    for text in &args.registers {
        if is_pattern(text) {
            dump::check(&checks, text)?;
        } else {
            checks.place(text)?;
        }
    }
    drop(checks);
    let session = Session::open_for_reading(&args.instance)?;
    let wanted = args.registers.iter().map(|text| ReadTarget::find(&session, text));
    let holdings = read(&session, &wanted.collect::<Result<Vec<_>, _>>()?)?;
    if args.raw {
        return output::print(
            &holdings.iter().map(|holding| format!("{}\n", holding.hex)).collect::<String>(),
        );
    }
    table::print(args.format.format, &holdings, |holdings| holdings.iter().map(line).collect())
}

/// The registers to which an argument of the command refers.
pub(crate) enum ReadTarget {
    /// A register or an address.
    One(DeviceIndex, NamedLocation),
    /// The registers that match a pattern.
    Several(Blocks),
}

impl ReadTarget {
    /// Finds the registers of `text` in an instance.
    ///
    /// # Errors
    /// No PLC, register or address has this name.
    pub(crate) fn find(session: &Session, text: &str) -> Result<Self, CliError> {
        if is_pattern(text) {
            return Ok(Self::Several(Blocks::find(session, &[text.to_owned()])?));
        }
        let place = session.place(text)?;
        Ok(Self::One(session.plc_of(&place)?, place))
    }

    /// Returns the ranges of bytes of the registers. Each range consists of the index of the PLC, the first byte in the
    /// image, and the number of bytes.
    pub(crate) fn stretches(&self) -> Vec<(DeviceIndex, u32, u32)> {
        match self {
            Self::One(plc, place) => vec![(*plc, place.offset(), place.width().bytes())],
            Self::Several(blocks) => blocks.stretches(),
        }
    }

    /// Returns the read operations for the registers.
    pub(crate) fn reads(&self) -> Vec<Read> {
        match self {
            // If two structures overlay each other, a status register shows which one is valid. One request reads the
            // register and the status register, so that both values are from one moment.
            Self::One(plc, place) => {
                let status = place.status().map(|status| Read::register(*plc, &status));
                [Read::place(*plc, place)].into_iter().chain(status).collect()
            }
            Self::Several(blocks) => blocks.reads(),
        }
    }

    fn holdings(&self, session: &Session, snapshot: &Snapshot, data: &[Vec<u8>]) -> Vec<RegisterReading> {
        match self {
            Self::One(plc, place) => {
                let value = |index: usize| data.get(index).map(|bytes| number(bytes));
                let live = place.phase(value(1));
                let forced = snapshot.is_forced(*plc, place.offset(), place.width().bytes());
                let value = value(0).unwrap_or_default();
                vec![RegisterReading {
                    forced,
                    ..holding(session, place, *plc, live, value, snapshot.time_us)
                }]
            }
            Self::Several(blocks) => blocks.holdings(session, snapshot, data),
        }
    }
}

/// Reads registers at one moment.
///
/// # Errors
/// A name needs its PLC, or the emulator has ended.
pub(crate) fn read(session: &Session, wanted: &[ReadTarget]) -> Result<Vec<RegisterReading>, CliError> {
    let each = read_each(session, &wanted.iter().collect::<Vec<_>>())?;
    Ok(each.into_iter().flatten().collect())
}

/// Reads registers at one moment, and returns the readings of each argument.
///
/// # Errors
/// Returns the errors of [`read`].
pub(crate) fn read_each(
    session: &Session,
    wanted: &[&ReadTarget],
) -> Result<Vec<Vec<RegisterReading>>, CliError> {
    Ok(readings(session, wanted, &session.read(&reads(wanted))?))
}

/// Returns the read operations for the registers of all arguments.
pub(crate) fn reads(wanted: &[&ReadTarget]) -> Vec<Read> {
    wanted.iter().flat_map(|target| target.reads()).collect()
}

/// Returns the readings of each argument from the values of [`reads`].
pub(crate) fn readings(
    session: &Session,
    wanted: &[&ReadTarget],
    snapshot: &Snapshot,
) -> Vec<Vec<RegisterReading>> {
    let mut rest = snapshot.data.as_slice();
    let mut holdings = Vec::new();
    for wanted in wanted {
        let (data, following) = rest.split_at(wanted.reads().len().min(rest.len()));
        holdings.push(wanted.holdings(session, snapshot, data));
        rest = following;
    }
    holdings
}

/// Describes the value of `place` in the PLC with index `plc`, at an emulated time. `live` is the phase of overlaid
/// structures.
pub(crate) fn holding(
    session: &Session,
    place: &NamedLocation,
    plc: DeviceIndex,
    live: RegisterPhase,
    value: u32,
    time_us: u64,
) -> RegisterReading {
    let ty = place.ty(live);
    let bit = place.bit();
    RegisterReading {
        time_us,
        plc: session.plcs().get(plc.index()).cloned().unwrap_or_default(),
        register: session.prefix(plc) + &place.name(live),
        address: place.address().to_string(),
        ty: if bit.is_some() { "BOOL" } else { ty.name() },
        value: bit.map_or(ty.number(value), |bit| i64::from(value >> bit & 1)),
        hex: place.format(live, value),
        meaning: place.meaning(live, value),
        forced: false,
        stretch: (plc, place.offset(), place.width().bytes()),
    }
}

/// Formats a reading: `node2.w_OPTION_STATUS = 16#0043  synchronous operation of the master is being set up`
pub(crate) fn line(holding: &RegisterReading) -> String {
    let RegisterReading { register, hex, .. } = holding;
    let line = format!("{register} = {hex}  {}", holding.marked_meaning());
    format!("{}\n", line.trim_end())
}

/// Converts little-endian bytes to a number.
pub(crate) fn number(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |number, &byte| number << 8 | u32::from(byte))
}
