//! `commram drive`: drives of an instance, their states and parameters.

use super::error::CliError;
use super::table::FormatArg;
use super::{Instance, complete};
use clap::{Args as ClapArgs, Subcommand};

/// Show the drives with their states and parameters, set parameters.
///
/// Drives are the drives on buses, by their names in the plant file, and the drives that contain a PLC,
/// `line:drive`.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram drive list
  commram drive show drive1
  commram drive set drive1 P167=2000
  commram drive set line:drive P304=1 P300=-1000")]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    List(List),
    Show(Show),
    Set(Set),
}

/// List the drives and their states.
///
/// `reference` and `speed` are in increments of the drive's speed format, `fault` is P308. Position reference
/// values (P258) reach a drive only while it is synchronized.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram drive list
  commram drive list --format json")]
struct List {
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// Show a drive: state, speed, parameters, and the ZK parameters of its card.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram drive show drive1
  commram drive show line:drive --format json")]
struct Show {
    /// The drive, as `list` names it
    #[arg(add = complete::drives())]
    drive: String,
    #[command(flatten)]
    format: FormatArg,
    #[command(flatten)]
    instance: Instance,
}

/// Set parameters of a drive, as from its operating panel.
///
/// All parameters are set in one message, in the given order, up to the first one that the drive refuses. ZK
/// parameters cannot be set while the drive has power; they are defined in the plant file.
#[derive(ClapArgs)]
#[command(after_help = "\
Examples:
  commram drive set drive1 P167=2000
  commram drive set drive1 P120=16#0006 P120=16#0007 P120=16#000F")]
struct Set {
    /// The drive, as `list` names it
    #[arg(add = complete::drives())]
    drive: String,
    /// Numbers of parameters, with or without P, and their new values
    #[arg(add = complete::parameters(), value_name = "PARAMETER=VALUE", required = true, value_parser = setting)]
    settings: Vec<(u16, i64)>,
    #[command(flatten)]
    instance: Instance,
}

/// Parses a setting such as `P167=2000`.
fn setting(text: &str) -> Result<(u16, i64), String> {
    use crate::layout::{RegType, value};
    let (number, new) = text.split_once('=').ok_or("write NUMBER=VALUE, for example P167=2000")?;
    let number = number.trim().trim_start_matches(['P', 'p']);
    let number = number.parse().map_err(|_| format!("`{number}` is not a parameter number, 0 to 4095"))?;
    let signed = |_| value::parse(new, RegType::Dint).map(|bits| i64::from(bits as i32));
    let value = value::parse(new, RegType::Dword).map(i64::from).or_else(signed);
    value.map(|value| (number, value)).map_err(|error| error.to_string())
}

pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    match &args.command {
        Command::List(args) => by_channel::list(args.format.format, &args.instance),
        Command::Show(args) => by_channel::show(&args.drive, args.format.format, &args.instance),
        Command::Set(args) => by_channel::set(&args.drive, &args.settings, &args.instance),
    }
}

mod by_channel {
    use super::super::session::Session;
    use super::super::table::{self, Format, Row};
    use super::super::{Instance, error::CliError};
    use crate::layout::did_you_mean;
    use crate::request::json::drives::{DriveJson, DriveLine, ParameterJson};
    use crate::request::{DriveEntry, Op};
    use serde::Serialize;

    impl Row for DriveLine {
        const COLUMNS: &'static [&'static str] = &[
            "drive",
            "bus",
            "number",
            "state",
            "synchronized",
            "reference",
            "speed",
            "fault",
            "status_word",
            "kbit_s",
            "lost_references",
            "stopped",
        ];

        fn cells(&self) -> Vec<String> {
            let state = &self.state;
            let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
            vec![
                self.drive.clone(),
                or_dash(self.bus.clone()),
                or_dash(state.number.map(|number| number.to_string())),
                state.state.clone(),
                state.synchronized.to_string(),
                state.reference.to_string(),
                state.speed.to_string(),
                state.fault.to_string(),
                format!("16#{:04X}", state.status_word),
                or_dash(state.kbit_s.map(|rate| rate.to_string())),
                state.lost_references.to_string(),
                state.stopped.to_string(),
            ]
        }

