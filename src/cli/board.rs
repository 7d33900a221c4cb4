//! `commram board`: front, supply and program start of a PLC.

use super::Instance;
use super::error::CliError;
use super::table::{self, FormatArg, Row};
use crate::memory::header::{BoardSetting, BoardState, BoardWords};
use clap::Subcommand;
use serde::Serialize;

/// Look at the board of a PLC, turn its switches, reset it, switch it off and on.
///
/// The DIP switch counts from the next power-on or reset on. A PLC in RESET or without supply leaves its buses; other
/// PLCs go on.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram board get
  commram board get line2 --format json
  commram board set dip=5 switch=stop
  commram board set line2:power=off
  commram board set start=cold
  commram board set project=sent
  commram board reset
  commram board power-cycle line2")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Show the board of each PLC, or of one
    Get {
        /// Name of the PLC
        plc: Option<String>,
        #[command(flatten)]
        format: FormatArg,
        #[command(flatten)]
        instance: Instance,
    },
    /// Turn switches: dip (0 to 31), leds (0 to 15), switch (run, stop, reset), power (on, off), start (cold, warm,
    /// hot, stop), project (none, boot, sent)
    Set {
        /// What to set, with the PLC in front if there are several
        #[arg(value_name = "NAME=VALUE", required = true)]
        settings: Vec<String>,
        #[command(flatten)]
        instance: Instance,
    },
    /// Press RESET and release it; the switch then stands at STOP
    Reset {
        /// Name of the PLC
        plc: Option<String>,
        #[command(flatten)]
        instance: Instance,
    },
    /// Switch the supply off and on
    PowerCycle {
        /// Name of the PLC
        plc: Option<String>,
        #[command(flatten)]
        instance: Instance,
    },
}

/// The board of one PLC.
#[derive(Serialize)]
struct Entry {
    plc: String,
    display: String,
    leds: String,
    switch: String,
    power: String,
    dip: u32,
    dip_latched: u32,
    program: String,
    start: String,
    restarts: u32,
    project: String,
}

impl Row for Entry {
    const COLUMNS: &'static [&'static str] = &[
        "plc",
        "display",
        "leds",
        "switch",
        "power",
        "dip",
        "dip latched",
        "program",
        "last start",
        "restarts",
        "project",
    ];

    fn cells(&self) -> Vec<String> {
        vec![
            self.plc.clone(),
            if self.display.trim().is_empty() { "dark".to_owned() } else { self.display.clone() },
            self.leds.clone(),
            self.switch.clone(),
            self.power.clone(),
            self.dip.to_string(),
            self.dip_latched.to_string(),
            self.program.clone(),
            self.start.clone(),
            self.restarts.to_string(),
            self.project.clone(),
        ]
    }
}

impl Entry {
    fn new(plc: &str, state: &BoardState) -> Self {
        let BoardWords { display, leds, switch, power, dip, dip_latched, program, start, restarts, project } =
            state.words();
        let plc = plc.to_owned();
        Entry { plc, display, leds, switch, power, dip, dip_latched, program, start, restarts, project }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Get { plc, format, instance } => get(plc.as_deref(), format, instance),
        Command::Set { settings, instance } => {
            let settings = settings.iter().map(|text| Ok((text.as_str(), BoardSetting::parse(text)?)));
            let settings = settings.collect::<Result<Vec<_>, CliError>>()?;
            set(instance, &settings)
        }
        Command::Reset { plc, instance } => one(plc.as_deref(), BoardSetting::Reset, instance),
        Command::PowerCycle { plc, instance } => one(plc.as_deref(), BoardSetting::PowerCycle, instance),
    }
}

fn one(plc: Option<&str>, setting: BoardSetting, instance: &Instance) -> Result<(), CliError> {
    set(instance, &[("the board", (plc, setting))])
}

fn get(plc: Option<&str>, format: &FormatArg, instance: &Instance) -> Result<(), CliError> {
    use super::session::Session;
    let session = Session::open_for_reading(&instance.name)?;
    let only = plc.map(|plc| session.plc(Some(plc), plc)).transpose()?;
    let boards = session.boards()?;
    let rows: Vec<_> = boards
        .iter()
        .enumerate()
        .filter(|(number, _)| only.is_none_or(|only| usize::from(only) == *number))
        .map(|(_, (plc, state))| Entry::new(plc, state))
        .collect();
    table::print(format.format, &rows, table::aligned)
}

/// Does all of it in one message.
#[cfg(feature = "channel")]
fn set(instance: &Instance, settings: &[(&str, (Option<&str>, BoardSetting))]) -> Result<(), CliError> {
    use super::session::Session;
    use crate::request::Op;
    let session = Session::open(&instance.name, 0)?;
    let op = |(text, (plc, setting)): &(&str, (Option<&str>, BoardSetting))| {
        Ok(Op::SetBoard { plc: session.plc(*plc, text)?, setting: *setting })
    };
    let ops = settings.iter().map(op).collect::<Result<Vec<_>, CliError>>()?;
    session.request(&ops).map(drop)
}

/// Says that there is no channel.
#[cfg(not(feature = "channel"))]
fn set(_: &Instance, _: &[(&str, (Option<&str>, BoardSetting))]) -> Result<(), CliError> {
    Err(CliError::NoChannel { command: "board" })
}
