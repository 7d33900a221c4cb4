//! `commram plot`: a picture of registers over time.

mod file;

use super::complete;
use super::device::NameChecks;
use super::device::of_any_device;
use super::error::CliError;
use super::overwrite::refuse_inputs;
use super::place::NamedLocation;
use super::session::{Read, Session};
use super::time;
use super::{Instance, output};
use crate::devices;
use crate::input_file;
use crate::journal::{Selection, Waves, Window};
use crate::plot::{Picture, Plot, Row, address_of};
use crate::request::Op;
use file::RecordedRegisters;
use std::path::{Path, PathBuf};

/// Maximum number of registers in a plot.
const MOST: usize = 64;

/// Draw register values over time as SVG or PNG.
///
/// Codes are drawn as steps, numbers as lines, handshakes as spans from 16#05 to their answer, above the SYNC
/// edges. The data comes from the journal: every change of the registers that the emulator records (`commram run
/// --record`); of other registers only channel writes and firmware answers.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram plot node2.b_CTRLREG_WRC1 'node2.a_WR_VALUE[0]' -o reference.svg
  commram plot node2.w_OPTION_STATUS --since 1.5s --until 1.6s -o start.png
  commram trace --format jsonl >run.jsonl
  commram plot node2.w_OPTION_STATUS --journal run.jsonl -o start.svg")]
pub(crate) struct Args {
    /// Registers by name or address, also single bits
    #[arg(add = complete::registers(), value_name = "REG", required = true)]
    registers: Vec<String>,
    /// Begin of the plot, in emulated time
    #[arg(long = "since", alias = "from", value_name = "TIME", value_parser = time::parse, default_value = "0s", hide_default_value = true)]
    from: u64,
    /// End of the plot [default: now, or the end of the journal]
    #[arg(long = "until", alias = "to", value_name = "TIME", value_parser = time::parse)]
    to: Option<u64>,
    /// Output file with the extension .svg or .png
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Read a journal written by `commram trace --format jsonl`, instead of the journal of an instance
    #[arg(add = complete::files(&["jsonl"]), long, value_name = "FILE")]
    journal: Option<PathBuf>,
    #[command(flatten)]
    instance: Instance,
}

/// Draws the plot and writes it to a file.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let wrong = |text: &Path, right: &dyn std::fmt::Display| CliError::Argument {
        text: text.display().to_string(),
        right: right.to_string(),
    };
    // On the standard output, the picture has the format SVG, because SVG is a text format.
    let name: &Path =
        if input_file::is_standard(&args.output) { Path::new("plot.svg") } else { &args.output };
    let picture =
        Picture::of(name).map_err(|_| wrong(&args.output, &"the file name must end in .svg or .png"))?;
    check(args.registers.len(), args.from, args.to)?;
    refuse_inputs(Some(&args.output), args.journal.as_deref())?;
    let plot = match &args.journal {
        Some(path) => of_file(args, &RecordedRegisters::read(path)?)?,
        None => of_instance(args)?,
    };
    let bytes = plot.render(picture).map_err(|error| wrong(&args.output, &error))?;
    output::write(&args.output, &bytes)?;
    if let Some(to_us) = args.to.filter(|to_us| *to_us > plot.to_us) {
        let (to, last) = (time::short(to_us), time::short(plot.to_us));
        output::note(&format!("--until {to}: the plot ends at {last}, the last known time"));
    }
    for row in &plot.rows {
        let how = if row.is_recorded { "" } else { " (run --record, record)" };
        if let Some(note) = &row.note {
            output::note(&format!("{}: {note}{how}", row.name));
        }
    }
    Ok(())
}

/// Refuses too many registers, and a window that does not end after its begin.
fn check(registers: usize, from: u64, to: Option<u64>) -> Result<(), CliError> {
    if registers > MOST {
        let right = format!("a plot has at most {MOST} registers");
        return Err(CliError::Argument { text: format!("{registers} registers"), right });
    }
    if to.is_some_and(|to| to <= from) {
        let right = "the end must be later than --since".to_owned();
        return Err(CliError::Argument { text: "--until".to_owned(), right });
    }
    Ok(())
}