        fn text_cells(&self) -> Vec<String> {
            let mut cells = self.cells();
            // Eight columns fit a terminal; `show` prints the other columns.
            cells.truncate(8);
            cells
        }
    }

    pub(super) fn list(format: Format, instance: &Instance) -> Result<(), CliError> {
        let session = Session::open(instance, 0)?;
        let lines: Vec<_> = session.ask(Op::Drives)?.drives()?.into_iter().map(DriveLine::from).collect();
        table::print(format, &lines, |lines| match lines {
            [] => "the plant has no drive\n".to_owned(),
            lines => table::aligned(lines),
        })
    }

    /// Finds the drive of this name. Returns its number and its entry.
    fn find(session: &Session, name: &str, instance: &Instance) -> Result<(u16, DriveEntry), CliError> {
        let mut drives = session.ask(Op::Drives)?.drives()?;
        match drives.iter().position(|drive| drive.name == name) {
            Some(index) => Ok((index as u16, drives.swap_remove(index))),
            None => {
                let names = || drives.iter().map(|drive| drive.name.as_str());
                let (near, known) = (did_you_mean(name, names()), names().collect::<Vec<_>>().join(", "));
                let known = if known.is_empty() { "none".to_owned() } else { known };
                let instance = instance.name();
                let right = format!("instance '{instance}' has the drives {known}, not this one{near}");
                Err(CliError::Argument { text: name.to_owned(), right })
            }
        }
    }

    /// All details of a drive, with its name and bus.
    #[derive(Serialize)]
    struct DriveOutput {
        drive: String,
        bus: Option<String>,
        #[serde(flatten)]
        details: DriveJson,
        #[serde(skip)]
        cells: Vec<String>,
    }

    impl Row for DriveOutput {
        const COLUMNS: &'static [&'static str] = DriveLine::COLUMNS;

        fn cells(&self) -> Vec<String> {
            self.cells.clone()
        }
    }

    impl Row for ParameterJson {
        const COLUMNS: &'static [&'static str] =
            &["parameter", "value", "unit", "min", "max", "read_only", "name", "provenance"];

        fn cells(&self) -> Vec<String> {
            let or_dash = |text: &str| if text.is_empty() { "-".to_owned() } else { text.to_owned() };
            let state = &self.state;
            vec![
                format!("P{}", state.number),
                state.value.to_string(),
                or_dash(&state.unit),
                state.min.to_string(),
                state.max.to_string(),
                state.read_only.to_string(),
                or_dash(&state.name),
                or_dash(self.provenance.as_deref().unwrap_or_default()),
            ]
        }
    }

    pub(super) fn show(name: &str, format: Format, instance: &Instance) -> Result<(), CliError> {
        let session = Session::open(instance, 0)?;
        let (drive, entry) = find(&session, name, instance)?;
        let details = session.ask(Op::Drive { drive })?.drive()?;
        let DriveEntry { name: drive, bus, .. } = entry.clone();
        let cells = DriveLine::from(DriveEntry { state: details.state.clone(), ..entry }).cells();
        let shown = DriveOutput { drive, bus, details: details.into(), cells };
        table::print(format, &[shown], |shown| shown.iter().map(text).collect())
    }

    fn text(shown: &DriveOutput) -> String {
        let head = DriveLine::COLUMNS.iter().map(|name| name.replace('_', " "));
        let lines: Vec<_> = head.zip(shown.cells()).map(|(name, cell)| vec![name, cell]).collect();
        let mut text = table::columns(&lines) + "\n" + &table::aligned(&shown.details.parameters);
        if !shown.details.zk.is_empty() {
            let zk = shown.details.zk.iter().map(|(number, value)| {
                vec![format!("ZK {number}"), format!("{value}"), format!("16#{value:04X}")]
            });
            let head = ["CARD", "VALUE", ""].map(str::to_owned).to_vec();
            text += "\n";
            text += &table::with_head(head, zk.collect());
        }
        text
    }

    pub(super) fn set(name: &str, settings: &[(u16, i64)], instance: &Instance) -> Result<(), CliError> {
        let session = Session::open(instance, 0)?;
        let (drive, _) = find(&session, name, instance)?;
        let op = |&(number, value): &(u16, i64)| Op::SetParameter { drive, number, value };
        session.request(&settings.iter().map(op).collect::<Vec<_>>()).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_consists_of_a_number_and_a_value() {
        assert_eq!(setting("P167=2000"), Ok((167, 2000)));
        assert_eq!(setting("300=-1000"), Ok((300, -1000)));
        assert_eq!(setting("p120=16#000F"), Ok((120, 15)));
        assert_eq!(setting("P300=4294967295"), Ok((300, 4_294_967_295)));
        assert!(setting("P167").unwrap_err().contains("for example P167=2000"));
        assert!(setting("ZK0=1").unwrap_err().contains("not a parameter number"));
        assert!(setting("P167=x").unwrap_err().contains("is no number"));
    }
}
