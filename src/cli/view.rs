//! `commram view`: the plant to look at, on a terminal.

mod actions;
mod draw;
mod drives;
mod frames;
mod input;
mod link;
mod list;
mod look;
mod model;
mod panes;
mod pins;
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
use super::device::of_any_device_but_told_by;
use super::error::CliError;
use super::session::Session;
use crate::layout::{Named, Place, is_pattern, split_plc};
use model::Model;
use std::io::{self, IsTerminal};

/// Look at a running plant: registers, frames, boards, drives, findings.
///
/// Needs a terminal of 80x24 at least; works over ssh. Keys and the mouse move, `?` tells the keys. Looking changes nothing in the plant: it
/// goes, and its journal reads, as if nobody looked. What writes asks before. If the emulator ends, the view waits for the
/// next one of its name.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram view
  commram view node2.w_CPU_CONTROL node2.w_OPTION_STATUS
  commram view 'node2.a_STAT_SL[1..3]' --read-only")]
pub(crate) struct Args {
    /// Registers to be pinned from the start, or patterns
    #[arg(add = complete::registers(), value_name = "REG")]
    registers: Vec<String>,
    /// Refuse whatever would change something in the plant
    #[arg(long)]
    read_only: bool,
    #[command(flatten)]
    instance: Instance,
}

/// Looks until the user has seen enough.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if !io::stdin().is_terminal() || !io::stdout().is_terminal() {
        return Err(CliError::NoTerminal { command: "view" });
    }
    let check = of_any_device_but_told_by(&args.instance);
    args.registers.iter().filter(|text| !is_pattern(text)).try_for_each(|text| check(text).map(drop))?;
    let session = Session::open(&args.instance, 0)?;
    let mut model = Model::new(args.instance.name(), args.read_only);
    for text in &args.registers {
        for (plc, place) in places(&session, text)? {
            model.pins.toggle(plc, place);
        }
    }
    // It would hold a place among the clients as long as the view runs.
    drop(session);
    terminal::run(model, args.instance.name())
}

/// The registers that are meant.
fn places(session: &Session, text: &str) -> Result<Vec<(u16, Place)>, CliError> {
    if !is_pattern(text) {
        let place = session.place(text)?;
        return Ok(vec![(session.plc_of(&place)?, place)]);
    }
    let (plc, name) = split_plc(text);
    let plc = session.plc(plc, name)?;
    let fitted = session.fitted(plc);
    match fitted.area_or_registers(name)? {
        Named::Registers(registers) => {
            let place = |name: String| Ok((plc, Place::parse(&fitted, &name)?));
            registers.iter().map(|register| place(register.name())).collect()
        }
        Named::Area(_) => {
            let right = "a block has too many registers to be pinned; name some of them".to_owned();
            Err(CliError::Argument { text: text.to_owned(), right })
        }
    }
}
