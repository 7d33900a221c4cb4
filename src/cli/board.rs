//! `commram board`: front, supply and program start of a PLC.

use super::Instance;
use super::error::CliError;
use super::table::{self, FormatArg, Row};
use clap::Subcommand;
use commram::layout::RegType;
use commram::memory::header::{BoardSetting, BoardState, Power, ProgramState, RunSwitch, Start};
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
  commram board reset
  commram board power-cycle line2")]
pub struct Args {
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
    /// hot, stop)
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
        ]
    }
}

impl Entry {
    fn new(plc: &str, state: &BoardState) -> Self {
        Entry {
            plc: plc.to_owned(),
            display: state.display_text(),
            leds: format!("2#{:04b}", state.leds & 0xF),
            switch: named(RunSwitch::from_code(state.switch), state.switch),
            power: named(Power::from_code(state.power), state.power),
            dip: state.dip,
            dip_latched: state.dip_latched,
            program: named(ProgramState::from_code(state.program), state.program),
            start: named(Start::from_code(state.start_kind), state.start_kind),
            restarts: state.restarts,
        }
    }
}

/// The name of a code, as words: `boot project copied`.
fn named(name: Option<impl std::fmt::Debug>, code: u32) -> String {
    let Some(name) = name else { return code.to_string() };
    let mut words = String::new();
    for character in format!("{name:?}").chars() {
        if character.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(character.to_lowercase());
    }
    words
}

/// PLC and setting of `line2:dip=5`.
fn parse(text: &str) -> Result<(Option<&str>, BoardSetting), CliError> {
    let wrong = |right: &str| CliError::Argument { text: text.to_owned(), right: right.to_owned() };
    let (place, value) = text.split_once('=').ok_or_else(|| wrong("write NAME=VALUE, for example dip=5"))?;
    let (plc, name) = commram::layout::split_plc(place);
    let number = |limit: u8| {
        let number =
            commram::layout::value::parse(value, RegType::Usint).ok().and_then(|it| u8::try_from(it).ok());
        let right = format!("{name} is a number from 0 to {limit}");
        number.filter(|number| *number <= limit).ok_or_else(|| wrong(&right))
    };
    let setting = match (name, value) {
        ("dip", _) => BoardSetting::Dip(number(31)?),
        ("leds", _) => BoardSetting::Leds(number(15)?),
        ("switch", "run") => BoardSetting::Switch(RunSwitch::Run),
        ("switch", "stop") => BoardSetting::Switch(RunSwitch::Stop),
        ("switch", "reset") => BoardSetting::Switch(RunSwitch::Reset),
        ("switch", _) => return Err(wrong("the switch has the positions run, stop, reset")),
        ("power", "on") => BoardSetting::Power(Power::On),
        ("power", "off") => BoardSetting::Power(Power::Off),
        ("power", _) => return Err(wrong("power is on or off")),
        ("start", "cold") => BoardSetting::Start(Start::Cold),
        ("start", "warm") => BoardSetting::Start(Start::Warm),
        ("start", "hot") => BoardSetting::Start(Start::Hot),
        ("start", "stop") => BoardSetting::Start(Start::Stop),
        ("start", _) => return Err(wrong("starts are cold, warm, hot; stop ends the program")),
        _ => return Err(wrong("there are dip, leds, switch, power and start")),
    };
    Ok((plc, setting))
}

/// Runs the command.
pub fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::Get { plc, format, instance } => get(plc.as_deref(), format, instance),
        Command::Set { settings, instance } => {
            let settings = settings.iter().map(|text| Ok((text.as_str(), parse(text)?)));
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
    use commram::channel::Op;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_named() {
        assert_eq!(parse("dip=31").unwrap(), (None, BoardSetting::Dip(31)));
        assert_eq!(parse("line2:leds=2#1010").unwrap(), (Some("line2"), BoardSetting::Leds(10)));
        assert_eq!(parse("switch=reset").unwrap().1, BoardSetting::Switch(RunSwitch::Reset));
        assert_eq!(parse("start=hot").unwrap().1, BoardSetting::Start(Start::Hot));
        let message = |text| parse(text).err().unwrap().to_string();
        assert_eq!(message("dip=32"), "`dip=32`: dip is a number from 0 to 31");
        assert_eq!(message("dip"), "`dip`: write NAME=VALUE, for example dip=5");
        assert!(message("switch=off").contains("run, stop, reset"));
        assert!(message("display=8").contains("there are dip, leds"));
    }

    #[test]
    fn codes_are_told_in_words() {
        assert_eq!(named(ProgramState::from_code(6), 6), "boot project copied");
        assert_eq!(named(ProgramState::from_code(60), 60), "60");
    }
}