/// Returns the end of the window in microseconds: `to`, or the last known time if that is earlier. No values are known
/// after it.
///
/// # Errors
/// The window begins after the last known time.
fn end_of(from_us: u64, to_us: Option<u64>, last_us: u64, source: &str) -> Result<u64, CliError> {
    if from_us > last_us {
        let right = format!("{source} ends at {}; choose an earlier begin", time::short(last_us));
        return Err(CliError::Argument { text: format!("--since {}", time::short(from_us)), right });
    }
    Ok(to_us.map_or(last_us, |to_us| to_us.min(last_us)))
}

fn of_instance(args: &Args) -> Result<Plot, CliError> {
    let checks = NameChecks::new(&args.instance);
    args.registers.iter().try_for_each(|text| checks.place(text).map(drop))?;
    drop(checks);
    of_session(&Session::open(&args.instance, 0)?, &args.registers, args.from, args.to)
}

/// Returns the plot of registers of an instance between the emulated times `from` and `to`, in microseconds; without
/// `to` up to the present.
///
/// # Errors
/// A register cannot be drawn, the window has no length or begins later than now, or the emulator has ended. An end
/// later than now is no error: the plot then ends now.
pub(crate) fn of_session(
    session: &Session,
    registers: &[String],
    from: u64,
    to: Option<u64>,
) -> Result<Plot, CliError> {
    check(registers.len(), from, to)?;
    let places = registers.iter().map(|text| {
        let place = whole(session.place(text)?)?;
        Ok((session.plc_of(&place)?, place))
    });
    let places = places.collect::<Result<Vec<_>, CliError>>()?;
    let info = session.info()?;
    let to_us = end_of(from, to, info.time_us, &format!("instance '{}'", session.instance()))?;
    let window = Window::of_picture(from, to_us);
    let records = session.records(0)?;
    let waves = Waves::within(window, &records, &Selection::default(), info.names, devices::catalogue());
    let reads: Vec<_> = places.iter().map(|(plc, place)| Read::place(*plc, place)).collect();
    let held = session.read(&reads)?.data;
    let asked = places.iter().map(|(plc, place)| {
        let offset = address_of(place).offset();
        Ok(session.ask(Op::IsRecorded { plc: *plc, offset })?.value()? == 1)
    });
    let recorded = asked.collect::<Result<Vec<_>, CliError>>()?;
    let rows = places.iter().zip(held).zip(recorded).map(|(((plc, place), held), is_recorded)| {
        let name = format!("{}{}", session.prefix(*plc), place.name(place.last_phase()));
        let address = address_of(place);
        let row = Row::of(name, place, &waves.register(*plc, address.offset(), address.width()));
        let mut word = [0; 4];
        word.iter_mut().zip(held).for_each(|(to, from)| *to = from);
        row.or_holds(&place.format(place.last_phase(), u32::from_le_bytes(word)), is_recorded)
    });
    Ok(Plot::new(from, to_us, waves.edges(), rows.collect()))
}

fn of_file(args: &Args, journal_data: &RecordedRegisters) -> Result<Plot, CliError> {
    let to_us = end_of(args.from, args.to, journal_data.end_us, "the journal")?;
    let window = Window::of_picture(args.from, to_us);
    let rows = args.registers.iter().map(|text| {
        let place = whole(of_any_device(text)?)?;
        let (plc, address) = (place.plc.as_deref(), address_of(&place));
        let past = journal_data.register(plc, &address.to_string(), address.width(), text, window)?;
        Ok(Row::of(text.clone(), &place, &past))
    });
    let rows = rows.collect::<Result<Vec<_>, CliError>>()?;
    Ok(Plot::new(args.from, to_us, journal_data.edges(window)?, rows))
}

/// Accepts a whole register or a single bit; refuses other parts.
fn whole(place: NamedLocation) -> Result<NamedLocation, CliError> {
    if place.is_whole() || place.bit_in().is_some() {
        return Ok(place);
    }
    let right = "this is a part of a register, or covers several; name one register".to_owned();
    Err(CliError::Argument { text: place.text().to_owned(), right })
}
