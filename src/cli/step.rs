//! `commram step`: advance the clock, or go back.

use super::device::{NameChecks, on_any_device};
use super::error::CliError;
use super::{Instance, time};
use crate::layout::{DeviceFit, split_plc};
use crate::request::MAX_ADVANCE_US;

/// Advance the emulated time, or go back (stepped mode only).
///
/// Prints the new emulated time. Going back restores the plant as it was then, and later events are lost. A stepped
/// instance keeps earlier states as long as there is memory for them (`commram run --keep-states`). The actions of
/// clients at the moment to which the plant returns are kept; `--back-to-start` also undoes their actions at the start.
/// Going back is refused while a task in lockstep, a program that has mapped the registers or a guest at a door takes
/// part, because these cannot go back.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram step 2ms
  commram step 500us
  commram step --to-sync
  commram step --to-sync line2:node1
  commram step --back 10ms
  commram step --back-to node2.w_OPTION_STATUS==16#0043
  commram step --back-to-start")]
pub(crate) struct Args {
    /// Time to advance (us, ms, s, min, h)
    #[arg(value_name = "TIME", value_parser = advance_time, required_unless_present_any = ["to_sync", "back", "back_to", "back_to_start"])]
    time: Option<u64>,
    /// Advance to the next SYNC on the bus of a port, with the PLC in front if there are several [default: the
    /// device's first master]
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "", conflicts_with = "time")]
    to_sync: Option<String>,
    /// Go back by this time (us, ms, s, min, h)
    #[arg(long, value_name = "TIME", value_parser = time::parse, conflicts_with_all = ["time", "to_sync"])]
    back: Option<u64>,
    /// Go back to the last moment before now at which a condition became true: REG==VALUE, as for `commram wait`; with
    /// several conditions all must be true
    #[arg(add = super::complete::conditions(), long, value_name = "CONDITION", conflicts_with_all = ["time", "to_sync", "back"])]
    back_to: Vec<String>,
    /// Go back to the start of the plant, before all actions of clients
    #[arg(long, conflicts_with_all = ["time", "to_sync", "back", "back_to"])]
    back_to_start: bool,
    /// Go back even if programs outside the emulator take part
    #[arg(long = "ignore-programs", alias = "detached")]
    detached: bool,
    #[command(flatten)]
    instance: Instance,
}

/// Parses a time by which one command can advance the clock, in microseconds.
///
/// # Errors
/// The text is not a time, or is longer than [`MAX_ADVANCE_US`].
pub(crate) fn advance_time(text: &str) -> Result<u64, String> {
    let us = time::parse(text).map_err(|error| error.to_string())?;
    if us > MAX_ADVANCE_US {
        let most = time::long(MAX_ADVANCE_US);
        return Err(format!("one command advances the clock by at most {most} of emulated time"));
    }
    Ok(us)
}

/// Checks that some device has this port. If no device of the program has it, asks the instance.
fn check(instance: &Instance, text: &str) -> Result<(), CliError> {
    let (_, name) = split_plc(text);
    if name.is_empty() {
        return Ok(());
    }
    let look_up = |fitted: &DeviceFit| fitted.device().port_named(name).map(drop);
    on_any_device(look_up).or_else(|refusal| {
        NameChecks::new(instance).answer(refusal, |session| session.port(text).map(drop), look_up)
    })
}

/// Advances the clock or goes back.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    use super::output;
    use super::session::Session;
    use super::wait::conditions_of;
    use crate::request::{Op, WrongReply};

    args.to_sync.as_deref().map_or(Ok(()), |port| check(&args.instance, port))?;
    let session = Session::open(&args.instance, args.time.unwrap_or(0))?;
    if !args.back_to.is_empty() {
        let mut ops = conditions_of(&session, &args.back_to)?;
        ops.push(Op::BackUntil { any: false, detached: args.detached });
        let found = session.request(&ops)?.pop().ok_or(WrongReply)?.waited()?;
        return output::print(&format!("{}\n", time::seconds(found.time_us)));
    }
    let op = match &args.to_sync {
        Some(text) => {
            let (plc, node) = session.port(text)?;
            Op::AdvanceToSync { plc, node }
        }
        None if args.back_to_start => Op::BackToStart { detached: args.detached },
        None if args.back.is_some() => Op::Back { us: args.back.unwrap_or(0), detached: args.detached },
        None => Op::Advance { us: args.time.unwrap_or(0) },
    };
    let time_us = session.ask(op)?.time()?;
    output::print(&format!("{}\n", time::seconds(time_us)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_named_as_in_registers() {
        let nobody = Instance::running("nobody-has-this-name");
        for port in ["", "node2", "line2:node1", "slotG"] {
            check(&nobody, port).unwrap();
        }
        // The port may belong to a device in a folder.
        assert_eq!(check(&nobody, "node3").unwrap_err().exit_code(), 3);
    }
}
