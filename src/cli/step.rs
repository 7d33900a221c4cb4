//! `commram step`: let the emulated time pass.

use super::error::CliError;
use super::{Instance, time};

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
pub struct Args {
    /// How long (us, ms, s, min, h)
    #[arg(value_name = "TIME", value_parser = time::parse, required_unless_present = "to_sync")]
    time: Option<u64>,
    /// Up to the next SYNC on the bus of a CANsync node: node1 or node2, with the PLC in front if there are several
    #[arg(
        long,
        value_name = "NODE",
        num_args = 0..=1,
        default_missing_value = "node2",
        conflicts_with = "time"
    )]
    to_sync: Option<String>,
    #[command(flatten)]
    instance: Instance,
}

/// PLC and number of a CANsync node.
fn node(text: &str) -> Result<(Option<&str>, u8), CliError> {
    let (plc, name) = commram::layout::split_plc(text);
    let number = match name {
        "node1" => 1,
        "node2" => 2,
        _ => {
            let right = "the CANsync nodes are node1 and node2".to_owned();
            return Err(CliError::Argument { text: text.to_owned(), right });
        }
    };
    Ok((plc, number))
}

/// Lets the time pass.
#[cfg(feature = "channel")]
pub fn run(args: &Args) -> Result<(), CliError> {
    use super::output;
    use super::session::Session;
    use commram::request::Op;

    let to_sync = args.to_sync.as_deref().map(|text| Ok::<_, CliError>((text, node(text)?))).transpose()?;
    let session = Session::open(&args.instance.name, args.time.unwrap_or(0))?;
    let op = match to_sync {
        Some((text, (plc, node))) => Op::AdvanceToSync { plc: session.plc(plc, text)?, node },
        None => Op::Advance { us: args.time.unwrap_or(0) },
    };
    let time_us = session.ask(op)?.time()?;
    output::print(&format!("{}\n", time::seconds(time_us)))
}

/// Checks the arguments and says that there is no channel.
#[cfg(not(feature = "channel"))]
pub fn run(args: &Args) -> Result<(), CliError> {
    args.to_sync.as_deref().map(node).transpose()?;
    Err(CliError::NoChannel { command: "step" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_named_as_in_registers() {
        assert_eq!(node("node2").unwrap(), (None, 2));
        assert_eq!(node("line2:node1").unwrap(), (Some("line2"), 1));
        let error = node("node3").unwrap_err();
        assert_eq!(error.to_string(), "`node3`: the CANsync nodes are node1 and node2");
        assert_eq!(error.exit_code(), 2);
    }
}
