//! `commram step`: let the emulated time pass.

use super::device::on_any_device;
use super::error::CliError;
use super::{Instance, time};
use crate::layout::split_plc;

/// Let the emulated time pass (stepped mode only).
///
/// Prints the new emulated time.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram step 2ms
  commram step 500us
  commram step --to-sync
  commram step --to-sync line2:node1")]
pub(crate) struct Args {
    /// How long (us, ms, s, min, h)
    #[arg(value_name = "TIME", value_parser = time::parse, required_unless_present = "to_sync")]
    time: Option<u64>,
    /// Up to the next SYNC on the bus of a port, with the PLC in front if there are several [default: the device's first master]
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "", conflicts_with = "time")]
    to_sync: Option<String>,
    #[command(flatten)]
    instance: Instance,
}

/// Whether any device has such a port.
fn check(text: &str) -> Result<(), CliError> {
    let (_, name) = split_plc(text);
    if name.is_empty() { Ok(()) } else { on_any_device(|fitted| fitted.device().port_named(name).map(drop)) }
}

/// Lets the time pass.
#[cfg(feature = "channel")]
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    use super::output;
    use super::session::Session;
    use crate::request::Op;

    args.to_sync.as_deref().map_or(Ok(()), check)?;
    let session = Session::open(&args.instance, args.time.unwrap_or(0))?;
    let op = match &args.to_sync {
        Some(text) => {
            let (plc, node) = session.port(text)?;
            Op::AdvanceToSync { plc, node }
        }
        None => Op::Advance { us: args.time.unwrap_or(0) },
    };
    let time_us = session.ask(op)?.time()?;
    output::print(&format!("{}\n", time::seconds(time_us)))
}

/// Checks the arguments and says that there is no channel.
#[cfg(not(feature = "channel"))]
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    args.to_sync.as_deref().map_or(Ok(()), check)?;
    Err(CliError::NoChannel { command: "step" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_named_as_in_registers() {
        assert!(["", "node2", "line2:node1", "slotG"].into_iter().all(|text| check(text).is_ok()));
        let error = check("node3").unwrap_err();
        assert_eq!(error.to_string(), "unknown port `node3`; the ports are node1, node2");
        assert_eq!(error.exit_code(), 2);
    }
}
