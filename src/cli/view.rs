//! `commram view`: a view of the plant on a terminal.

mod actions;
mod draw;
mod drives;
mod frames;
mod input;
mod link;
mod list;
mod model;
mod panes;
mod pins;
mod poll;
mod prompt;
mod source;
mod style;
mod terminal;
#[cfg(test)]
mod tests;
mod tree;
mod work;

use super::Instance;
use super::complete;
use super::device::NameChecks;
use super::error::CliError;
use super::session::Session;
use crate::identity::DeviceIndex;
use crate::layout::{AreaOrRegisters, NamedLocation, is_pattern, split_plc};
pub(crate) use frames::{Frames, WindowFrames};
use model::Model;
use std::io::{self, IsTerminal};

/// View a running plant: registers, frames, boards, drives, findings.
///
/// The view needs a terminal of at least 80x24 and works over ssh. Use keys and the mouse to move; `?` lists the
/// keys. Viewing changes nothing in the plant: its behaviour and its journal are the same as without a view.
/// Actions that change something ask before. If the emulator ends, the view waits for the next emulator of the same
/// name.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram view
  commram view node2.w_CPU_CONTROL node2.w_OPTION_STATUS
  commram view 'node2.a_STAT_SL[1..3]' --read-only")]
pub(crate) struct Args {
    /// Registers or patterns to pin at the start
    #[arg(add = complete::registers(), value_name = "REG")]
    registers: Vec<String>,
    /// Refuse all actions that change something in the plant
    #[arg(long)]
    read_only: bool,
    #[command(flatten)]
    instance: Instance,
}

/// Runs the view until the user quits.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if !io::stdin().is_terminal() || !io::stdout().is_terminal() {
        return Err(CliError::NoTerminal { command: "view" });
    }
    let checks = NameChecks::new(&args.instance);
    args.registers
        .iter()
        .filter(|text| !is_pattern(text))
        .try_for_each(|text| checks.place(text).map(drop))?;
    drop(checks);
    let session = Session::open(&args.instance, 0)?;
    let mut model = Model::new(args.instance.name(), args.read_only);
    for text in &args.registers {
        for (plc, place) in places(&session, text)? {
            model.pins.toggle(plc, place);
        }
    }
    // The view opens its own connection. So this session is closed; otherwise it would occupy the place of a client
    // while the view runs.
    drop(session);
    terminal::run(model, args.instance.name())
}

/// Finds the registers of a name or pattern.
fn places(session: &Session, text: &str) -> Result<Vec<(DeviceIndex, NamedLocation)>, CliError> {
    if !is_pattern(text) {
        let place = session.place(text)?;
        return Ok(vec![(session.plc_of(&place)?, place)]);
    }
    let (plc, name) = split_plc(text);
    let plc = session.plc(plc, name)?;
    let fitted = session.fitted(plc);
    match fitted.area_or_registers(name)? {
        AreaOrRegisters::Registers(registers) => {
            let place = |name: String| Ok((plc, NamedLocation::parse(&fitted, &name)?));
            registers.iter().map(|register| place(register.name())).collect()
        }
        AreaOrRegisters::Area(_) => {
            let right = "a block has too many registers to pin; name single registers".to_owned();
            Err(CliError::Argument { text: text.to_owned(), right })
        }
    }
}
